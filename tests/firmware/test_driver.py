# SPDX-License-Identifier: MIT
"""The PCA9685 driver, seen by the bytes it puts on the bus in lockstep."""

from __future__ import annotations

import pytest

from tests.firmware.client import PCA9685, Client, mav
from tests.firmware.test_commands import ARM, ARMED, FAILSAFE, send_velocity

PAIRS = {2: 3, 8: 9, 13: 14}  # three_wheel.toml
MODE1, MODE2, PRESCALE, ALL_LED_OFF_H = 0x00, 0x01, 0xFE, 0xFD


def written(robot: Client) -> list[bytes]:
    return [data for _, data, _ in robot.tick().i2c]


def test_power_up_switches_everything_off_before_anything_else(robot: Client) -> None:
    assert written(robot) == [bytes([ALL_LED_OFF_H, 0x10])]
    # Asleep with auto-increment; 1526 Hz; totem pole, outputs change on STOP.
    assert written(robot) == [bytes([MODE1, 0x30]), bytes([PRESCALE, 3]), bytes([MODE2, 0x04])]
    assert written(robot) == [bytes([MODE1, 0x20])]
    update = robot.ticks(2)[-1].i2c
    assert all(address == PCA9685 for address, _, _ in update)
    assert [data[0] for _, data, _ in update] == [6 + 4 * first for first in PAIRS]


def test_the_oscillator_gets_its_start_up_time(robot: Client) -> None:
    robot.ticks(3, step_us=200)
    silent = robot.ticks(3, step_us=200)
    assert [t.i2c for t in silent[:2]] == [[], []]
    assert silent[2].i2c or robot.tick(step_us=200).i2c


def test_a_disarmed_robot_coasts(robot: Client) -> None:
    data = [data for _, data, _ in robot.ticks(20)[-1].i2c]
    assert data == [bytes([6 + 4 * first, *[0, 0, 0, 0x10] * 2]) for first in PAIRS]


def test_an_armed_robot_at_rest_brakes(robot: Client) -> None:
    robot.armed()
    robot.tick()
    assert all(robot.channel(c) == 4096 for c in (*PAIRS, *PAIRS.values()))


def test_the_output_enable_pin_is_on_while_motors_may_turn_and_no_longer(robot: Client) -> None:
    assert [tick.actuators.output_enable for tick in robot.ticks(20)] == [0] * 20
    robot.armed()
    assert robot.tick().actuators.output_enable == 1
    assert [tick.actuators.output_enable for tick in robot.ticks(5, nack=True)] == [1] * 5, "a few lost updates"
    assert robot.tick().actuators.output_enable == 1
    robot.command(mav.MAV_CMD_OMNI_ESTOP, 1)
    assert robot.tick().actuators.output_enable == 0


def test_the_pin_goes_off_in_the_tick_that_finds_the_driver_dead(robot: Client) -> None:
    robot.armed()
    ticks = robot.ticks(20, nack=True)
    assert all(tick.actuators.output_enable == (tick.actuators.state == ARMED) for tick in ticks)
    assert ticks[-1].actuators.state == FAILSAFE


def test_the_pin_is_not_switched_on_over_a_chip_that_does_not_answer(robot: Client) -> None:
    """What it was told before the last stop may still be in its registers."""
    robot.set("SAFE_I2C_N", 1000)
    robot.armed()
    assert robot.tick().actuators.output_enable == 1
    robot.command(ARM, 0)
    robot.ticks(5, nack=True)
    robot.heartbeat()
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    late = robot.ticks(5, nack=True)
    assert late[-1].actuators.state == ARMED
    assert [tick.actuators.output_enable for tick in late] == [0] * 5
    assert robot.ticks(2)[-1].actuators.output_enable == 1


def test_the_pin_is_off_while_a_chip_that_lost_its_power_is_set_up_again(robot: Client) -> None:
    robot.armed()
    robot.registers[MODE1] = 0x11
    pins = [tick.actuators.output_enable for tick in robot.ticks(80)]
    assert 0 in pins
    assert pins[-1] == 1


def test_on_and_off_counts_are_never_equal(robot: Client) -> None:
    robot.armed()
    for speed in (0.02, 0.05, 0.1, 0.3, 1.0):
        send_velocity(robot, speed, 0, 0)
        for tick in robot.ticks(50):
            for _, data, _ in tick.i2c:
                for at in range(1, len(data), 4):
                    on, off = data[at] | data[at + 1] << 8, data[at + 2] | data[at + 3] << 8
                    assert on != off
                    assert (on & 0xFFF, off & 0xFFF) == (0, off) or (on, off) in {(0x1000, 0), (0, 0x1000)}


