# SPDX-License-Identifier: MIT
"""What a robot cannot follow is refused before it arms, with the limit's name; what it can is driven."""

from __future__ import annotations

import json
import math
import os
import sys
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from omni.cli import app
from omni.cli.keyboard import KeyDriver, _Keys, split_keys
from omniwheel import FirmwareProcess
from omniwheel.capability import drive_model
from omniwheel.capability.reach import check_velocity
from omniwheel.capability.travel import travel_time_s
from omniwheel.errors import LimitError
from omniwheel.frames import Pose, Twist
from omniwheel.robot import connect
from omniwheel.robots import read_robot
from omniwheel.telemetry import Tracking


def omni(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("velocity 1.5 0 0", "LIM_WHEEL is 3 rad/s"),
        ("velocity 0.1 0 2", "LIM_WHEEL is 3 rad/s"),
        ("velocity 0 0 0.7", "LIM_WHEEL is 3 rad/s"),
        ("velocity 0 0.17 0 --world-frame", "LIM_WHEEL is 3 rad/s"),
        ("pose 0.1 0 90", "90deg"),
        ("pose 500 0 0", "LIM_POS"),
        ("pose 3 0 0 --duration 5", "5 s"),
        ("pose 0.1 0 ninety", "ninety"),
        ("pose 0.1 0 infdeg", "theta"),
        ("duty 0.1 0.1", "2 duties for 3 wheels"),
        ("trajectory foo", "rose"),
    ],
)
def test_refused_before_arming(url: str, words: str, said: str) -> None:
    result = omni("drive", *words.split(), "--link", url)
    assert result.exit_code == 2, result
    assert said in result.stderr.replace("\n", " ")
    assert "armed" not in result.stderr
    with connect(url) as robot:
        assert not robot.status.armed


SETPOINTS = {"SET_POSITION_TARGET_LOCAL_NED", "OMNI_SETPOINT_DUTY"}


