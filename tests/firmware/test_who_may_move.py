# SPDX-License-Identifier: MIT
"""One station has the command. Who else may move the robot, and who is told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.firmware.client import GCS, mav
from tests.firmware.fake_robot import DISARM, HEARTBEAT, RADIO, STATION, USB, FakeRobot, command, frame

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
COMPANION = (1, 191)
"""A companion computer without heartbeats of a ground station."""
OTHER = (254, 190)
MASK_VELOCITY = 0b0101_1100_0111
MASK_POSE = 0b1001_1111_1000
SETPOINTS: dict[str, tuple[Any, ...]] = {
    "velocity": ("set_position_target_local_ned", 0, 1, 1, 12, MASK_VELOCITY, *[0] * 3, 0.1, *[0] * 7),
    "pose": ("set_position_target_local_ned", 0, 1, 1, 1, MASK_POSE, 0.3, *[0] * 10),
    "duty": ("omni_setpoint_duty", 1, 1, [0.2] * 4),
    "sticks": ("manual_control", 1, 300, 0, 0, 0, 0),
}
COMMANDS: dict[str, tuple[Any, ...]] = {
    "path": (mav.MAV_CMD_OMNI_TRAJECTORY_START, 3.0, 1.0),
    "excitation": (mav.MAV_CMD_OMNI_EXCITE, 3.0, 0.0, 0.02, 5.0),
    "arm": (mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0),
    "offboard": (mav.MAV_CMD_DO_SET_MODE, 1.0, 6.0),
}
STILL_M = 1e-3
Address = tuple[int, int]


def beat(kind: int, sender: Address) -> bytes:
    fields = (kind, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)
    return frame("heartbeat", *fields, system=sender[0], component=sender[1])


def set_point(kind: str, sender: Address) -> bytes:
    message, *fields = SETPOINTS[kind]
    return frame(message, *fields, system=sender[0], component=sender[1])


def motion(kind: str, sender: Address = (GCS, STATION)) -> bytes:
    number, *parameters = COMMANDS[kind]
    return command(number, *parameters, system=sender[0], component=sender[1])


ONBOARD_HEARTBEAT = beat(mav.MAV_TYPE_ONBOARD_CONTROLLER, COMPANION)
OTHER_HEARTBEAT = beat(mav.MAV_TYPE_GCS, OTHER)


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    """Armed by the station on USB, which holds it."""
    made = FakeRobot().armed(USB)
    yield made
    made.close()


def run(robot: FakeRobot, ticks: int, *frames: bytes, port: int = RADIO) -> list[str]:
    """Let time pass while the station on USB is there and another sender repeats something; return texts on USB."""
    robot.look()
    robot.said[USB].clear()
    for tick in range(ticks):
        if tick % 200 == 0:
            robot.send(USB, HEARTBEAT)
        if tick % 50 == 0:
            robot.send(port, *frames)
            robot.look()
        robot.tick()
    return robot.texts(USB)


def moved(robot: FakeRobot) -> bool:
    """Return whether the robot has left its place."""
    at = robot.asked("LOCAL_POSITION_NED", RADIO + 1)
    return bool(max(abs(at.x), abs(at.y)) > STILL_M)


@pytest.mark.parametrize("port", [USB, RADIO])
@pytest.mark.parametrize("name", SETPOINTS)
def test_set_points_of_a_sender_that_cannot_take_the_command_move_nothing(
    robot: FakeRobot, name: str, port: int
) -> None:
    asked = set_point(name, COMPANION)
    texts = run(robot, 1000, ONBOARD_HEARTBEAT, asked, port=port)
    assert not moved(robot)
    assert "not followed: station 1/191 on link " + str(port + 1) in texts
    assert "refused: station 255/190 on link 1 commands" in robot.texts(port)


def test_both_are_told_now_and_then_only(robot: FakeRobot) -> None:
    texts = run(robot, 4000, set_point("velocity", COMPANION))
    assert sum(text.startswith("not followed") for text in texts) == 1
    assert 1 <= sum(text.startswith("refused") for text in robot.texts(RADIO)) <= 5


@pytest.mark.parametrize("name", COMMANDS)
def test_motion_commands_of_a_sender_that_cannot_take_the_command_are_denied(robot: FakeRobot, name: str) -> None:
    run(robot, 50, set_point("velocity", COMPANION))
    assert robot.ask(RADIO, motion(name, COMPANION)) == DENIED
    run(robot, 1000)
    assert not moved(robot)
    assert any(text.startswith("refused: station 255/190") for text in robot.texts(RADIO))


def test_the_drive_of_the_station_in_command_goes_on(robot: FakeRobot) -> None:
    assert robot.ask(USB, motion("path")) == ACCEPTED
    run(robot, 500, set_point("velocity", COMPANION))
    assert (
        robot.ask(
            RADIO, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 2.0, 1.0, system=COMPANION[0], component=COMPANION[1])
        )
        == DENIED
    )
    run(robot, 100)
    assert robot.asked("OMNI_TRACKING", RADIO + 1).phase in (1, 2)


@pytest.mark.parametrize("name", [name for name in SETPOINTS if name != "duty"])
def test_a_companion_computer_that_armed_the_robot_drives_it(name: str) -> None:
    robot = FakeRobot().ready()
    assert robot.ask(RADIO, motion("arm", COMPANION)) == ACCEPTED
    robot.tick(5)
    run(robot, 1000, set_point(name, COMPANION))
    assert moved(robot)
    for kind in ("path", "arm", "offboard"):
        assert robot.ask(RADIO, motion(kind, COMPANION)) == ACCEPTED
    robot.close()


def test_a_companion_computer_with_heartbeats_of_a_station_takes_the_command(robot: FakeRobot) -> None:
    gcs = beat(mav.MAV_TYPE_GCS, COMPANION)
    texts = run(robot, 1000, gcs, set_point("velocity", COMPANION))
    assert moved(robot)
    assert "taken over by station 1/191 on link 2" in texts


@pytest.mark.parametrize("name", COMMANDS)
def test_a_station_whose_drive_is_taken_over_is_told_who_did_it(robot: FakeRobot, name: str) -> None:
    before = run(robot, 300, OTHER_HEARTBEAT)
    assert not any(text.startswith("taken over") for text in before)
    if name == "offboard":
        robot.send(RADIO, set_point("velocity", OTHER))
    assert robot.ask(RADIO, motion(name, OTHER)) == ACCEPTED
    robot.tick(5)
    assert robot.texts(USB).count("taken over by station 254/190 on link 2") == 1


def test_ones_own_commands_take_nothing_over(robot: FakeRobot) -> None:
    for name in ("arm", "path"):
        assert robot.ask(USB, motion(name)) == ACCEPTED
        assert not any(text.startswith("taken over") for text in run(robot, 50))


def test_the_moment_of_arming_belongs_to_its_sender() -> None:
    """No report says yet that the robot is armed."""
    robot = FakeRobot().ready()
    assert robot.ask(USB, motion("arm")) == ACCEPTED
    assert robot.ask(RADIO, motion("arm", COMPANION)) == DENIED
    robot.send(RADIO, OTHER_HEARTBEAT)
    assert robot.ask(RADIO, motion("arm", OTHER)) == ACCEPTED
    assert "taken over by station 254/190 on link 2" in robot.texts(USB)
    robot.close()


def test_anybody_may_stop_or_hold_it(robot: FakeRobot) -> None:
    assert robot.ask(USB, motion("path")) == ACCEPTED
    run(robot, 100)
    assert (
        robot.ask(RADIO, command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP, system=COMPANION[0], component=COMPANION[1]))
        == ACCEPTED
    )
    robot.tick(5)
    assert robot.asked("OMNI_TRACKING", RADIO + 1).phase == 0
    assert (
        robot.ask(RADIO, command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, system=COMPANION[0], component=COMPANION[1]))
        == ACCEPTED
    )
    robot.tick(5)
    assert not robot.driven()
    assert robot.ask(USB, DISARM) == ACCEPTED
