# SPDX-License-Identifier: MIT
"""A robot that gets another SYS_ID: whoever gave it goes on talking to it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni.hub.followed import FollowedRobot
from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.errors import ParameterRangeError, ParameterRefusedError
from omniwheel.robot import Robot, connect
from tests.host.conftest import FakeRobot
from tests.host.shared_line import shared_line
from tests.host.two_robots import FIRST, SECOND, TwoRobots

GIVEN = {"SYS_ID": 2.0, "MOT_R": 2.75}
REBOOT = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN


@pytest.fixture
def storage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OMNI_STATE_DIR", str(tmp_path / "state"))
    return tmp_path / "robot.bin"


@pytest.fixture
def url(storage: Path) -> Iterator[str]:
    with FirmwareProcess("three_wheel", storage=storage) as firmware:
        yield firmware.urls[0]


def omni(*words: str) -> Any:
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def values(robot: Robot) -> dict[str, float]:
    return {name: robot.parameters.read(name) for name in GIVEN}


@pytest.mark.full
def test_the_rest_of_a_line_is_set_and_stored(url: str) -> None:
    assert set(omni("params", "set", "SYS_ID=2", "MOT_R=2.75", "--store", "--link", url)) == set(GIVEN)
    with connect(url, system_id=2) as robot:
        robot.restore()
        assert values(robot) == pytest.approx(GIVEN)


@pytest.mark.full
def test_a_number_that_was_set_is_taken_back(url: str) -> None:
    with connect(url) as robot:
        old = values(robot)
    assert set(omni("params", "set", "SYS_ID=2", "MOT_R=2.75", "--link", url)) == set(GIVEN)
    assert set(omni("params", "undo", "--link", url)) == set(GIVEN)
    with connect(url) as robot:
        assert values(robot) == old


@pytest.mark.full
def test_another_robots_file_is_loaded_without_its_number(url: str, tmp_path: Path) -> None:
    file = tmp_path / "other.toml"
    file.write_text("[parameters]\nSYS_ID = 2\nMOT_R = 2.75\n", encoding="utf-8")
    assert set(omni("params", "load", str(file), "--link", url)) == {"MOT_R"}
    said = CliRunner().invoke(app, ["params", "load", str(file), "--link", url]).output
    assert "SYS_ID=2" in said, "how it gets the number"
    with connect(url) as robot:
        assert values(robot) == pytest.approx({"SYS_ID": 1.0, "MOT_R": 2.75})


@pytest.mark.full
@pytest.mark.parametrize("replace", [Robot.reset_parameters, Robot.restore])
def test_a_robot_keeps_its_number_when_its_values_are_replaced(url: str, replace: Any) -> None:
    with connect(url) as robot:
        old = values(robot)
        robot.parameters.set_many(GIVEN)
        assert values(robot) == pytest.approx(GIVEN)
        replace(robot)
        assert values(robot) == {**old, "SYS_ID": GIVEN["SYS_ID"]}


@pytest.mark.full
def test_a_reset_leaves_two_robots_on_a_line_two() -> None:
    with shared_line([1, 2]) as line:
        assert "SYS_ID" not in omni("params", "reset", "--system", "2", "--link", line.url)
        with connect(line.url, system_id=1) as robot:
            robot.pump(1.5)
            assert robot.connection.other_systems == {2}


@pytest.mark.full
def test_the_number_of_a_robot_that_was_not_heard_yet_is_refused() -> None:
    with shared_line([1, 2]) as line:
        result = CliRunner().invoke(app, ["params", "reset", "SYS_ID", "--system", "2", "--link", line.url])
        assert result.exit_code == 2, result.output
        with connect(line.url, system_id=2) as robot:
            assert robot.parameters.read("SYS_ID") == 2


@pytest.mark.full
def test_a_refused_set_brings_the_number_back(url: str) -> None:
    with connect(url) as robot:
        old, first = values(robot), robot.parameters["W1_ANGLE"]
        with pytest.raises(ParameterRefusedError):
            robot.parameters.set_many({"SYS_ID": 2.0, "W2_ANGLE": first, "W3_ANGLE": first})
        assert values(robot) == old


def test_the_number_of_another_robot_on_the_line_is_refused_before_anything_is_sent() -> None:
    line = TwoRobots()
    with connect(line, clock=line.clock, system_id=FIRST) as robot:
        robot.pump(2.0)
        with pytest.raises(ParameterRangeError):
            robot.parameters.set_many({"WS_P": 4.5, "SYS_ID": SECOND})
    assert not [m for one in line.robots.values() for m in one.received if m.get_type() == "PARAM_SET"]


# ---- the hub's side

ROBOT, NEW, OTHER = (1, 1), (2, 1), (3, 1)


def request(command: int) -> Any:
    return mavlink.MAVLink_command_long_message(1, 1, command, 0, *[0.0] * 7)


def test_a_hub_does_not_take_another_robot_for_one_that_restarts() -> None:
    followed = FollowedRobot()
    assert followed.accept_heartbeat(ROBOT, 0.0)
    assert not followed.accept_heartbeat(OTHER, 0.5)
    followed.watch_request(request(REBOOT), 1.0)
    assert not followed.accept_heartbeat(NEW, 1.1), "the robot may still be heard under its old number"
    assert not followed.accept_heartbeat(OTHER, 3.0), "another robot was there before"


def test_a_hub_takes_a_new_number_once_the_old_one_is_silent() -> None:
    followed = FollowedRobot()
    assert followed.accept_heartbeat(ROBOT, 0.0)
    followed.watch_request(request(REBOOT), 0.5)
    assert followed.accept_heartbeat(NEW, 2.0)
    assert followed.source == NEW


@pytest.mark.parametrize("command", [None, mavlink.MAV_CMD_PREFLIGHT_STORAGE])
def test_a_hub_follows_nobody_without_a_reason(command: int | None) -> None:
    """A robot keeps its number when its values are replaced."""
    followed = FollowedRobot()
    assert followed.accept_heartbeat(ROBOT, 0.0)
    if command is not None:
        followed.watch_request(request(command), 0.5)
    assert not followed.accept_heartbeat(NEW, 5.0)


# ---- another program's side


def tell_new_number(fake: FakeRobot, system: int) -> None:
    """Have the robot tell its new number to all links, as it does when a program sets SYS_ID."""
    fake._codec.srcSystem = system
    fake.values["SYS_ID"] = float(system)
    fake._send_value("SYS_ID")


def test_a_stop_reaches_a_robot_that_another_program_renamed(fake: FakeRobot, robot: Robot) -> None:
    tell_new_number(fake, 9)
    robot.pump(1.5)
    robot.estop()
    assert robot.connection.target_system == 9
    assert not robot.connection.other_systems
    assert [m.target_system for m in fake.received if m.get_type() == "COMMAND_LONG"][-1] == 9


def test_another_robot_that_tells_its_number_is_not_taken_for_this_one() -> None:
    line = TwoRobots()
    with connect(line, clock=line.clock, system_id=FIRST) as robot:
        robot.pump(2.0)
        line.robots[SECOND].values["SYS_ID"] = float(SECOND)
        line.robots[SECOND]._send_value("SYS_ID")
        robot.pump(10.0)
        assert robot.connection.target_system == FIRST


def test_a_hub_does_not_take_a_robot_whose_number_is_asked_for_for_its_own() -> None:
    followed = FollowedRobot()
    assert followed.accept_heartbeat(ROBOT, 0.0)
    assert not followed.accept_heartbeat(OTHER, 0.5)
    asked = mavlink.MAVLink_param_set_message(1, 1, b"SYS_ID", float(OTHER[0]), mavlink.MAV_PARAM_TYPE_REAL32)
    asked.param_id = "SYS_ID"  # as a parser gives it
    followed.watch_request(asked, 1.0)
    assert not followed.accept_heartbeat(OTHER, 1.1), "the answer is still on its way"
    assert followed.accept_heartbeat(OTHER, 4.0), "its own robot has that number now, and is silent under the old one"
