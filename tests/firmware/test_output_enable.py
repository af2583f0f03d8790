# SPDX-License-Identifier: MIT
"""MAV_CMD_OMNI_OE_TEST in lockstep: pin off, bus at rest, then disarmed; a stop wins at once."""

from __future__ import annotations

import math

import pytest

from tests.firmware.client import Client, Tick, connect, firmware, mav
from tests.firmware.test_commands import ARM, ARMED, DISARMED, FAILSAFE, send_velocity

TEST = mav.MAV_CMD_OMNI_OE_TEST
ESTOP = 4
OFF, ON, RELEASED = 0, 1, 2
DUTY = 0.15
COAST = [0, 0, 0, 0x10]


def duties(robot: Client, duty: float = DUTY) -> None:
    robot.mav.omni_setpoint_duty_send(1, 1, [duty] * 4)


def driven(robot: Client, duty: float = DUTY) -> Client:
    """Bring a robot to turn its wheels by duties."""
    robot.armed()
    duties(robot, duty)
    assert robot.ticks(3)[-1].actuators.output_enable == ON
    return robot


def outcome(tick: Tick) -> tuple[int, int, int]:
    return tick.actuators.state, tick.actuators.output_enable, tick.actuators.i2c_length


def stopped_by_bus(tick: Tick) -> bool:
    return all(data[1:] == bytes(COAST * ((len(data) - 1) // 4)) for _, data, _ in tick.i2c if len(data) > 2)


@pytest.mark.parametrize(("release", "level"), [(0, OFF), (1, RELEASED)])
def test_the_bus_rests_while_the_pin_is_off_then_the_robot_is_disarmed(robot: Client, release: int, level: int) -> None:
    driven(robot)
    before = bytes(robot.registers)
    assert robot.command(TEST, 0.2, release) == mav.MAV_RESULT_ACCEPTED
    ticks = robot.ticks(200)
    assert {outcome(tick) for tick in ticks} == {(ARMED, level, 0)}
    assert bytes(robot.registers) == before, "the chip keeps its duties"
    end = robot.tick()
    assert (end.actuators.state, end.actuators.output_enable) == (DISARMED, OFF)
    assert end.i2c
    assert stopped_by_bus(end)
    assert {tick.actuators.output_enable for tick in robot.ticks(50)} == {OFF}


@pytest.mark.parametrize(
    ("stop", "state"),
    [((ARM, 0), DISARMED), ((mav.MAV_CMD_OMNI_ESTOP, 1), ESTOP), ((mav.MAV_CMD_DO_FLIGHTTERMINATION, 1), ESTOP)],
)
@pytest.mark.parametrize("release", [0, 1])
def test_a_stop_wins_in_its_own_tick_by_pin_and_bus(
    robot: Client, release: int, stop: tuple[int, int], state: int
) -> None:
    driven(robot)
    robot.command(TEST, 2.0, release)
    robot.ticks(20)
    assert robot.command(*stop) == mav.MAV_RESULT_ACCEPTED
    tick = robot.tick()
    assert (tick.actuators.state, tick.actuators.output_enable) == (state, OFF)
    assert tick.i2c
    assert stopped_by_bus(tick)


def test_faults_and_silence_stop_it_as_ever(robot: Client) -> None:
    driven(robot)
    robot.command(TEST, 2.0)
    assert robot.ticks(5, valid=0)[-1].actuators.state == FAILSAFE
    robot.command(ARM, 0)
    robot.ticks(5)
    driven(robot)
    robot.command(TEST, 2.0)
    ticks = robot.ticks(600)
    assert ticks[490].actuators.state == ARMED
    assert ticks[-1].actuators.state == DISARMED, "SAFE_CMD_TO without duties ends the test"
    assert {tick.actuators.output_enable for tick in ticks} == {OFF}


def test_it_neither_stalls_nor_counts_volts_that_are_not_there(robot: Client) -> None:
    robot.set("SAFE_STALL_V", 0.1)
    driven(robot)
    robot.command(TEST, 0.4)
    still = [0, 0, 0, 0]
    assert {tick.actuators.state for tick in robot.ticks(399, counts=still)} == {ARMED}


def test_larger_duties_and_other_set_points_do_not_reach_the_motors(robot: Client) -> None:
    driven(robot)
    robot.command(TEST, 1.0)
    robot.ticks(5)
    duties(robot, 1.0)
    assert {outcome(tick) for tick in robot.ticks(20)} == {(ARMED, OFF, 0)}
    send_velocity(robot, 0.5, 0, 0)
    tick = robot.tick()
    assert (tick.actuators.state, tick.actuators.output_enable) == (DISARMED, OFF)
    assert stopped_by_bus(tick)


def test_a_repeated_command_does_not_make_it_longer(robot: Client) -> None:
    driven(robot)
    robot.command(TEST, 0.2)
    robot.ticks(100)
    robot.command(TEST, 0.2)
    assert robot.ticks(101)[-1].actuators.state == DISARMED


def test_it_is_refused_unless_small_duties_turn_the_wheels(robot: Client) -> None:
    robot.ticks(20)
    assert robot.command(TEST, 0.5) == mav.MAV_RESULT_DENIED
    robot.armed()
    assert robot.command(TEST, 0.5) == mav.MAV_RESULT_DENIED
    send_velocity(robot, 0.1, 0, 0)
    robot.tick()
    assert robot.command(TEST, 0.5) == mav.MAV_RESULT_DENIED
    duties(robot, 0.31)
    robot.ticks(3)
    assert robot.command(TEST, 0.5) == mav.MAV_RESULT_DENIED
    tick = robot.tick()
    assert tick.actuators.output_enable == ON, "it drives on"
    texts = [m.text for m in tick.others if m.get_type() == "STATUSTEXT"]
    assert "OE test refused: arm, duties up to 0.3 first" in texts


@pytest.mark.parametrize("numbers", [(0.0,), (0.09,), (2.1,), (math.nan,), (math.inf,), (0.5, 2.0), (0.5, math.nan)])
def test_numbers_that_make_no_test_are_refused(robot: Client, numbers: tuple[float, ...]) -> None:
    driven(robot)
    assert robot.command(TEST, *numbers) == mav.MAV_RESULT_DENIED
    assert robot.tick().actuators.output_enable == ON


def test_a_test_does_not_outlive_its_host(robot: Client) -> None:
    driven(robot)
    robot.command(TEST, 2.0)
    robot.ticks(5)
    robot.command(mav.MAV_CMD_OMNI_ESTOP, 1)
    robot.ticks(3)
    robot.command(mav.MAV_CMD_OMNI_ESTOP, 0)
    robot.ticks(3)
    assert robot.command(mav.MAV_CMD_OMNI_HIL, 1) == mav.MAV_RESULT_ACCEPTED
    robot.time_us = 0
    driven(robot)
    assert {tick.actuators.output_enable for tick in robot.ticks(50)} == {ON}


def test_a_board_without_the_pin_says_so() -> None:
    with firmware() as running:
        robot = connect(running)
        assert robot.command(TEST, 0.5) == mav.MAV_RESULT_UNSUPPORTED
        robot.wait("STATUSTEXT", text="OE test refused: no output-enable pin")
        robot.socket.close()


def test_arming_right_after_a_disarm_that_changed_nothing_is_put_off_and_not_lost(robot: Client) -> None:
    """After the test the robot is disarmed already. A disarm and an arm in one tick: the stop wins, so arming waits."""
    robot.heartbeat()
    robot.ticks(20)
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(ARM, 1) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    robot.ticks(3)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ARMED


def test_the_largest_duty_that_is_named_is_small_enough(robot: Client) -> None:
    driven(robot, 0.3)
    assert robot.command(TEST, 0.5) == mav.MAV_RESULT_ACCEPTED
