# SPDX-License-Identifier: MIT
"""Only the robot's own component speaks for the robot: cameras, computers and other robots share its line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from omni.studio.log_frames import Clock, read_piece
from omniwheel.dialect import HUB_COMPONENT, mavlink
from omniwheel.errors import ArmingRefusedError, LinkTimeoutError, ParameterRefusedError
from omniwheel.robot import Robot, connect
from omniwheel.telemetry import Heartbeat, Tracking
from omniwheel.telemetry_record import record_of
from omniwheel.timesync import TimeSync

ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
ONBOARD_COMPUTER, CAMERA = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER, mavlink.MAV_COMP_ID_CAMERA
OTHERS = [(7, ONBOARD_COMPUTER), (7, CAMERA), (7, HUB_COMPONENT), (8, 1)]


def heartbeat(mode: int, number: int) -> Any:
    rover, generic = mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_GENERIC
    return mavlink.MAVLink_heartbeat_message(rover, generic, mode, number, 3, 3)


def companion(number: int) -> Any:
    kind, none = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
    return mavlink.MAVLink_heartbeat_message(kind, none, 0, number, 3, 3)


def value(name: str, number: float, index: int = 65535) -> Any:
    return mavlink.MAVLink_param_value_message(name.encode(), number, mavlink.MAV_PARAM_TYPE_REAL32, 500, index)


def packed(message: Any, source: tuple[int, int]) -> bytes:
    return bytes(message.pack(mavlink.MAVLink(None, *source)))


class Line:
    """A fake robot, and others who speak on its line: ``say`` puts frames into what the host reads next."""

    def __init__(self, fake: Any) -> None:
        self.fake = fake

    def say(self, source: tuple[int, int], *messages: Any) -> None:
        self.fake.garbage += b"".join(packed(message, source) for message in messages)

    def heard(self, robot: Robot) -> None:
        robot.pump(0.05)
        self.fake.garbage = b""


@pytest.fixture
def line(fake: Any, robot: Robot) -> Line:
    robot.pump(0.05)
    return Line(fake)


@pytest.mark.parametrize("source", OTHERS)
def test_others_do_not_say_what_the_robot_does(line: Line, robot: Robot, source: tuple[int, int]) -> None:
    line.fake.send(heartbeat(ARMED, 2))
    line.fake.send(mavlink.MAVLink_omni_tracking_message(1, [0] * 3, [0] * 3, [1.0, 2.0, 0.5], [0.1] * 3, 3.0, 2))
    robot.pump(0.05)
    before = robot.status
    assert before.armed
    line.say(source, companion(7), heartbeat(0, 0), value("WS_P", 99.0))
    line.say(source, mavlink.MAVLink_omni_tracking_message(1, [0] * 3, [0] * 3, [9.0] * 3, [0.1] * 3, 3.0, 2))
    line.heard(robot)
    assert (robot.status.heartbeat, robot.status.tracking) == (before.heartbeat, before.tracking)
    assert "WS_P" not in robot.parameters.known


@pytest.mark.parametrize("source", OTHERS)
def test_telemetry_of_others_is_not_given_out(line: Line, robot: Robot, source: tuple[int, int]) -> None:
    line.fake._next_heartbeat_s = float("inf")
    line.say(source, companion(7), heartbeat(0, 7))
    with pytest.raises(LinkTimeoutError):
        next(robot.telemetry(Heartbeat, Tracking, timeout_s=0.5))


@pytest.mark.parametrize("source", OTHERS)
def test_others_do_not_answer_a_command(line: Line, robot: Robot, source: tuple[int, int]) -> None:
    line.fake.command_results[ARM] = DENIED
    line.say(source, mavlink.MAVLink_command_ack_message(ARM, ACCEPTED))
    with pytest.raises(ArmingRefusedError):
        robot.arm()


@pytest.mark.parametrize("source", OTHERS)
def test_others_do_not_confirm_a_parameter(line: Line, robot: Robot, source: tuple[int, int]) -> None:
    line.fake.refusals["WS_P"] = "WS_P refused: because"
    wanted = line.fake.values["WS_P"] * 2.0
    line.say(source, value("WS_P", wanted))
    with pytest.raises(ParameterRefusedError):
        robot.parameters["WS_P"] = wanted


@pytest.mark.parametrize("source", OTHERS)
def test_others_do_not_set_the_clock(line: Line, robot: Robot, source: tuple[int, int]) -> None:
    sync = TimeSync(robot.connection)
    sync.serve()
    (asked,) = [message for message in line.fake.received if message.get_type() == "TIMESYNC"][-1:]
    line.say(source, mavlink.MAVLink_timesync_message(123, asked.ts1))
    line.heard(robot)
    assert not sync.synchronised


@pytest.mark.parametrize("source", [*OTHERS[:2], OTHERS[3]])
def test_texts_are_the_robots_and_those_of_its_hub(line: Line, robot: Robot, source: tuple[int, int]) -> None:
    line.say(source, mavlink.MAVLink_statustext_message(3, b"camera: no card"))
    line.say((7, HUB_COMPONENT), mavlink.MAVLink_statustext_message(4, b"hub: no client in command"))
    line.say((7, 1), mavlink.MAVLink_statustext_message(4, b"armed"))
    line.heard(robot)
    assert {text.text for text in robot.texts.all} == {"hub: no client in command", "armed"}


@pytest.mark.parametrize("source", OTHERS)
def test_what_others_say_before_the_robot_is_heard_is_not_the_robots(fake: Any, source: tuple[int, int]) -> None:
    fake._next_heartbeat_s = 0.2
    # Of the other robot no heartbeat: it would be one to connect to.
    early = [companion(7), value("WS_P", 99.0), mavlink.MAVLink_omni_tracking_message(1, *[[9.0] * 3] * 4, 3.0, 2)]
    fake.garbage = b"".join(packed(message, source) for message in early)
    with connect(fake, clock=fake.clock) as robot:
        assert robot.status.heartbeat is not None
        assert robot.status.heartbeat.mode != "7"
        assert robot.status.tracking is None
        assert "WS_P" not in robot.parameters.known


# ---- recordings


def recorded(*said: tuple[tuple[int, int], Any]) -> list[Any]:
    parser = mavlink.MAVLink(None)
    return [message for source, one in said for message in parser.parse_buffer(packed(one, source)) or ()]


def tracking(ms: int, x: float) -> Any:
    return mavlink.MAVLink_omni_tracking_message(ms, [0] * 3, [0] * 3, [x, 0.0, 0.0], [0.1] * 3, 3.0, 2)


def drive_among(source: tuple[int, int]) -> list[tuple[tuple[int, int], Any]]:
    """A robot moves 1 mm each 20 ms; another one tells of other places, modes and texts between."""
    said: list[tuple[tuple[int, int], Any]] = [((1, 1), heartbeat(ARMED, 2))]
    for step in range(50):
        said.append(((1, 1), tracking(1000 + 20 * step, 0.001 * step)))
        said.append((source, tracking(1010 + 20 * step, 5.0)))
        if step % 10 == 0:
            said += [((1, 1), heartbeat(ARMED, 2)), (source, heartbeat(0, 1)), (source, companion(7))]
            said.append((source, mavlink.MAVLink_statustext_message(4, b"of another")))
    return said


@pytest.mark.parametrize("source", [(1, ONBOARD_COMPUTER), (1, HUB_COMPONENT), (2, 1)])
def test_a_recording_is_of_one_robot(source: tuple[int, int]) -> None:
    record = record_of(recorded(*drive_among(source)))
    assert record.numbers()["way_m"] == pytest.approx(0.049)
    assert record.events == ()


@pytest.mark.parametrize("source", [(1, ONBOARD_COMPUTER), (1, HUB_COMPONENT), (2, 1)])
def test_the_studio_shows_a_recording_of_one_robot(tmp_path: Path, source: tuple[int, int]) -> None:
    frames = [packed(message, who) for who, message in drive_among(source)]
    halves = frames[:60], frames[60:]
    clock = Clock()
    for half in halves:  # a long log is read piece by piece
        piece = read_piece(b"".join(bytes(8) + frame for frame in half), clock)
        (rows,) = (rows for kind, (_, rows) in piece.rows.items() if kind is Tracking)
        assert rows.max() < 4.0, "the other's place is 5 m away"
        assert {message.get_srcSystem() for _, message in piece.said} <= {1}
        assert all(message.get_type() != "STATUSTEXT" for _, message in piece.said)
