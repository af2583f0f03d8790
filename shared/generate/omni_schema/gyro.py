# SPDX-License-Identifier: MIT
"""The section ``gyro`` of a robot file: which chip there is, and which of its axes points up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.toml_file import refuse_unknown_keys

CHIPS = ("ICM-42688-P",)
"""Chips that the firmware has a driver for."""
ADDRESSES = (0x68, 0x69)
"""I2C addresses of such a chip: AD0 to ground, AD0 to its supply."""
AXES = (1, 2, 3, -1, -2, -3)
AXIS_PARAMETER = "GYRO_AXIS"
SDA_PIN, SCL_PIN = 17, 16
"""Pins of the Teensy's second bus, which is the gyro's alone."""
PIN_USERS = {SDA_PIN: "the gyro's I2C (SDA)", SCL_PIN: "the gyro's I2C (SCL)"}
KEYS = ("chip", "axis", "address")


@dataclass(frozen=True)
class GyroWiring:
    """A gyro's chip. ``axis``: 1 x, 2 y, 3 z points up; negative: down. ``address``: 7 bit."""

    chip: str
    axis: int
    address: int


def parse_gyro(source: str, section: Mapping[str, Any] | None, parameters: Mapping[str, Any]) -> GyroWiring | None:
    """Check the section ``gyro``; None where a file has none.

    ``parameters``: the file's section of that name. Raises SchemaError.
    """
    if section is None:
        return None
    refuse_unknown_keys(source, "gyro.", section, KEYS)
    for key in ("chip", "axis"):
        if key not in section:
            problem = "is missing; " + (f"give one of {', '.join(CHIPS)}" if key == "chip" else _axis_wanted())
            raise SchemaError(source, f"gyro.{key}", problem)
    chip, axis, address = section["chip"], section["axis"], section.get("address", ADDRESSES[0])
    if chip not in CHIPS:
        problem = f"is {chip!r}{did_you_mean(str(chip), CHIPS)}; the firmware has drivers for {', '.join(CHIPS)}"
        raise SchemaError(source, "gyro.chip", problem)
    if type(axis) is not int or axis not in AXES:
        raise SchemaError(source, "gyro.axis", f"is {axis!r}; {_axis_wanted()}")
    if type(address) is not int or address not in ADDRESSES:
        problem = f"is {address!r}; 0x68 (AD0 to ground) or 0x69 (AD0 to 3.3 V) is needed"
        raise SchemaError(source, "gyro.address", problem)
    if AXIS_PARAMETER in parameters:
        raise SchemaError(source, f"parameters.{AXIS_PARAMETER}", "is set by the key gyro.axis; give the number there")
    return GyroWiring(chip, axis, address)


def _axis_wanted() -> str:
    return "give the axis that points up: 1 x, 2 y, 3 z; negative if it points down"
