# SPDX-License-Identifier: MIT
"""Stops have a path of their own: whatever came before them in the same tick, they are accepted and act in the next."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.firmware.client import Client, mav
from tests.firmware.test_commands import ARM, DISARMED, ESTOP, send_velocity

STOP = mav.MAV_CMD_OMNI_ESTOP
QUEUE = 32
"""Requests that once waited together with the stops."""
STOPS = {"estop": (STOP, 1.0, ESTOP), "terminate": (185, 1.0, ESTOP), "disarm": (ARM, 0.0, DISARMED)}


def fixes(robot: Client, count: int) -> None:
    """Send poses that differ a little, as a motion capture's backlog does."""
    for number in range(count):
        robot.mav.vicon_position_estimate_send(robot.time_us, 1e-6 * (number + 1), 0, 0, 0, 0, 0)


def setpoints(robot: Client, count: int) -> None:
    for number in range(count):
        send_velocity(robot, 0.05, 0.001 * (number % 8), 0.0)


def heartbeats(robot: Client, count: int) -> None:
    for _ in range(count):
        robot.heartbeat()


def trajectory_stops(robot: Client, count: int) -> None:
    for _ in range(count):
        robot.mav.command_long_send(1, 1, mav.MAV_CMD_OMNI_TRAJECTORY_STOP, 0, *[0.0] * 7)


def releases(robot: Client, count: int) -> None:
    """Not accepted while armed, so these come from a robot that is not."""
    for _ in range(count):
        robot.mav.command_long_send(1, 1, STOP, 0, *[0.0] * 7)


def poses(robot: Client, count: int) -> None:
    for number in range(count):
        robot.mav.command_long_send(1, 1, mav.MAV_CMD_OMNI_SET_POSE, 0, 0.001 * number, 0, 0, 0, 0, 0, 0)


def mixture(robot: Client, count: int) -> None:
    for number in range(count):
        (fixes, setpoints, heartbeats, trajectory_stops)[number % 4](robot, 1)


FLOODS: dict[str, Callable[[Client, int], None]] = {
    flood.__name__: flood for flood in (fixes, setpoints, heartbeats, trajectory_stops, mixture)
}


def driving(robot: Client) -> Client:
    robot.armed()
    send_velocity(robot, 0.1, 0.0, 0.0)
    robot.ticks(5)
    return robot


@pytest.mark.parametrize("count", [1, 2, QUEUE - 1, QUEUE, 3 * QUEUE])
@pytest.mark.parametrize("flood", FLOODS)
@pytest.mark.parametrize("stop", STOPS)
def test_a_stop_waits_for_nothing_and_is_never_refused(robot: Client, stop: str, flood: str, count: int) -> None:
    command, parameter, state = STOPS[stop]
    driving(robot)
    FLOODS[flood](robot, count)
    assert robot.command(command, parameter) == mav.MAV_RESULT_ACCEPTED
    tick = robot.tick()
    assert (tick.actuators.state, tick.actuators.output_enable) == (state, 0)
    assert {tick.actuators.state for tick in robot.ticks(2 * QUEUE)} == {state}, "what waited starts nothing"


@pytest.mark.parametrize("flood", [poses, releases, fixes])
def test_an_emergency_stop_of_a_resting_robot_waits_for_nothing(
    robot: Client, flood: Callable[[Client, int], None]
) -> None:
    robot.heartbeat()
    robot.ticks(20)
    flood(robot, 2 * QUEUE)
    assert robot.command(STOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert {tick.actuators.state for tick in robot.ticks(2 * QUEUE)} == {ESTOP}


def test_the_pin_is_tested_behind_a_backlog_of_fixes(robot: Client) -> None:
    robot.armed()
    robot.mav.omni_setpoint_duty_send(1, 1, [0.1] * 4)
    robot.ticks(3)
    fixes(robot, 3 * QUEUE)
    assert robot.command(mav.MAV_CMD_OMNI_OE_TEST, 0.5, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.output_enable == 0


def test_holding_the_pose_is_never_refused(robot: Client) -> None:
    driving(robot)
    setpoints(robot, 2 * QUEUE)
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP) == mav.MAV_RESULT_ACCEPTED
    robot.ticks(400)
    assert max(abs(speed) for speed in robot.tick().actuators.wheel_reference) < 0.05


def test_the_newest_of_many_set_points_counts(robot: Client) -> None:
    driving(robot)
    setpoints(robot, 2 * QUEUE)
    send_velocity(robot, 0.0, 0.0, 0.0)
    robot.ticks(300)
    assert max(abs(speed) for speed in robot.tick().actuators.wheel_reference) < 0.05


def test_a_set_point_before_the_arming_moves_nothing_and_one_after_it_does(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(20)
    send_velocity(robot, 0.1, 0.0, 0.0)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert max(abs(speed) for speed in robot.ticks(100)[-1].actuators.wheel_reference) < 1e-3
    robot.command(ARM, 0)
    robot.ticks(5)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    send_velocity(robot, 0.1, 0.0, 0.0)
    assert max(abs(speed) for speed in robot.ticks(100)[-1].actuators.wheel_reference) > 0.1


def counted(robot: Client) -> int:
    robot.mav.command_long_send(1, 1, mav.MAV_CMD_REQUEST_MESSAGE, 0, mav.MAVLINK_MSG_ID_OMNI_CONTROL, 0, 0, 0, 0, 0, 0)
    control = robot.wait("OMNI_CONTROL")
    return int(control.fixes_accepted + control.fixes_refused)


def test_of_a_backlog_the_newest_fixes_are_used_in_bounded_time_and_the_rest_is_told(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(100)
    robot.inbox.clear()
    count = 100
    fixes(robot, count)
    before = counted(robot)
    assert "pose fix refused: too many at once" in robot.texts()
    robot.ticks(12)
    used = counted(robot) - before
    assert 2 <= used <= 12 < count
    robot.ticks(20)
    assert counted(robot) - before == used, "nothing waits any longer"


def test_of_a_backlog_it_is_the_newest_that_are_used(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(100)
    for number in range(90):
        x = -0.004 if number < 82 else 0.004
        robot.mav.vicon_position_estimate_send(robot.time_us - 1000 * (90 - number), x, 0, 0, 0, 0, 0)
    assert robot.ticks(30)[-1].actuators.pose[0] > 0.001
