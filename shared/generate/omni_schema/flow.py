# SPDX-License-Identifier: MIT
"""The section ``flow`` of a robot file: which sensor of motion over the floor there is, and how its wheels are."""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError
from omni_schema.toml_file import number_within, refuse_unknown_keys, take_chip, take_table, take_text

FLOW_CHIPS = "flow_chips"
"""The key of the table in ``params.toml``."""
MODE_PARAMETER = "FLOW_MODE"
SDA_PIN, SCL_PIN = 25, 24
"""Pins of the Teensy's third bus, which is the sensor's alone."""
PIN_USERS = {SDA_PIN: "the floor-motion sensor's I2C (SDA)", SCL_PIN: "the floor-motion sensor's I2C (SCL)"}
WHEEL_KEYS = ("steps_per_mm", "x_wheel_mm", "y_wheel_mm", "reversed")
AXES = ("x", "y")

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
_DRIVER = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_HIGHEST_ADDRESS = 0x77
_WAY_AND_TURN = 2.0
_REG_CONTROL, _REG_STEPS, _REG_X_WHEEL, _REG_Y_WHEEL = 4, 14, 15, 16
_DIRECTION = {("y", True): 4, ("y", False): 8, ("x", True): 16, ("x", False): 32}
"""Bits of a Pinpoint's control register, by axis and whether it counts the other way."""


@dataclass(frozen=True)
class FlowChip:
    """A sensor. ``number``: its place in the table.

    ``driver``: the header in ``firmware/app/drivers`` and the namespace in it. ``address``: of the bus, 7 bit.
    ``supply``: its supply pin. ``wheels``: it measures with two wheels, which the robot file describes.
    """

    number: int
    name: str
    doc: str
    driver: str
    address: int
    supply: str
    wheels: bool = False


@dataclass(frozen=True)
class FlowWiring:
    """A sensor of a robot. The rest is of one with wheels.

    ``steps_per_mm`` of both. ``x_wheel_mm``: how far left of the robot's centre the wheel is that rolls along x.
    ``y_wheel_mm``: how far in front of it the one that rolls along y is. ``reversed``: axes that count the other way.
    """

    chip: FlowChip
    steps_per_mm: float = 0.0
    x_wheel_mm: float = 0.0
    y_wheel_mm: float = 0.0
    reversed: tuple[str, ...] = ()


def parse_flow_chips(source: str, document: Mapping[str, Any]) -> dict[str, FlowChip]:
    """Return the sensors by name, in the order of the table; SchemaError if the table is wrong."""
    rows = take_table(source, FLOW_CHIPS, document.get(FLOW_CHIPS, {}))
    return {name: _chip(source, number, name, row) for number, (name, row) in enumerate(rows.items())}


def _chip(source: str, number: int, name: str, value: object) -> FlowChip:
    key = f"{FLOW_CHIPS}.{name}"
    if not _NAME.fullmatch(name):
        raise SchemaError(source, key, "names have a letter first, then A-Z a-z 0-9 -")
    row = take_table(source, key, value)
    refuse_unknown_keys(source, f"{key}.", row, ("doc", "driver", "address", "supply", "wheels"))
    doc, driver, supply = (take_text(source, f"{key}.{leaf}", row.get(leaf)) for leaf in ("doc", "driver", "supply"))
    if not _DRIVER.fullmatch(driver):
        raise SchemaError(
            source, f"{key}.driver", "is the name of a header in firmware/app/drivers, without .h: a-z 0-9 _"
        )
    address, wheels = row.get("address"), row.get("wheels", False)
    if type(address) is not int or not 0 < address <= _HIGHEST_ADDRESS:
        raise SchemaError(source, f"{key}.address", f"is {address!r}; an I2C address of 7 bit is needed")
    if not isinstance(wheels, bool):
        raise SchemaError(source, f"{key}.wheels", f"is {wheels!r}; true or false is needed")
    return FlowChip(number, name, doc, driver, address, supply, wheels)


def parse_flow(
    source: str, section: Mapping[str, Any] | None, parameters: Mapping[str, Any], chips: Mapping[str, FlowChip]
) -> FlowWiring | None:
    """Check the section ``flow``; None where a file has none.

    ``parameters``: the file's section of that name. ``chips``: those there are. Raises SchemaError.
    """
    if section is None:
        return None
    refuse_unknown_keys(source, "flow.", section, ("chip", *WHEEL_KEYS))
    if "chip" not in section:
        raise SchemaError(source, "flow.chip", f"is missing; give one of {', '.join(chips)}")
    name = take_chip(source, "flow.chip", section["chip"], chips)
    if MODE_PARAMETER in parameters:
        raise SchemaError(source, f"parameters.{MODE_PARAMETER}", "follows from the key flow.chip; remove it")
    chip = chips[name]
    if not chip.wheels:
        for key in WHEEL_KEYS:
            if key in section:
                raise SchemaError(source, f"flow.{key}", f"is not for this sensor: an {name} has no wheels; remove it")
        return FlowWiring(chip)
    return _with_wheels(source, section, chip)


def _with_wheels(source: str, section: Mapping[str, Any], chip: FlowChip) -> FlowWiring:
    if "steps_per_mm" not in section:
        problem = (
            "is missing: steps of a wheel's encoder per millimetre. goBILDA's 4-bar pod has 19.894, swingarm 13.263"
        )
        raise SchemaError(source, "flow.steps_per_mm", problem)
    steps = number_within(source, "flow.steps_per_mm", section["steps_per_mm"], 0.1, 1000.0)
    offsets = [
        number_within(source, f"flow.{key}", section.get(key, 0.0), -1000.0, 1000.0)
        for key in ("x_wheel_mm", "y_wheel_mm")
    ]
    given = section.get("reversed", [])
    if not isinstance(given, list) or any(axis not in AXES for axis in given) or len(set(given)) != len(given):
        raise SchemaError(source, "flow.reversed", f'is {given!r}; a list of "x" and "y" is needed, or []')
    return FlowWiring(chip, steps, offsets[0], offsets[1], tuple(given))


def flow_values(flow: FlowWiring) -> dict[str, float]:
    """Return the parameters that follow from the sensor."""
    return {MODE_PARAMETER: _WAY_AND_TURN}


def settings_bytes(flow: FlowWiring) -> bytes:
    """Return what a sensor with wheels is told at each start, as ``app/i2c_writes.h`` has it."""
    writes = [
        (_REG_STEPS, struct.pack("<f", flow.steps_per_mm)),
        (_REG_X_WHEEL, struct.pack("<f", flow.x_wheel_mm)),
        (_REG_Y_WHEEL, struct.pack("<f", flow.y_wheel_mm)),
    ]
    writes += [(_REG_CONTROL, struct.pack("<i", _DIRECTION[axis, axis in flow.reversed])) for axis in AXES]
    return b"".join(bytes([1 + len(value), register]) + value for register, value in writes) + b"\0"