def test_the_api_raises_and_sends_nothing(firmware: FirmwareProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    with connect(firmware.urls[0]) as robot:
        sent: list[str] = []
        send = robot.connection.send

        def listen(message: Any) -> None:
            sent.append(message.get_type())
            send(message)

        monkeypatch.setattr(robot.connection, "send", listen)
        robot.arm()
        with pytest.raises(LimitError):
            robot.drive(1.0, 0.0, 0.0, 0.1)
        with pytest.raises(LimitError):
            robot.drive_to(0.0, 0.0, 90.0)
        with pytest.raises(LimitError):
            robot.drive_duty([0.1] * 4, 0.1)
        assert not SETPOINTS & set(sent)
        robot.drive(0.1, 0.0, 0.0, 0.1)
        assert SETPOINTS & set(sent) == {"SET_POSITION_TARGET_LOCAL_NED"}


def test_the_refusal_names_limit_value_and_remedy() -> None:
    model = drive_model(read_robot("three_wheel"))
    with pytest.raises(LimitError, match=r"requested 1.5 m/s; its limit is 0.176 m/s: LIM_WHEEL is 3") as caught:
        check_velocity(model, Twist(1.5, 0.0, 0.0))
    assert "faster" in caught.value.hint
    with pytest.raises(LimitError) as caught:
        check_velocity(model, Twist(0.18, 0.0, 0.0))
    assert "omni params set LIM_WHEEL=3.1" in caught.value.hint


@pytest.mark.parametrize("heading", [0.0, 0.3, math.pi / 2, 2.0])
def test_in_the_worlds_frame_the_heading_decides(heading: float) -> None:
    model = drive_model(read_robot("three_wheel"))
    fast = Twist(0.175 * math.cos(heading), 0.175 * math.sin(heading), 0.0)  # forward, seen from the world
    check_velocity(model, fast, heading)
    check_velocity(model, fast, None)
    with pytest.raises(LimitError):
        check_velocity(model, fast, heading + math.pi / 2)
    with pytest.raises(LimitError):
        check_velocity(model, Twist(0.18, 0.0, 0.0), None)


def test_a_robot_that_turns_has_to_follow_in_every_heading_on_its_way() -> None:
    model = drive_model(read_robot("three_wheel"))
    sideways = Twist(0.0, -0.15, 0.1)  # forward a quarter turn later, where the wheels are faster
    check_velocity(model, sideways, 0.0)
    check_velocity(model, sideways, 0.0, turned_rad=0.05)
    with pytest.raises(LimitError, match="LIM_WHEEL"):
        check_velocity(model, sideways, 0.0, turned_rad=math.pi / 2)


def test_the_api_asks_for_every_heading_of_a_turning_drive(firmware: FirmwareProcess) -> None:
    with connect(firmware.urls[0]) as robot:
        robot.wait_for(Tracking)
        robot.require_velocity(0.0, -0.15, 0.1)
        robot.require_velocity(0.0, -0.15, 0.1, frame="world", duration_s=0.5)
        with pytest.raises(LimitError, match="LIM_WHEEL"):
            robot.require_velocity(0.0, -0.15, 0.1, frame="world", duration_s=16.0)
        with pytest.raises(LimitError, match="LIM_WHEEL"):
            robot.require_velocity(0.0, -0.15, 0.1, frame="world")


def test_a_pose_is_reached_within_the_time_that_was_told(sitl: str) -> None:
    """The first example of the command's own help, with the time that the command allows by itself."""
    result = omni("drive", "pose", "0.5", "0", "1.57", "--link", sitl, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["arrived"] is True


def test_a_pose_in_degrees_is_the_one_in_radians(sitl: str) -> None:
    result = omni("drive", "pose", "0", "0", "-20deg", "--link", sitl, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["pose"]["theta"] == pytest.approx(math.radians(-20.0), abs=0.03)


@pytest.mark.full
def test_what_the_robot_says_is_shown(url: str) -> None:
    result = omni("drive", "velocity", "0.01", "0", "0", "--duration", "0.1", "--link", url)
    assert "robot: armed" in result.stderr, result.stderr


def test_travel_time_grows_with_way_and_turn() -> None:
    model = drive_model(read_robot("three_wheel"))
    here = Pose(0.0, 0.0, 0.0)
    near, far, turned = (travel_time_s(model, here, p, 0.8) for p in (Pose(0.1, 0, 0), Pose(1, 0, 0), Pose(1, 0, 2)))
    assert near < far < turned
    assert far - near == pytest.approx(0.9 / (0.8 * 3.0 * 0.0508 / math.cos(math.radians(30.0))), rel=0.01)


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        ("w", ["w"]),
        ("\x1b[A\x1b[A", ["\x1b[A", "\x1b[A"]),
        ("\x1bOD ", ["\x1bOD", " "]),
        ("\x1b", ["\x1b"]),
        ("a\x1b[1;5Cx", ["a", "\x1b[1;5C", "x"]),
    ],
)
def test_an_escape_sequence_is_one_key(typed: str, keys: list[str]) -> None:
    assert split_keys(typed) == keys


@pytest.mark.parametrize(("arrow", "letter"), [("\x1b[A", "w"), ("\x1b[B", "s"), ("\x1b[D", "a"), ("\x1bOC", "d")])
def test_arrow_keys_drive_and_do_not_end(arrow: str, letter: str) -> None:
    arrows, letters = KeyDriver(0.1, 0.5), KeyDriver(0.1, 0.5)
    assert arrows.take(arrow, 1.0)
    assert letters.take(letter, 1.0)
    assert arrows.twist(1.1) == letters.twist(1.1) != Twist(0.0, 0.0, 0.0)


@pytest.mark.parametrize("key", ["\x1b", "x", "\x03", "\x04"])
def test_escape_alone_ends(key: str) -> None:
    assert not KeyDriver(0.1, 0.5).take(key, 1.0)


def test_any_other_key_stops() -> None:
    driver = KeyDriver(0.1, 0.5)
    for key in ("\x1b[5~", "k", "\x1b[H"):
        driver.take("w", 1.0)
        assert driver.take(key, 1.0)
        assert driver.twist(1.0) == Twist(0.0, 0.0, 0.0)


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals")
def test_an_arrow_key_comes_whole_from_a_terminal() -> None:
    ours, theirs = os.openpty()
    try:
        import tty

        tty.setcbreak(theirs)
        keys = _Keys(theirs)
        assert keys.next() == ""
        os.write(ours, b"\x1b[Aw")
        assert [keys.next(), keys.next(), keys.next()] == ["\x1b[A", "w", ""]
    finally:
        os.close(ours)
        os.close(theirs)
