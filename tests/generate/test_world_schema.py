# SPDX-License-Identifier: MIT
from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import pytest

from c_world import drivers_header, members, names_header, ranges_source
from omni_schema import SchemaError, load_parameters
from omni_schema.world import load_world, parse_world

PATH = Path(__file__).resolve().parents[2] / "shared" / "world.toml"
DRIVERS = load_parameters(PATH.with_name("params.toml")).motor_drivers
NUMBER = {"kind": "real", "unit": "m", "min": 0.0, "max": 2.0, "default": 1.0, "doc": "a length"}
SMALL: dict[str, Any] = {
    "schema_version": 1,
    "numbers": {"length_m": NUMBER},
    "plants": {"full": {"doc": "all"}, "half+some": {"doc": "less"}},
    "sensors": {"counter": {"doc": "it counts"}},
    "faults": {"broken": {"wheel": True, "value": {"unit": "s", "min": 0.0, "max": 1.0}, "doc": "it is broken"}},
}


def with_number(**changes: Any) -> dict[str, Any]:
    document = copy.deepcopy(SMALL)
    document["numbers"]["length_m"].update(changes)
    return document


def test_the_packaged_file_says_something_of_every_row() -> None:
    world = load_world(PATH)
    tables = (world.numbers, world.plants, world.sensors, world.faults)
    assert all(row.doc for table in tables for row in table.values())
    assert [plant.number for plant in world.plants.values()] == list(range(len(world.plants)))
    assert [fault.number for fault in world.faults.values()] == list(range(1, len(world.faults) + 1))


def test_every_row_reaches_the_c_sources() -> None:
    world = load_world(PATH)
    names, fields, ranges = names_header(world, DRIVERS), members(world), ranges_source(world)
    for quantity in world.numbers.values():
        assert f" {quantity.field}" in fields
        assert (f'"{quantity.field}"' in ranges) == (quantity.kind != "bool")
    for plant in world.plants.values():
        assert f"HIL_PLANT_{plant.symbol.upper()} = {plant.number}," in names
    for fault in world.faults.values():
        assert f"HIL_FAULT_{fault.name.upper()} = {fault.number}," in names
        assert f'"{fault.name}"' in ranges
    for driver in DRIVERS.values():
        assert f"HIL_DRIVER_{driver.name.upper()} = {driver.number}," in names
        assert f"/* {driver.name} */" in drivers_header(DRIVERS)


def test_what_it_decides_is_one_number_for_all_runs() -> None:
    assert "hil_real_t length_m; /**< a length [m] */" in members(parse_world(SMALL, "w"))
    assert "double length_m; /**< a length [m] */" in members(parse_world(with_number(deciding=True), "w"))


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({**SMALL, "planets": {}}, ("planets", "did you mean plants")),
        ({**SMALL, "faults": {}}, ("faults", "no rows")),
        ({**SMALL, "numbers": {"Length": NUMBER}}, ("numbers.Length", "is no name")),
        (with_number(kind="rael"), ("numbers.length_m.kind", "did you mean real")),
        (with_number(mni=0.0), ("numbers.length_m.mni", "did you mean min")),
        (with_number(min=3.0), ("numbers.length_m.min", "above max")),
        (with_number(default=5.0), ("numbers.length_m.default", "from 0 to 2 m")),
        (with_number(default=[1.0, 1.0, 1.0]), ("numbers.length_m.default", "one number")),
        (with_number(elements=["x", "y"]), ("numbers.length_m.elements", "three names")),
        (with_number(each="motor"), ("numbers.length_m.each", "wheel")),
        (with_number(fixed=1), ("numbers.length_m.fixed", "true or false")),
        ({**SMALL, "numbers": {"a_m": {**NUMBER, "default": None}}}, ("numbers.a_m.default", "no robot_key")),
        ({**SMALL, "faults": {"broken": {"doc": "x", "value": {"unit": "s"}}}}, ("faults.broken.value.min", "missing")),
    ],
)
def test_a_mistake_is_named(document: dict[str, Any], said: tuple[str, ...]) -> None:
    with pytest.raises(SchemaError) as caught:
        parse_world(document, "mine.toml")
    for words in ("mine.toml", *said):
        assert words in str(caught.value)


def test_a_value_is_taken_exactly_if_it_is_in_range() -> None:
    length = parse_world(SMALL, "w").numbers["length_m"]
    assert [length.parse("f", "k", value) for value in (0, 1.5, 2.0)] == [0.0, 1.5, 2.0]
    for value in (-1e-9, 2.1, math.nan, math.inf, "1", True, None):
        with pytest.raises(SchemaError, match="k: is"):
            length.parse("f", "k", value)


def test_above_zero_leaves_out_zero_alone() -> None:
    length = parse_world(with_number(min="above 0"), "w").numbers["length_m"]
    assert length.parse("f", "k", 1e-300) == 1e-300
    with pytest.raises(SchemaError, match=r"k: is 0; allowed is a number above 0, at most 2 m"):
        length.parse("f", "k", 0.0)


def test_whole_numbers_and_yes_or_no() -> None:
    whole = parse_world(with_number(kind="int"), "w").numbers["length_m"]
    assert whole.parse("f", "k", 2) == 2.0
    with pytest.raises(SchemaError, match=r"k: is 1\.5; allowed is a whole number from 0 to 2 m"):
        whole.parse("f", "k", 1.5)
    switch = parse_world(with_number(kind="bool", max=1), "w").numbers["length_m"]
    assert (switch.parse("f", "k", True), switch.parse("f", "k", 0)) == (1.0, 0.0)