def test_one_lost_update_is_repeated_and_stops_nothing(robot: Client) -> None:
    robot.armed()
    tick = robot.tick(nack=True)
    assert tick.actuators.state == ARMED
    assert (PCA9685, bytes([MODE1]), 1) in tick.i2c  # is it still awake?
    assert robot.ticks(5)[-1].actuators.state == ARMED


def test_a_chip_that_does_not_answer_stops_the_robot_and_is_set_up_again(robot: Client) -> None:
    robot.armed()
    robot.registers[MODE1] = 0x11  # it has lost its power
    ticks = robot.ticks(20, nack=True)
    assert ticks[-1].actuators.state == FAILSAFE
    assert ticks[-1].actuators.faults & 1 << 7
    texts = [m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT"]
    assert "failsafe: driver" in texts
    sequence = [data for t in robot.ticks(5) for _, data, _ in t.i2c]
    assert bytes([ALL_LED_OFF_H, 0x10]) in sequence
    assert sequence.index(bytes([MODE1, 0x20])) > sequence.index(bytes([ALL_LED_OFF_H, 0x10]))
    robot.heartbeat()
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    robot.armed()


def test_a_chip_that_lost_its_power_unnoticed_is_found_and_set_up_again(robot: Client) -> None:
    robot.armed()
    robot.registers[MODE1] = 0x11
    sequence = [data for t in robot.ticks(80) for _, data, _ in t.i2c]
    assert bytes([ALL_LED_OFF_H, 0x10]) in sequence
    assert robot.registers[MODE1] == 0x20


@pytest.mark.parametrize("wheel", [1, 2, 3])
def test_moved_wires_are_driven_on_their_new_channels(robot: Client, wheel: int) -> None:
    robot.set(f"W{wheel}_IN1_CH", 15)
    driven = set()
    for _, data, _ in robot.ticks(20)[-1].i2c:
        first = (data[0] - 6) // 4
        driven |= set(range(first, first + (len(data) - 1) // 4))
    old = {1: 9, 2: 13, 3: 3}[wheel]
    assert driven == {2, 3, 8, 9, 13, 14, 15} - {old}


def test_with_other_wires_the_chip_is_set_up_anew(robot: Client) -> None:
    robot.ticks(30)
    robot.set("W1_IN1_CH", 15)
    written = [data for tick in robot.ticks(10) for _, data, _ in tick.i2c]
    assert bytes([MODE1, 0x20]) in written


def test_a_read_back_that_never_comes_stops_the_robot_with_its_name_and_a_sentence(robot: Client) -> None:
    """A simulator without it, or a bus whose reads fail: no set-up helps, and the motors would stay off unsaid."""
    robot.armed()
    ticks = []
    for _ in range(200):
        robot.heartbeat()
        ticks.append(robot.tick())
        robot.read = robot.read and b"\0"
    texts = [m.text for tick in ticks for m in tick.others if m.get_type() == "STATUSTEXT"]
    assert texts.count("PWM chip: MODE1 does not read back as 0x20") == 1
    assert "failsafe: driver" in texts
    assert ticks[-1].actuators.state == FAILSAFE
    first = next(number for number, tick in enumerate(ticks) if tick.actuators.faults & 1 << 7)
    assert first < 90  # the look after 64 updates, and two more, each after a set-up
    assert all(tick.actuators.faults & 1 << 7 for tick in ticks[first:])
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    robot.ticks(40)  # now it does read back
    robot.armed()
    assert robot.ticks(10)[-1].actuators.faults & 1 << 7 == 0


def test_the_answer_says_duty_and_coast_of_each_wheel_as_its_bytes_do(robot: Client) -> None:
    """A wheel whose motor is wired the other way is driven counter-clockwise by a negative voltage."""
    robot.set("W2_MOT_DIR", -1.0)
    directions = (1, -1, 1)
    assert [tick.actuators.coast for tick in robot.ticks(5)] == [0b1111] * 5
    robot.armed()
    send_velocity(robot, 0.1, 0.05, 0.2)
    ticks = robot.ticks(60)
    assert max(abs(duty) for duty in ticks[-1].actuators.duty) > 200
    for wheel, (in1, in2) in enumerate(((9, 8), (13, 14), (3, 2))):
        share = (robot.channel(in1) - robot.channel(in2)) * directions[wheel]
        assert ticks[-1].actuators.duty[wheel] == share
    assert ticks[-1].actuators.coast == 0
    robot.command(ARM, 0)
    off = robot.ticks(3)[-1].actuators
    assert (list(off.duty), off.coast) == ([0] * 4, 0b1111)
