# SPDX-License-Identifier: MIT
"""Motor drivers on the processor's own pins, host-in-the-loop: what the pins get, and that a stop wins there, too."""

from __future__ import annotations

import pytest

from tests.firmware.client import Client, Tick, mav
from tests.firmware.test_commands import ARM, ARMED, DISARMED, FAILSAFE

PCA9685, IN1_IN2, PWM_DIR = 0, 1, 2
ESTOP = 4
STEPS = 4096
DUTIES = (0.25, -0.5, 0.0)
LOW = [0, 0] * 4
PINS = {
    IN1_IN2: [STEPS, STEPS * 3 // 4, STEPS // 2, STEPS, STEPS, STEPS, 0, 0],
    PWM_DIR: [STEPS // 4, 0, STEPS // 2, STEPS, 0, 0, 0, 0],
}
"""Of wheels 1 to 4 with DUTIES; there is no fourth."""

drivers = pytest.mark.parametrize("driver", [IN1_IN2, PWM_DIR])


def pins(tick: Tick) -> list[int]:
    return list(tick.actuators.motor_pins)


def wired(robot: Client, driver: int) -> Client:
    assert robot.set("MOT_DRIVER", driver) == driver
    return robot


def driven(robot: Client, driver: int) -> Client:
    """Bring a robot with this driver to turn its wheels by duties."""
    wired(robot, driver).armed()
    robot.mav.omni_setpoint_duty_send(1, 1, [*DUTIES, 0.0])
    robot.ticks(3)
    return robot


@drivers
def test_duties_come_out_at_the_pins_and_nothing_at_the_bus(robot: Client, driver: int) -> None:
    tick = driven(robot, driver).tick()
    assert tick.actuators.state == ARMED
    assert pins(tick) == PINS[driver]
    assert not tick.i2c
    assert tick.actuators.output_enable == 1


@drivers
@pytest.mark.parametrize(
    ("stop", "state"),
    [((ARM, 0), DISARMED), ((mav.MAV_CMD_OMNI_ESTOP, 1), ESTOP), ((mav.MAV_CMD_DO_FLIGHTTERMINATION, 1), ESTOP)],
)
def test_a_stop_has_the_pins_low_in_its_own_tick(robot: Client, driver: int, stop: tuple[int, int], state: int) -> None:
    driven(robot, driver)
    assert robot.command(*stop) == mav.MAV_RESULT_ACCEPTED
    tick = robot.tick()
    assert (tick.actuators.state, tick.actuators.output_enable) == (state, 0)
    assert pins(tick) == LOW


@drivers
def test_a_fault_has_them_low(robot: Client, driver: int) -> None:
    driven(robot, driver)
    tick = robot.ticks(5, valid=0)[-1]
    assert tick.actuators.state == FAILSAFE
    assert pins(tick) == LOW


@drivers
def test_what_happens_on_the_bus_is_none_of_its_business(robot: Client, driver: int) -> None:
    driven(robot, driver)
    assert robot.ticks(50, nack=True)[-1].actuators.state == ARMED


def test_a_robot_with_the_chip_leaves_the_pins_low(robot: Client) -> None:
    ticks = driven(robot, PCA9685).ticks(5)
    assert {tuple(pins(tick)) for tick in ticks} == {tuple(LOW)}
    assert all(tick.i2c for tick in ticks)


@pytest.mark.parametrize(("before", "after"), [(IN1_IN2, PWM_DIR), (PWM_DIR, PCA9685), (PCA9685, IN1_IN2)])
def test_another_driver_leaves_nothing_on_behind_it(robot: Client, before: int, after: int) -> None:
    driven(robot, before)
    assert robot.set("MOT_DRIVER", after) == before, "not while armed"
    robot.command(ARM, 0)
    robot.tick()
    robot.heartbeat()
    robot.ticks(250)  # its wheels come to rest
    wired(robot, after)
    ticks = robot.ticks(3)
    assert {tuple(pins(tick)) for tick in ticks} == {tuple(LOW)}
    assert {tick.actuators.output_enable for tick in ticks} == {0}
    driven(robot, after)
    assert pins(robot.tick()) == PINS.get(after, LOW)


def test_channels_are_compared_only_where_there_are_channels(robot: Client) -> None:
    shared = robot.get("W1_IN2_CH")
    assert robot.set("W1_IN1_CH", shared) != shared
    wired(robot, IN1_IN2)
    assert robot.set("W1_IN1_CH", shared) == shared
    assert robot.set("MOT_DRIVER", PCA9685) == IN1_IN2, "two inputs are on one channel now"
