# SPDX-License-Identifier: MIT
"""The simulated world's schema: what ``shared/world.toml`` says about its numbers, plants and faults, checked."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.readings import Reading, parse_reading, refuse_equal_names
from omni_schema.toml_file import read_toml, refuse_unknown_keys, take_number, take_table, take_text

KINDS = ("real", "int", "bool")
ABOVE_ZERO = "above 0"
"""What ``min`` says where 0 itself is not allowed."""

SECTIONS = ("schema_version", "numbers", "plants", "sensors", "faults")
_NUMBER_KEYS = ("kind", "unit", "min", "max", "doc")
_FLAGS = ("deciding", "robot_only", "fixed")
_OPTIONAL_KEYS = ("default", "robot_key", "each", "elements", "field", *_FLAGS)
_FAULT_KEYS = ("wheel", "value", "doc")
_VALUE_KEYS = ("unit", "min", "max", "default")
_FIELD = re.compile(r"[a-z][a-zA-Z0-9_]*")
_PLANT = re.compile(r"[a-z][a-z0-9]*(?:[_+][a-z0-9]+)*")
_WORD = re.compile(r"[a-z][a-z0-9_]*")

Row = TypeVar("Row")


@dataclass(frozen=True)
class Range:
    """What a number may be. ``minimum`` and ``maximum`` are allowed themselves; ``kind`` is one of KINDS."""

    kind: str
    unit: str
    minimum: float
    maximum: float

    @property
    def allowed(self) -> str:
        """What is accepted, in words for an error message."""
        if self.kind == "bool":
            return "0 or 1"
        word = "a whole number" if self.kind == "int" else "a number"
        unit = f" {self.unit}" if self.unit else ""
        if self.minimum == sys.float_info.min:
            return f"{word} above 0, at most {self.maximum:.10g}{unit}"
        return f"{word} from {self.minimum:.10g} to {self.maximum:.10g}{unit}"

    def holds(self, value: float) -> bool:
        """Return whether a value is accepted; NaN is not."""
        return self.minimum <= value <= self.maximum and (self.kind == "real" or float(value).is_integer())

    def parse(self, source: str, key: str, value: object) -> float:
        """Return a value from a file or a user as a number. Raises SchemaError that names key, range and unit."""
        if self.kind == "bool" and isinstance(value, bool):
            return float(value)
        number = take_number(source, key, value)
        if not self.holds(number):
            raise SchemaError(source, key, f"is {number:g}; allowed is {self.allowed}")
        return number


@dataclass(frozen=True)
class Quantity(Range):
    """One number of the world, or a list of them.

    ``per_wheel``: one number per wheel. ``elements``: the names of the numbers of a list, empty where it is one number.
    ``default`` is None where the robot file's ``robot_key`` has to give it. ``field`` is the member of
    ``hil_world_config_t``. The flags are those of ``world.toml``.
    """

    name: str
    field: str
    doc: str
    default: float | tuple[float, ...] | None
    robot_key: str | None
    per_wheel: bool
    elements: tuple[str, ...]
    deciding: bool
    robot_only: bool
    fixed: bool

    @property
    def in_scenario(self) -> bool:
        """Whether it may stand in a scenario's [world] as one number."""
        return not (self.robot_only or self.per_wheel or self.elements)

    @property
    def list_in_scenario(self) -> bool:
        """Whether it may stand in a scenario's [world] as one number per wheel."""
        return self.per_wheel and not self.robot_only

    @property
    def varies(self) -> bool:
        """Whether [dispersion] may make it differ from run to run."""
        return self.kind == "real" and not self.fixed


@dataclass(frozen=True)
class Plant:
    """What can stand in for the robot, by its number in ``hil_plant_kind_t``."""

    number: int
    name: str
    doc: str

    @property
    def symbol(self) -> str:
        """The name as C and file names have it."""
        return self.name.replace("+", "_")


@dataclass(frozen=True)
class Sensor:
    """What the robot's electronics measure. ``reading``: how it reaches the robot, None for a way of its own."""

    name: str
    doc: str
    reading: Reading | None


@dataclass(frozen=True)
class FaultKind:
    """What can break, by its number in ``hil_fault_kind_t``.

    ``wheel``: it concerns one wheel. ``value``: what its number may be, None where it has none; ``default`` is that
    number where nobody gives one, None where it is needed.
    """

    number: int
    name: str
    doc: str
    wheel: bool
    value: Range | None
    default: float | None


@dataclass(frozen=True)
class WorldSchema:
    """Everything that ``world.toml`` says, by name and in its order."""

    source: str
    numbers: Mapping[str, Quantity]
    plants: Mapping[str, Plant]
    sensors: Mapping[str, Sensor]
    faults: Mapping[str, FaultKind]

    @property
    def readings(self) -> tuple[Reading, ...]:
        """What sensors tell the robot in each tick, in the order of their rows."""
        return tuple(sensor.reading for sensor in self.sensors.values() if sensor.reading is not None)


def load_world(path: Path | str) -> WorldSchema:
    """Read ``world.toml``; raise SchemaError if anything in it is wrong."""
    return parse_world(read_toml(Path(path)), str(path))


def parse_world(document: Mapping[str, Any], source: str) -> WorldSchema:
    """Build the schema from a parsed document; ``source`` names it in errors."""
    refuse_unknown_keys(source, "", document, SECTIONS)
    numbers = _rows(source, "numbers", document, _FIELD, lambda _, name, row: _quantity(source, name, row))
    plants = _rows(source, "plants", document, _PLANT, lambda number, name, row: _plant(source, number, name, row))
    faults = _rows(source, "faults", document, _WORD, lambda number, name, row: _fault(source, number, name, row))
    sensors = _rows(source, "sensors", document, _WORD, lambda _, name, row: _sensor(source, name, row))
    world = WorldSchema(source, numbers, plants, sensors, faults)
    refuse_equal_names(source, world.readings)
    return world


