# SPDX-License-Identifier: MIT
"""The emergency stop in every mode and state: zero volts in the next tick, and nothing but a release leads out."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.firmware.client import Client, lockstep_robot, mav, storage_arguments
from tests.firmware.test_commands import ARM, ARMED, DISARMED, FAILSAFE, send_pose, send_velocity

ESTOP = 4
STOP = mav.MAV_CMD_OMNI_ESTOP
CHANNELS = (2, 3, 8, 9, 13, 14)
DUTIES = [0.3, 0.3, 0.3, 0.0]


def hold(robot: Client, tick: int) -> None:
    del robot, tick


def pose(robot: Client, tick: int) -> None:
    if tick % 100 == 0:
        send_pose(robot, 0.5, 0.2, 0.3)


def velocity(robot: Client, tick: int) -> None:
    if tick % 100 == 0:
        send_velocity(robot, 0.05, 0.02, 0.2)


def manual(robot: Client, tick: int) -> None:
    if tick % 100 == 0:
        robot.mav.manual_control_send(1, 100, 50, 0, 100, 0)


def duty(robot: Client, tick: int) -> None:
    if tick % 100 == 0:
        robot.mav.omni_setpoint_duty_send(1, 1, DUTIES)


def trajectory(robot: Client, tick: int) -> None:
    if tick == 0:
        robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1, -1)


def tuning(robot: Client, tick: int) -> None:
    trajectory(robot, tick)
    if tick % 50 == 0:
        robot.set("ISMC_LAM_XY", 5.0 + tick % 7)


MODES = {mode.__name__: mode for mode in (hold, pose, velocity, manual, duty, trajectory, tuning)}


def drive(robot: Client, name: str) -> None:
    """Arm and drive in a mode for a while."""
    robot.armed()
    for tick in range(400):
        MODES[name](robot, tick)
        answer = robot.tick()
    assert answer.actuators.state == ARMED
    if name != "hold":
        forward, back = robot.channel(9), robot.channel(8)
        assert any(robot.channel(a) != robot.channel(b) for a, b in ((9, 8), (13, 14), (3, 2))), (forward, back)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("command", [STOP, mav.MAV_CMD_DO_FLIGHTTERMINATION])
def test_zero_volts_in_the_next_tick_and_no_way_but_the_release(robot: Client, mode: str, command: int) -> None:
    drive(robot, mode)
    assert robot.command(command, 1) == mav.MAV_RESULT_ACCEPTED
    tick = robot.tick()
    assert (tick.actuators.state, tick.actuators.output_enable) == (ESTOP, 0)
    assert [robot.channel(channel) for channel in CHANNELS] == [0] * 6
    for number in range(120):
        MODES[mode](robot, number)
        tick = robot.tick()
        assert (tick.actuators.state, tick.actuators.output_enable) == (ESTOP, 0)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_DENIED
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP
    assert robot.command(STOP, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == DISARMED
    assert [robot.channel(channel) for channel in CHANNELS] == [0] * 6
    drive(robot, mode)


def test_the_state_is_told_in_words(robot: Client) -> None:
    drive(robot, "velocity")
    robot.command(STOP, 1)
    texts = [m.text for tick in robot.ticks(3) for m in tick.others if m.get_type() == "STATUSTEXT"]
    assert texts == ["estop"]


def test_before_the_first_tick_and_while_disarmed(robot: Client) -> None:
    assert robot.command(STOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP
    assert robot.command(STOP, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == DISARMED
    assert robot.command(STOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP


def test_in_failsafe_and_with_the_fault_still_there(robot: Client) -> None:
    drive(robot, "velocity")
    assert robot.tick(battery_v=float("nan")).actuators.state == FAILSAFE
    robot.command(STOP, 1)
    assert robot.tick(battery_v=float("nan")).actuators.state == ESTOP
    robot.command(STOP, 0)
    assert robot.tick(battery_v=float("nan")).actuators.state == DISARMED


def test_it_wins_over_an_arm_command_of_the_same_tick(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(30)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(STOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert [tick.actuators.state for tick in robot.ticks(5)] == [ESTOP] * 5


def test_it_outlives_the_program_and_its_release_does_too(tmp_path: Path) -> None:
    path = tmp_path / "memory"
    with lockstep_robot(*storage_arguments(path)) as robot:
        drive(robot, "velocity")
        assert robot.command(STOP, 1) == mav.MAV_RESULT_ACCEPTED
        assert {tick.actuators.state for tick in robot.ticks(3)} == {ESTOP}
    for _ in range(2):
        with lockstep_robot(*storage_arguments(path)) as robot:
            robot.heartbeat()
            assert {tick.actuators.state for tick in robot.ticks(30)} == {ESTOP}
            assert robot.command(ARM, 1) == mav.MAV_RESULT_DENIED
    with lockstep_robot(*storage_arguments(path)) as robot:
        robot.tick()
        assert robot.command(STOP, 0) == mav.MAV_RESULT_ACCEPTED
        robot.ticks(600)
    with lockstep_robot(*storage_arguments(path)) as robot:
        drive(robot, "velocity")


def test_a_program_that_ends_while_driving_does_not_drive_when_it_is_back(tmp_path: Path) -> None:
    path = tmp_path / "memory"
    with lockstep_robot(*storage_arguments(path)) as robot:
        drive(robot, "velocity")
    with lockstep_robot(*storage_arguments(path)) as robot:
        robot.heartbeat()
        for number in range(300):
            send_velocity(robot, 0.05, 0.02, 0.2)
            tick = robot.tick()
            assert tick.actuators.state == DISARMED, number
            assert tick.actuators.output_enable == 0


def test_starting_the_loop_over_does_not_lift_it(robot: Client) -> None:
    drive(robot, "velocity")
    robot.command(STOP, 1)
    robot.ticks(2)
    for _ in range(2):
        assert robot.command(mav.MAV_CMD_OMNI_HIL, 1) == mav.MAV_RESULT_ACCEPTED
        robot.time_us = 0
        assert {tick.actuators.state for tick in robot.ticks(30)} == {ESTOP}
