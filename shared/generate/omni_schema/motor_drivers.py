# SPDX-License-Identifier: MIT
"""The table of motor drivers in ``params.toml``: what can lead from the processor to the motors."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.toml_file import refuse_unknown_keys, take_table, take_text

MOTOR_DRIVERS = "motor_drivers"
"""The key of the table in ``params.toml``, and what a parameter whose values they are says."""

BRIDGE = {"coast": 0b00, "forward": 0b01, "backward": 0b10, "brake": 0b11}
"""What a bridge can do, as the levels of IN1 (bit 0) and IN2 (bit 1) that make one with these inputs do it."""

LEVELS = ("low", "first", "second", "both")
"""The keys for a bridge: which of its two pins are high."""

_NAME = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
_KEYS = ("doc", "pins", "pwm", *LEVELS)


@dataclass(frozen=True)
class MotorDriver:
    """One kind of motor driver, by its number: the value of ``MOT_DRIVER``.

    On the processor's own pins, ``pins`` are the names of a wheel's two, and ``pwm`` says which of them need PWM.
    ``bridge`` is what the bridge does at each of LEVELS. A chip on the I2C bus has none of these.
    """

    number: int
    name: str
    doc: str
    pins: tuple[str, ...] = ()
    pwm: tuple[bool, ...] = (False, False)
    bridge: tuple[str, ...] = ("coast",) * len(LEVELS)

    @property
    def class_name(self) -> str:
        """The class in ``firmware/app/drivers/NAME.h``."""
        return "".join(part.capitalize() for part in self.name.split("_"))


def parse_motor_drivers(source: str, document: Mapping[str, Any]) -> dict[str, MotorDriver]:
    """Return the drivers by name, in the order of their numbers; SchemaError if the table is wrong."""
    rows = take_table(source, MOTOR_DRIVERS, document.get(MOTOR_DRIVERS, {}))
    return {name: _driver(source, number, name, row) for number, (name, row) in enumerate(rows.items())}


def _driver(source: str, number: int, name: str, value: object) -> MotorDriver:
    key = f"{MOTOR_DRIVERS}.{name}"
    if not _NAME.fullmatch(name):
        raise SchemaError(source, key, "names are lower case: a-z 0-9, words joined by _")
    row = take_table(source, key, value)
    refuse_unknown_keys(source, f"{key}.", row, _KEYS)
    doc = take_text(source, f"{key}.doc", row.get("doc"))
    if "pins" not in row:
        for leaf in _KEYS[2:]:
            if leaf in row:
                raise SchemaError(source, f"{key}.{leaf}", "is given without pins; name them, or remove it")
        return MotorDriver(number, name, doc)
    pins = _two(source, f"{key}.pins", row["pins"], str, "the names of two pins are needed")
    pwm = _two(source, f"{key}.pwm", row.get("pwm"), bool, "true or false is needed for each of the two pins")
    bridge = tuple(_action(source, f"{key}.{level}", row.get(level)) for level in LEVELS)
    if bridge[0] not in ("coast", "brake"):
        problem = f"is {bridge[0]!r}; with both pins low, as after any stop, a bridge must coast or brake"
        raise SchemaError(source, f"{key}.{LEVELS[0]}", problem)
    return MotorDriver(number, name, doc, pins, pwm, bridge)


def _two(source: str, key: str, value: object, kind: type, needed: str) -> tuple[Any, ...]:
    if not isinstance(value, list) or len(value) != 2 or not all(type(item) is kind for item in value):
        raise SchemaError(source, key, f"is {value!r}; {needed}")
    return tuple(value)


def _action(source: str, key: str, value: object) -> str:
    if value is None:
        raise SchemaError(source, key, f"is missing; say what the bridge does then: {', '.join(BRIDGE)}")
    action = take_text(source, key, value)
    if action not in BRIDGE:
        raise SchemaError(source, key, f"is {action!r}{did_you_mean(action, BRIDGE)}; one of {', '.join(BRIDGE)}")
    return action


__all__ = ["BRIDGE", "LEVELS", "MOTOR_DRIVERS", "MotorDriver", "parse_motor_drivers"]
