# SPDX-License-Identifier: MIT
"""A path that was asked for while disarmed: only the arming of its own sender starts it, and not for ever."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    DISARM,
    EMERGENCY,
    ESTOP,
    FAILSAFE,
    HEARTBEAT,
    RADIO,
    RELEASE,
    TERMINATE,
    USB,
    FakeRobot,
    command,
    frame,
)

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
START_CIRCLE = (mav.MAV_CMD_OMNI_TRAJECTORY_START, 3.0, 1.0)
START = command(*START_CIRCLE)
STOP_PATH = command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP)
HOLD = command(mav.MAV_CMD_DO_SET_MODE, 1.0, 0.0)
OTHER = 254
OTHER_HEARTBEAT = frame("heartbeat", mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0, system=OTHER)
OTHER_ARM = command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, system=OTHER)
SILENCE_TICKS = 3200
"""More than SAFE_LINK_TO."""


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    made = FakeRobot().ready()
    yield made
    made.close()


def phase(robot: FakeRobot) -> int:
    return int(robot.asked("OMNI_TRACKING", RADIO + 1).phase)


def pass_time(robot: FakeRobot, ticks: int) -> None:
    """Let time pass and take what is said meanwhile: a full buffer would leave the last texts out."""
    for _ in range(ticks // 100):
        robot.tick(100)
        robot.look()


def arm(robot: FakeRobot, request: bytes = ARM, port: int = USB) -> None:
    robot.send(port, HEARTBEAT)
    assert robot.ask(port, request) == ACCEPTED, robot.texts(port)
    robot.tick(20)


def test_the_path_starts_with_the_arming_of_its_sender_as_long_as_its_heartbeats_come(robot: FakeRobot) -> None:
    assert robot.ask(USB, START) == ACCEPTED
    for _ in range(5):
        robot.send(USB, HEARTBEAT)
        robot.tick(1000)
    arm(robot)
    assert phase(robot) != 0


def test_a_sender_without_heartbeats_may_ask_and_then_arm(robot: FakeRobot) -> None:
    assert robot.ask(USB, command(*START_CIRCLE, system=1, component=191)) == ACCEPTED
    arm(robot, command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, system=1, component=191))
    assert phase(robot) != 0


def new_session(robot: FakeRobot) -> None:
    robot.port(USB, connection=2)
    robot.tick()


def silence(robot: FakeRobot) -> None:
    for port in (USB, RADIO):
        robot.send(port, OTHER_HEARTBEAT)  # another station is there all the time
    robot.tick(SILENCE_TICKS)


def button(robot: FakeRobot) -> None:
    robot.press()
    robot.tick(3)
    robot.press(False)
    robot.tick(3)
    release(robot)


def release(robot: FakeRobot) -> None:
    assert robot.state(RADIO + 1) == ESTOP
    assert robot.ask(RADIO, RELEASE) == ACCEPTED
    robot.tick(5)


def stop(request: bytes, *, released: bool = False) -> Callable[[FakeRobot], None]:
    """Return what lets another station stop the robot."""

    def send(robot: FakeRobot) -> None:
        assert robot.ask(RADIO, request) == ACCEPTED
        robot.tick(5)
        if released:
            release(robot)

    return send


def other_arms(robot: FakeRobot) -> None:
    arm(robot, OTHER_ARM)
    assert phase(robot) == 0
    assert robot.ask(USB, DISARM) == ACCEPTED
    robot.tick(5)


ENDS: dict[str, Callable[[FakeRobot], None]] = {
    "a new session of its link": new_session,
    "its station's silence": silence,
    "the stop button": button,
    "an emergency stop": stop(EMERGENCY, released=True),
    "a termination": stop(TERMINATE, released=True),
    "a disarm command": stop(DISARM),
    "a stop of the path": stop(STOP_PATH),
    "hold": stop(HOLD),
    "the arming of another station": other_arms,
}


@pytest.mark.parametrize("end", ENDS)
def test_what_ends_a_path_that_waits(robot: FakeRobot, end: str) -> None:
    assert robot.ask(USB, START) == ACCEPTED
    ENDS[end](robot)
    arm(robot)
    assert phase(robot) == 0
    assert robot.ask(USB, START) == ACCEPTED, "a new one starts"
    robot.tick(5)
    assert phase(robot) != 0


def test_a_station_that_was_silent_is_told_that_its_path_will_not_start(robot: FakeRobot) -> None:
    assert robot.ask(USB, START) == ACCEPTED
    pass_time(robot, SILENCE_TICKS)
    assert any(text.startswith("path not started") for text in robot.texts(USB))
    assert not any(text.startswith("path not started") for text in robot.texts(RADIO))


def test_a_stopped_robot_takes_no_path_for_later(robot: FakeRobot) -> None:
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    assert robot.ask(USB, START) == DENIED, "the stop has not been done yet"
    robot.tick(5)
    assert robot.ask(USB, START) == DENIED
    assert robot.ask(USB, RELEASE) == ACCEPTED
    assert robot.ask(USB, START) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    robot.tick(5)
    arm(robot)
    assert phase(robot) == 0


def test_a_robot_in_failsafe_takes_no_path_for_later(robot: FakeRobot) -> None:
    arm(robot)
    pass_time(robot, SILENCE_TICKS)
    assert robot.state() == FAILSAFE
    assert robot.ask(USB, START) == DENIED
    assert robot.ask(USB, DISARM) == ACCEPTED
    assert robot.ask(USB, START) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    robot.send(USB, HEARTBEAT)
    robot.tick(5)
    arm(robot)
    assert phase(robot) == 0
