# SPDX-License-Identifier: MIT
"""The table of gyro chips in ``params.toml``: what the firmware has drivers for, and what their data sheets say."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError
from omni_schema.toml_file import number_within, refuse_unknown_keys, take_table, take_text

GYRO_CHIPS = "gyro_chips"
"""The key of the table in ``params.toml``."""

_NAME = re.compile(r"[A-Z][A-Z0-9-]*")
_DRIVER = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_HIGHEST_ADDRESS = 0x77
_NUMBERS = {
    "range_dps": (100.0, 10000.0),
    "noise_dps": (1e-5, 1.0),
    "bias_walk": (0.0, 0.01),
    "offset_dps": (0.0, 20.0),
    "scale_error": (0.0, 0.1),
    "delay_ms": (0.0, 20.0),
}
_KEYS = ("doc", "driver", "address_pin", "select", "supply", "addresses", "config_file", *_NUMBERS)


@dataclass(frozen=True)
class GyroChip:
    """A chip. ``driver``: the header in ``firmware/app/drivers`` and the namespace in it.

    ``number``: its place in the table.

    ``addresses``: of the bus, with ``address_pin`` at ground and at 3.3 V. ``select``: the pin that must be high, so
    that the chip speaks I2C. ``supply``: its supply pins. ``noise_dps`` per root of a Hz, ``offset_dps`` as the data
    sheet has them, ``bias_walk`` [rad/s^1.5]. ``delay_ms``: of its filters as the driver sets them.
    ``config_file``: the robot file must name one.
    """

    number: int
    name: str
    doc: str
    driver: str
    addresses: tuple[int, int]
    address_pin: str
    select: str
    supply: str
    range_dps: float
    noise_dps: float
    bias_walk: float
    offset_dps: float
    scale_error: float
    delay_ms: float
    config_file: bool = False


def parse_gyro_chips(source: str, document: Mapping[str, Any]) -> dict[str, GyroChip]:
    """Return the chips by name, in the order of the table; SchemaError if the table is wrong."""
    rows = take_table(source, GYRO_CHIPS, document.get(GYRO_CHIPS, {}))
    return {name: _chip(source, number, name, row) for number, (name, row) in enumerate(rows.items())}


def _chip(source: str, number: int, name: str, value: object) -> GyroChip:
    key = f"{GYRO_CHIPS}.{name}"
    if not _NAME.fullmatch(name):
        raise SchemaError(source, key, "names are those of the data sheets: A-Z 0-9 -")
    row = take_table(source, key, value)
    refuse_unknown_keys(source, f"{key}.", row, _KEYS)
    texts: dict[str, Any] = {
        leaf: take_text(source, f"{key}.{leaf}", row.get(leaf))
        for leaf in ("doc", "driver", "address_pin", "select", "supply")
    }
    if not _DRIVER.fullmatch(texts["driver"]):
        raise SchemaError(
            source, f"{key}.driver", "is the name of a header in firmware/app/drivers, without .h: a-z 0-9 _"
        )
    numbers: dict[str, Any] = {
        leaf: number_within(source, f"{key}.{leaf}", row.get(leaf), low, high) for leaf, (low, high) in _NUMBERS.items()
    }
    config_file = row.get("config_file", False)
    if not isinstance(config_file, bool):
        raise SchemaError(source, f"{key}.config_file", f"is {config_file!r}; true or false is needed")
    return GyroChip(number, name, **texts, addresses=_addresses(source, key, row), **numbers, config_file=config_file)


def _addresses(source: str, key: str, row: Mapping[str, Any]) -> tuple[int, int]:
    given = row.get("addresses")
    whole = isinstance(given, list) and len(given) == 2 and all(type(one) is int for one in given)
    if not whole or not all(0 < one <= _HIGHEST_ADDRESS for one in given or []):
        problem = f"is {given!r}; two I2C addresses are needed: address pin at ground, at 3.3 V"
        raise SchemaError(source, f"{key}.addresses", problem)
    low, high = given or []
    return low, high


__all__ = ["GYRO_CHIPS", "GyroChip", "parse_gyro_chips"]
