# SPDX-License-Identifier: MIT
"""The section ``gyro`` of a robot file: which chip there is, and which of its axes points up."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError
from omni_schema.gyro_chips import GyroChip
from omni_schema.gyro_configuration import CONFIG_FILE_KEY, SHA_KEY, WHERE
from omni_schema.toml_file import refuse_unknown_keys, take_chip, take_text

AXES = (1, 2, 3, -1, -2, -3)
AXIS_PARAMETER = "GYRO_AXIS"
SDA_PIN, SCL_PIN = 17, 16
"""Pins of the Teensy's second bus, which is the gyro's alone."""
PIN_USERS = {SDA_PIN: "the gyro's I2C (SDA)", SCL_PIN: "the gyro's I2C (SCL)"}
KEYS = ("chip", "axis", "address", "config_file", "config_sha256")

_SHA256 = re.compile(r"[0-9a-fA-F]{64}")


@dataclass(frozen=True)
class GyroWiring:
    """A gyro's chip. ``axis``: 1 x, 2 y, 3 z points up; negative: down. ``address``: 7 bit.

    ``config_file`` and ``config_sha256``: of a chip that needs one; else "".
    """

    chip: GyroChip
    axis: int
    address: int
    config_file: str = ""
    config_sha256: str = ""


def parse_gyro(
    source: str, section: Mapping[str, Any] | None, parameters: Mapping[str, Any], chips: Mapping[str, GyroChip]
) -> GyroWiring | None:
    """Check the section ``gyro``; None where a file has none.

    ``parameters``: the file's section of that name. ``chips``: those there are. Raises SchemaError.
    """
    if section is None:
        return None
    refuse_unknown_keys(source, "gyro.", section, KEYS)
    for key in ("chip", "axis"):
        if key not in section:
            problem = "is missing; " + (f"give one of {', '.join(chips)}" if key == "chip" else _axis_wanted())
            raise SchemaError(source, f"gyro.{key}", problem)
    axis, chip = section["axis"], chips[take_chip(source, "gyro.chip", section["chip"], chips)]
    if type(axis) is not int or axis not in AXES:
        raise SchemaError(source, "gyro.axis", f"is {axis!r}; {_axis_wanted()}")
    if AXIS_PARAMETER in parameters:
        raise SchemaError(source, f"parameters.{AXIS_PARAMETER}", "is set by the key gyro.axis; give the number there")
    return GyroWiring(chip, axis, _address(source, section, chip), *_configuration(source, section, chip))


def _address(source: str, section: Mapping[str, Any], chip: GyroChip) -> int:
    low, high = chip.addresses
    address = section.get("address", low)
    if type(address) is not int or address not in chip.addresses:
        pin = chip.address_pin
        problem = f"is {address!r}; 0x{low:02X} ({pin} to ground) or 0x{high:02X} ({pin} to 3.3 V) is needed"
        raise SchemaError(source, "gyro.address", problem)
    return address


def _configuration(source: str, section: Mapping[str, Any], chip: GyroChip) -> tuple[str, str]:
    keys = ("config_file", "config_sha256")
    if not chip.config_file:
        for key in keys:
            if key in section:
                raise SchemaError(source, f"gyro.{key}", f"is not for this chip: a {chip.name} needs none; remove it")
        return "", ""
    if "config_file" not in section:
        problem = f"is missing: a {chip.name} measures nothing without its maker's configuration file. {WHERE}"
        raise SchemaError(source, CONFIG_FILE_KEY, problem)
    file, digest = (take_text(source, f"gyro.{key}", section.get(key, "")) for key in keys)
    if digest and not _SHA256.fullmatch(digest):
        raise SchemaError(source, SHA_KEY, f"is {digest!r}; the SHA-256 of the bytes is needed, 64 hexadecimal digits")
    return file, digest


def gyro_values(gyro: GyroWiring) -> dict[str, float]:
    """Return the parameters that follow from the chip and how it is mounted; a robot file may set all but the axis."""
    return {
        AXIS_PARAMETER: float(gyro.axis),
        "GYRO_ND": math.radians(gyro.chip.noise_dps),
        "GYRO_BRW": gyro.chip.bias_walk,
        "GYRO_S_SD": gyro.chip.scale_error,
    }


def _axis_wanted() -> str:
    return "give the axis that points up: 1 x, 2 y, 3 z; negative if it points down"
