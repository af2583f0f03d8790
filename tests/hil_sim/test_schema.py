# SPDX-License-Identifier: MIT
"""world.toml is the one place: scenario reader, C, dispersion and faults say what it says."""

from __future__ import annotations

import math
from typing import Any

import pytest

from hil_sim.dispersion import QUANTITIES, parse_dispersion
from hil_sim.faults import KINDS
from hil_sim.scenario import parse_scenario
from hil_sim.schema import WORLD, WORLD_NUMBERS
from hil_sim.world import PLANTS, World, WorldError, world_config
from omni_schema import Robot, SchemaError
from omni_schema.world import Quantity
from omniwheel._core import ffi, lib

HEAD = {"name": "mine", "description": "for a test", "robot": "three_wheel"}
RANGED = [quantity for quantity in WORLD.numbers.values() if quantity.kind != "bool"]
PAIRED = {"encoder_direction", "motor_direction", "in1_channel", "in2_channel", "fix_delay_s", "wheel_radius_m"}
"""Their ends alone do not make a world: 0 is no direction, a channel is used once, so many fixes do not fit."""


def outside(quantity: Quantity) -> list[float]:
    step = 1.0 if quantity.kind == "int" else 0.0
    below = quantity.minimum - step if step else math.nextafter(quantity.minimum, -math.inf)
    above = quantity.maximum + step if step else math.nextafter(quantity.maximum, math.inf)
    return [value for value in (below, above) if abs(value) < 2**31 or not step]


def changed(robot: Robot, quantity: Quantity, value: float) -> Any:
    config = world_config(robot)
    place = getattr(config, quantity.field)
    number: Any = int(value) if quantity.kind == "int" else value
    if quantity.per_wheel or quantity.elements:
        place[0] = number
    else:
        setattr(config, quantity.field, number)
    return config


@pytest.mark.parametrize("quantity", RANGED, ids=lambda quantity: quantity.name)
def test_c_refuses_what_lies_outside_and_says_what_is_allowed(robots: dict[str, Robot], quantity: Quantity) -> None:
    for value in outside(quantity):
        with pytest.raises(WorldError) as refused:
            World(changed(robots["three_wheel"], quantity, value))
        assert str(refused.value).startswith(quantity.field)
        assert str(refused.value).endswith(f"allowed: {quantity.allowed}")


@pytest.mark.parametrize(
    "quantity", [quantity for quantity in RANGED if quantity.name not in PAIRED], ids=lambda quantity: quantity.name
)
def test_c_takes_both_ends(robots: dict[str, Robot], quantity: Quantity) -> None:
    for value in (quantity.minimum, quantity.maximum):
        World(changed(robots["three_wheel"], quantity, value))


@pytest.mark.parametrize("name", WORLD_NUMBERS)
def test_a_scenario_is_refused_by_the_same_range_with_key_and_unit(name: str) -> None:
    quantity = WORLD_NUMBERS[name]
    parse_scenario({"scenario": HEAD, "world": {name: quantity.maximum}}, "mine.toml")
    for value in outside(quantity):
        with pytest.raises(SchemaError) as refused:
            parse_scenario({"scenario": HEAD, "world": {name: value}}, "mine.toml")
        assert f"mine.toml: world.{name}: is " in str(refused.value)
        assert str(refused.value).endswith(quantity.allowed)
        assert quantity.unit in quantity.allowed


def test_a_start_out_of_range_is_named_by_its_element() -> None:
    with pytest.raises(SchemaError, match=r"world\.start_pose\[2\]: is 2e\+06; .* a number from -1000000"):
        parse_scenario({"scenario": HEAD, "world": {"start_pose": [0, 2e6, 0]}}, "mine.toml")


def test_a_robot_file_out_of_range_is_named_with_file_and_key(robots: dict[str, Robot]) -> None:
    robot = robots["three_wheel"]
    heavy = Robot(**{**vars(robot), "simulation": {**robot.simulation, "roller_friction_N_s_m": 1e7}})
    with pytest.raises(WorldError, match=r"three_wheel\.toml: simulation\.roller_friction_N_s_m is 1e\+07; "):
        world_config(heavy)


def test_every_fault_and_plant_has_the_number_that_c_knows() -> None:
    for name, number in KINDS.items():
        assert getattr(lib, f"HIL_FAULT_{name.upper()}") == number
        assert ffi.string(lib.hil_fault_rules[number].name).decode() == name
        assert lib.hil_fault_rules[number].wheel == WORLD.faults[name].wheel
    for name, number in PLANTS.items():
        assert getattr(lib, f"HIL_PLANT_{WORLD.plants[name].symbol.upper()}") == number
    assert (len(KINDS) + 1, len(PLANTS)) == (lib.HIL_FAULT_KIND_COUNT, lib.HIL_PLANT_KIND_COUNT)


@pytest.mark.parametrize("name", [name for name, fault in WORLD.faults.items() if fault.value])
def test_the_number_of_a_fault_is_refused_by_its_range(name: str) -> None:
    fault = WORLD.faults[name]
    assert fault.value is not None
    entry: dict[str, Any] = {"kind": name, "start_s": 1.0, **({"wheel": 1} if fault.wheel else {})}
    parse_scenario({"scenario": HEAD, "fault": [{**entry, "value": fault.value.maximum}]}, "mine.toml")
    with pytest.raises(SchemaError) as refused:
        parse_scenario({"scenario": HEAD, "fault": [{**entry, "value": fault.value.maximum * 2}]}, "mine.toml")
    assert str(refused.value).endswith(fault.value.allowed)
    if fault.default is None:
        with pytest.raises(SchemaError, match=rf"fault\[1\]\.value: is needed for {name}"):
            parse_scenario({"scenario": HEAD, "fault": [entry]}, "mine.toml")


def test_a_fault_without_a_number_takes_none() -> None:
    with pytest.raises(SchemaError, match=r"fault\[1\]\.value: does not apply to pose_loss"):
        parse_scenario({"scenario": HEAD, "fault": [{"kind": "pose_loss", "start_s": 1, "value": 1.0}]}, "mine.toml")


@pytest.mark.parametrize("name", [*QUANTITIES])
def test_everything_that_may_differ_can(name: str) -> None:
    assert parse_dispersion("mine.toml", {name: {"normal": 0.1}})[0].quantity == name


def test_what_decides_is_one_for_all_and_wiring_does_not_differ() -> None:
    assert {"pca9685_address", "output_enable_rest_V", "linear_viscous_x", "encoder_direction"}.isdisjoint(QUANTITIES)
    assert {"mass_kg", "wheel_radius_m", "start_theta_rad", "coulomb_friction_N_m"} <= set(QUANTITIES)
