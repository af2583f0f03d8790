# SPDX-License-Identifier: MIT
"""Modes as MAVSDK asks for them: it takes every robot that is not ArduPilot for PX4."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import ARM, HEARTBEAT, RADIO, USB, FakeRobot, command, frame, velocity

ACCEPTED, DENIED, LATER = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED, mav.MAV_RESULT_TEMPORARILY_REJECTED
CUSTOM = float(mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
MANUAL, POSITION, AUTO, OFFBOARD = 1, 3, 4, 6
LOITER, MISSION = 3, 4
STICKS = frame("manual_control", 1, 50, 0, 0, 0, 0)


def mode(main: float, sub: float = 0.0) -> bytes:
    return command(mav.MAV_CMD_DO_SET_MODE, CUSTOM, main, sub)


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    robot = FakeRobot()
    yield robot
    robot.close()


def stream(robot: FakeRobot, request: bytes, seconds: float) -> None:
    for _ in range(round(seconds * 20)):
        robot.send(USB, HEARTBEAT, request)
        robot.tick(50)


def px4_mode(robot: FakeRobot) -> tuple[int, int]:
    """Return main mode and sub mode, as MAVSDK reads them."""
    beat = robot.asked("HEARTBEAT")
    assert beat.autopilot == mav.MAV_AUTOPILOT_GENERIC, "it must not claim to be PX4"
    assert beat.base_mode & mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return beat.custom_mode >> 16 & 0xFF, beat.custom_mode >> 24


def wheels_turn(robot: FakeRobot) -> bool:
    return bool(max(map(abs, robot.asked("OMNI_WHEELS").reference)) > 0.05)


@pytest.mark.parametrize(("main", "request_"), [(OFFBOARD, velocity(0.05)), (POSITION, STICKS)])
def test_offboard_is_accepted_once_set_points_stream_and_shown_before_arming(
    robot: FakeRobot, main: int, request_: bytes
) -> None:
    robot.ready()
    assert px4_mode(robot) == (AUTO, LOITER)
    stream(robot, request_, 0.2)
    assert robot.ask(USB, mode(main)) == ACCEPTED
    assert px4_mode(robot) == (OFFBOARD, 0)
    assert robot.ask(USB, ARM) == ACCEPTED
    stream(robot, request_, 0.5)
    assert px4_mode(robot) == (OFFBOARD, 0)
    assert wheels_turn(robot)
    assert robot.ask(USB, mode(AUTO, LOITER)) == ACCEPTED
    robot.send(USB, HEARTBEAT)
    robot.tick(500)
    assert px4_mode(robot) == (AUTO, LOITER)
    assert not wheels_turn(robot)
    assert robot.asked("OMNI_STATUS").state == 2, "a hold stays armed"


def test_the_first_set_point_may_come_before_the_first_heartbeat(robot: FakeRobot) -> None:
    robot.tick(200)
    robot.send(USB, velocity(0.0))
    robot.tick(20)
    assert robot.ask(USB, mode(OFFBOARD)) == ACCEPTED


@pytest.mark.parametrize("main", [OFFBOARD, POSITION])
def test_offboard_needs_set_points_of_the_station_that_asks(robot: FakeRobot, main: int) -> None:
    robot.armed()
    assert robot.ask(USB, mode(main)) == LATER
    robot.send(RADIO, velocity(0.05))
    robot.tick(20)
    assert robot.ask(USB, mode(main)) == LATER
    robot.send(USB, velocity(math.nan))
    robot.tick(20)
    assert robot.ask(USB, mode(main)) == LATER


def test_offboard_needs_fresh_set_points(robot: FakeRobot) -> None:
    robot.ready()
    stream(robot, velocity(0.05), 0.2)
    robot.send(USB, HEARTBEAT)
    robot.tick(600)
    assert robot.ask(USB, mode(OFFBOARD)) == LATER
    assert px4_mode(robot) == (AUTO, LOITER)


OTHERS = [
    (MANUAL, 0), (2, 0), (POSITION, 0), (AUTO, 0), (AUTO, MISSION), (5, 0), (7, 0), (3.5, 0), (6, 0.5), (-1, 0),
    (math.nan, 0), (math.inf, 0), (AUTO, math.nan), (AUTO, math.inf), (AUTO, 259), (1e30, 0), (0x04040003, 0),
]  # fmt: skip


@pytest.mark.parametrize(("main", "sub"), OTHERS)
@pytest.mark.parametrize("armed", [False, True])
def test_no_other_mode_moves_the_robot(robot: FakeRobot, main: float, sub: float, armed: bool) -> None:
    robot.ready()
    if armed:
        assert robot.ask(USB, ARM) == ACCEPTED
        robot.tick(5)
    assert robot.ask(USB, mode(main, sub)) in (DENIED, LATER)
    if not armed:
        assert robot.ask(USB, ARM) == ACCEPTED
    for _ in range(10):
        robot.send(USB, HEARTBEAT)
        robot.tick(50)
        assert not wheels_turn(robot)


@pytest.mark.parametrize("custom_mode", [0, 0x03040000])
def test_set_mode_holds_by_what_the_heartbeat_says(robot: FakeRobot, custom_mode: int) -> None:
    robot.armed()
    stream(robot, velocity(0.05), 0.5)
    assert wheels_turn(robot)
    robot.send(USB, frame("set_mode", 1, int(CUSTOM), custom_mode))
    robot.tick(500)
    assert px4_mode(robot) == (AUTO, LOITER)
    assert not wheels_turn(robot)


HEADING = 0b1001_1100_0111
"""Velocity and yaw count, position and yaw rate do not."""


def velocity_with_heading(yaw: float) -> bytes:
    return frame("set_position_target_local_ned", 0, 1, 1, 1, HEADING, 0, 0, 0, 0, 0, 0, 0, 0, 0, yaw, 0)


@pytest.mark.parametrize("yaw", [0.5, -0.5])
@pytest.mark.parametrize("interval_ms", [50, 400])
def test_a_velocity_with_a_heading_turns_to_it_and_not_beyond(robot: FakeRobot, yaw: float, interval_ms: int) -> None:
    """`set_velocity_ned` of MAVSDK, often and seldom."""
    robot.armed()
    turned = []
    for _ in range(4000 // interval_ms):
        robot.send(USB, HEARTBEAT, velocity_with_heading(yaw))
        robot.tick(interval_ms)
        turned.append(robot.asked("OMNI_TRACKING").pose[2] / -yaw)  # positive yaw is to the right
    assert turned[-1] == pytest.approx(1.0, abs=0.05)
    assert max(turned) < 1.05


def test_a_heading_that_is_no_number_is_refused(robot: FakeRobot) -> None:
    robot.armed()
    stream(robot, velocity_with_heading(math.nan), 0.3)
    assert any("setpoint refused" in text for text in robot.texts())
    assert not wheels_turn(robot)