def _rows(
    source: str,
    section: str,
    document: Mapping[str, Any],
    names: re.Pattern[str],
    build: Callable[[int, str, dict[str, Any]], Row],
) -> dict[str, Row]:
    table = take_table(source, section, document.get(section, {}))
    if not table:
        raise SchemaError(source, section, "has no rows")
    for name in table:
        if not names.fullmatch(name):
            raise SchemaError(source, f"{section}.{name}", f"is no name; it must match {names.pattern}")
    return {
        name: build(number, name, take_table(source, f"{section}.{name}", row))
        for number, (name, row) in enumerate(table.items())
    }


def _quantity(source: str, name: str, row: dict[str, Any]) -> Quantity:
    key = f"numbers.{name}"
    refuse_unknown_keys(source, f"{key}.", row, (*_NUMBER_KEYS, *_OPTIONAL_KEYS))
    for needed in _NUMBER_KEYS:
        if needed not in row:
            raise SchemaError(source, f"{key}.{needed}", "is missing")
    kind = take_text(source, f"{key}.kind", row["kind"])
    if kind not in KINDS:
        raise SchemaError(source, f"{key}.kind", f"is {kind!r}{did_you_mean(kind, KINDS)}; one of {', '.join(KINDS)}")
    each = row.get("each")
    if each not in (None, "wheel"):
        raise SchemaError(source, f"{key}.each", f'is {each!r}; only "wheel" is allowed')
    robot_key = row.get("robot_key")
    flags: dict[str, Any] = {flag: _flag(source, f"{key}.{flag}", row.get(flag, False)) for flag in _FLAGS}
    quantity = Quantity(
        **_range(source, key, kind, row),
        name=name,
        field=take_text(source, f"{key}.field", row.get("field", name)),
        doc=take_text(source, f"{key}.doc", row["doc"]),
        default=_default(source, key, row.get("default")),
        robot_key=None if robot_key is None else take_text(source, f"{key}.robot_key", robot_key),
        per_wheel=each is not None,
        elements=_elements(source, key, row.get("elements", [])),
        **flags,
    )
    _check_default(source, key, quantity)
    return quantity


def _range(source: str, key: str, kind: str, row: Mapping[str, Any]) -> dict[str, Any]:
    least = row["min"]
    minimum = sys.float_info.min if least == ABOVE_ZERO else take_number(source, f"{key}.min", least)
    maximum = take_number(source, f"{key}.max", row["max"])
    if minimum > maximum:
        raise SchemaError(source, f"{key}.min", "is above max")
    if kind == "bool" and (minimum, maximum) != (0.0, 1.0):
        raise SchemaError(source, f"{key}.max", "a bool has min = 0 and max = 1")
    unit = take_text(source, f"{key}.unit", row["unit"])
    return {"kind": kind, "unit": unit, "minimum": minimum, "maximum": maximum}


def _default(source: str, key: str, value: object) -> float | tuple[float, ...] | None:
    if value is None:
        return None
    if isinstance(value, list):
        return tuple(take_number(source, f"{key}.default[{i + 1}]", item) for i, item in enumerate(value))
    return take_number(source, f"{key}.default", value)


def _elements(source: str, key: str, value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or len(value) not in (0, 3):
        raise SchemaError(source, f"{key}.elements", f"is {value!r}; a list of three names is needed")
    return tuple(take_text(source, f"{key}.elements[{i + 1}]", item) for i, item in enumerate(value))


def _flag(source: str, key: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise SchemaError(source, key, f"is {value!r}; must be true or false")
    return value


def _check_default(source: str, key: str, quantity: Quantity) -> None:
    default = quantity.default
    if default is None:
        if quantity.robot_key is None:
            raise SchemaError(source, f"{key}.default", "is missing, and no robot_key gives the number")
        return
    numbers = default if isinstance(default, tuple) else (default,)
    if len(numbers) != max(len(quantity.elements), 1) or isinstance(default, tuple) != bool(quantity.elements):
        raise SchemaError(source, f"{key}.default", "is needed as one number, or as a list of as many as elements")
    for number in numbers:
        quantity.parse(source, f"{key}.default", number)


def _plant(source: str, number: int, name: str, row: dict[str, Any]) -> Plant:
    refuse_unknown_keys(source, f"plants.{name}.", row, ("doc",))
    return Plant(number, name, take_text(source, f"plants.{name}.doc", row.get("doc")))


def _sensor(source: str, name: str, row: dict[str, Any]) -> Sensor:
    doc = take_text(source, f"sensors.{name}.doc", row.get("doc"))
    return Sensor(name, doc, parse_reading(source, name, row, doc))


def _fault(source: str, number: int, name: str, row: dict[str, Any]) -> FaultKind:
    key = f"faults.{name}"
    refuse_unknown_keys(source, f"{key}.", row, _FAULT_KEYS)
    doc = take_text(source, f"{key}.doc", row.get("doc"))
    wheel = _flag(source, f"{key}.wheel", row.get("wheel", False))
    if "value" not in row:
        return FaultKind(number + 1, name, doc, wheel, None, 0.0)
    value = take_table(source, f"{key}.value", row["value"])
    refuse_unknown_keys(source, f"{key}.value.", value, _VALUE_KEYS)
    for needed in ("unit", "min", "max"):
        if needed not in value:
            raise SchemaError(source, f"{key}.value.{needed}", "is missing")
    default = value.get("default")
    allowed = Range(**_range(source, f"{key}.value", "real", value))
    given = None if default is None else allowed.parse(source, f"{key}.value.default", default)
    return FaultKind(number + 1, name, doc, wheel, allowed, given)
