# SPDX-License-Identifier: MIT
"""A robot whose motors hang on the processor's pins, in the simulated world."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from hil_sim.world import NO_POSE_SENSOR, World, WorldError, world_config
from omni_schema import Robot, load_parameters, parse_robot
from omni_schema.toml_file import read_toml

SHARED = Path(__file__).parents[2] / "shared"
EXAMPLE = SHARED / "robots" / "examples" / "three_wheel_pins.toml"
TABLE = load_parameters(SHARED / "params.toml")
STEPS = 4096
PING = bytes([0x40, 0, 0])
"""A transaction that only asks whether the PWM chip is there."""

drivers = pytest.mark.parametrize("driver", ["in1_in2", "pwm_dir"])


def robot(driver: str = "in1_in2") -> Robot:
    document = copy.deepcopy(read_toml(EXAMPLE))
    document["wiring"]["motor_driver"] = driver
    return parse_robot(document, TABLE, str(EXAMPLE))


def world(driver: str = "in1_in2") -> World:
    return World(world_config(robot(driver), pose_sensor=NO_POSE_SENSOR))


def pins(driver: str, duty: float) -> tuple[int, int]:
    low = round(STEPS * abs(duty))
    if driver == "pwm_dir":
        return low, STEPS if duty < 0 else 0
    return (STEPS, STEPS - low) if duty >= 0 else (STEPS - low, STEPS)


@drivers
@pytest.mark.parametrize("duty", [1.0, 0.4, -0.4, -1.0])
def test_all_wheels_with_the_same_duty_turn_the_robot_in_place(driver: str, duty: float) -> None:
    turning, reference = world(driver), world(driver)
    for _ in range(500):
        turning.motor_pins([pins(driver, duty)] * 3)
        turning.step()
        reference.set_duty([duty] * 3)
        reference.step()
    assert turning.c.twist[2] * duty > 0.01
    assert turning.c.twist[2] == pytest.approx(reference.c.twist[2], rel=1e-3)


@drivers
def test_low_pins_coast_on_in1_in2_and_brake_on_pwm_dir(driver: str) -> None:
    stopping = world(driver)
    for _ in range(500):
        stopping.motor_pins([pins(driver, 0.5)] * 3)
        stopping.step()
    stopping.motor_pins([(0, 0)] * 3)
    stopping.step()
    voltages = [stopping.c.bridge[wheel].coast for wheel in range(3)]
    assert voltages == [1.0 if driver == "in1_in2" else 0.0] * 3


@drivers
def test_nothing_is_on_the_bus_and_its_bytes_move_nothing(driver: str) -> None:
    empty = world(driver)
    empty.motor_pins([pins(driver, 0.5)] * 3)
    driven = list(empty.c.in1)
    empty.i2c(PING)
    assert empty.c.i2c_status == 1
    assert list(empty.c.in1) == driven


def test_pins_are_of_no_effect_on_a_robot_with_the_chip() -> None:
    table = load_parameters(SHARED / "params.toml")
    chip = World(
        world_config(parse_robot(read_toml(SHARED / "robots" / "three_wheel.toml"), table, "three_wheel.toml"))
    )
    chip.motor_pins([(STEPS, 0)] * 3)
    chip.step(100)
    assert chip.c.twist[2] == 0.0


@pytest.mark.parametrize(("field", "value"), [("driver", 3), ("motor_pwm_Hz", 0), ("motor_pwm_Hz", 1e6)])
def test_a_nonsense_driver_is_refused(field: str, value: float) -> None:
    config = world_config(robot())
    setattr(config, field, value)
    with pytest.raises(WorldError, match=f"^{field} is "):
        World(config)
