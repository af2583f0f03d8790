# SPDX-License-Identifier: MIT
"""The parameter table: what ``shared/params.toml`` says, checked and expanded to one entry per wheel or link."""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omni_schema.errors import SchemaError, did_you_mean
from omni_schema.flow import FLOW_CHIPS, FlowChip, parse_flow_chips
from omni_schema.gyro_chips import GYRO_CHIPS, GyroChip, parse_gyro_chips
from omni_schema.motor_drivers import MOTOR_DRIVERS, MotorDriver, parse_motor_drivers
from omni_schema.toml_file import (
    read_toml,
    refuse_unknown_keys,
    take_number,
    take_table,
    take_text,
)

MAX_WHEELS = 4
"""How many entries a ``per_wheel`` parameter expands to (the core's OMNI_MAX_WHEELS)."""

MAX_NAME_LENGTH = 16
"""MAVLink's PARAM_VALUE carries 16 characters."""

KINDS = ("real", "int", "bool", "enum")

STEP = "step"
EXPERIMENTS = (
    STEP,
    "trajectory",
    "wheel-step",
    "wheel-chirp",
    "position-step",
    "position-sweep",
    "disturbance",
)
"""The experiments of ``omni tune``; a parameter names the one that shows what it does."""

_NAME = re.compile(r"[A-Z][A-Z0-9_]*")
_VALUE_NAME = re.compile(r"[a-z][a-z0-9_]*")
RETIRED = "retired"
"""The key of ``params.toml`` that lists the names of parameters that are gone."""

_REQUIRED_KEYS = ("kind", "unit", "min", "max", "default", "doc")
_RANGE_KEYS = ("min", "max")
"""Not needed where ``values`` are given: these are the range then."""

_OPTIONAL_KEYS = ("values", "modules", "lock", "per_wheel", "robot_key", "experiment")
_EXACT_FLOAT32_INTEGER = 2**24


def storage_key(name: str) -> int:
    """Return the 16 bits that a stored value of this parameter carries: the low half of the CRC-32 of its name."""
    return zlib.crc32(name.encode("ascii")) & 0xFFFF


def as_float32(value: float) -> float:
    """Return the float32 nearest to ``value``, as a Python float: what the robot stores and the link carries."""
    (rounded,) = struct.unpack("<f", struct.pack("<f", value))
    return float(rounded)


@dataclass(frozen=True)
class Parameter:
    """One tunable of the robot.

    ``minimum``, ``maximum`` and ``default`` are in ``unit`` and rounded to float32, because the robot compares in
    float32. ``wheel`` is the 0-based wheel (or link) of a parameter that exists once per wheel, else None.
    ``experiment``: the one of EXPERIMENTS that shows what a change does. ``modules``: the values of an enum may be
    rows of a table in the core; these modules, each with a header, come with them.
    """

    index: int
    name: str
    kind: str
    unit: str
    minimum: float
    maximum: float
    default: float
    doc: str
    values: Mapping[str, int] = field(default_factory=dict)
    disarmed_only: bool = False
    robot_key: str | None = None
    wheel: int | None = None
    experiment: str = STEP
    modules: Mapping[str, str] = field(default_factory=dict)

    @property
    def storage_key(self) -> int:
        """What finds a stored value again, whatever the order of the table: see ``storage_key``."""
        return storage_key(self.name)

    @property
    def allowed(self) -> str:
        """What the parameter accepts, in words for an error message."""
        if self.values:
            return ", ".join(f"{name} ({number})" for name, number in self.values.items())
        if self.kind == "bool":
            return "0 or 1"
        word = "a whole number" if self.kind == "int" else "a number"
        unit = f" {self.unit}" if self.unit else ""
        return f"{word} from {self.shown(self.minimum)} to {self.shown(self.maximum)}{unit}"

    def shown(self, value: float) -> str:
        """Return a value as text; a whole number has all its digits."""
        return str(int(value)) if self.kind != "real" else f"{value:.7g}"

    def problem_with(self, value: float) -> str | None:
        """Say why ``value`` is not allowed, or None if it is."""
        if not math.isfinite(value) or not self.minimum <= value <= self.maximum:
            return f"is {value!r}; allowed is {self.allowed}"
        whole = float(value).is_integer()
        if self.kind != "real" and not whole:
            return f"is {value!r}; allowed is {self.allowed}"
        if self.kind == "enum" and int(value) not in self.values.values():
            return f"is {value!r}; allowed is {self.allowed}"
        return None

    def parse(self, source: str, key: str, value: object) -> float:
        """Turn a value from a file or a user (number, bool, or the name of an enum value) into the stored float32."""
        if self.kind == "bool" and isinstance(value, bool):
            return float(value)
        if isinstance(value, str):
            if value in self.values:
                return float(self.values[value])
            hint = did_you_mean(value, self.values)
            raise SchemaError(source, key, f"is {value!r}{hint}; allowed is {self.allowed}")
        number = take_number(source, key, value)
        number = as_float32(number) if abs(number) < 3e38 else number
        problem = self.problem_with(number)
        if problem is not None:
            raise SchemaError(source, key, problem)
        return number


@dataclass(frozen=True)
class ParameterTable(Mapping[str, Parameter]):
    """All parameters in wire order, looked up by name.

    ``crc`` is a CRC-32 over everything that decides whether two programs mean the same table. It changes with names,
    order, kinds, ranges, defaults and enum values, not with documentation. ``motor_drivers`` by name, in the order of
    their numbers. ``gyro_chips`` and ``flow_chips`` by name.
    """

    source: str
    schema_version: int
    parameters: tuple[Parameter, ...]
    crc: int
    motor_drivers: Mapping[str, MotorDriver] = field(default_factory=dict)
    gyro_chips: Mapping[str, GyroChip] = field(default_factory=dict)
    flow_chips: Mapping[str, FlowChip] = field(default_factory=dict)
    _by_name: Mapping[str, Parameter] = field(repr=False, compare=False, default_factory=dict)

    def __getitem__(self, name: str) -> Parameter:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self.parameters)

    def find(self, source: str, key: str, name: str) -> Parameter:
        """Return the parameter called ``name``, or raise a SchemaError about ``key`` of ``source``."""
        parameter = self._by_name.get(name)
        if parameter is None:
            guess = did_you_mean(name, self)
            raise SchemaError(
                source, key, f"there is no parameter {name}{guess}", hint="`omni robots show --params NAME` prints all"
            )
        return parameter

    def defaults(self) -> dict[str, float]:
        """Return every parameter's default by name."""
        return {parameter.name: parameter.default for parameter in self.parameters}


def load_parameters(path: Path | str) -> ParameterTable:
    """Read ``params.toml``; raise SchemaError if anything in it is wrong."""
    return parse_parameters(read_toml(Path(path)), str(path))


def parse_parameters(document: Mapping[str, Any], source: str) -> ParameterTable:
    """Build the table from a parsed document; ``source`` names it in errors.

    Raises SchemaError, also where a new name has the storage key of another one or of a retired one. A stored value of
    that one would be taken for a value of the new parameter.
    """
    version = document.get("schema_version")
    if isinstance(version, bool) or not isinstance(version, int) or not 0 < version < 2**31:
        raise SchemaError(source, "schema_version", f"is {version!r}; a whole number above 0 is needed")
    drivers = parse_motor_drivers(source, document)
    parameters: list[Parameter] = []
    for name, value in document.items():
        if name not in ("schema_version", RETIRED, MOTOR_DRIVERS, GYRO_CHIPS, FLOW_CHIPS):
            entry = take_table(source, name, value)
            if entry.get("values") == MOTOR_DRIVERS:
                entry = {**entry, "values": {driver.name: driver.number for driver in drivers.values()}}
            parameters += _expand(source, name, entry, len(parameters))
    by_name = {parameter.name: parameter for parameter in parameters}
    if len(by_name) != len(parameters):
        names = [parameter.name for parameter in parameters]
        twice = next(name for name in names if names.count(name) > 1)
        raise SchemaError(source, twice, "is defined twice once the per-wheel names are expanded")
    _refuse_same_storage_keys(source, _retired(source, document.get(RETIRED, [])), by_name)
    return ParameterTable(
        source,
        version,
        tuple(parameters),
        _crc(version, parameters),
        drivers,
        parse_gyro_chips(source, document),
        parse_flow_chips(source, document),
        by_name,
    )


def _retired(source: str, value: object) -> list[str]:
    if not isinstance(value, list) or not all(isinstance(name, str) and _NAME.fullmatch(name) for name in value):
        raise SchemaError(source, RETIRED, f"is {value!r}; a list of parameter names is needed")
    return [str(name) for name in value]


def _refuse_same_storage_keys(source: str, retired: Sequence[str], names: Iterable[str]) -> None:
    taken = {storage_key(name): name for name in retired}
    for name in names:
        other = taken.setdefault(storage_key(name), name)
        if other != name:
            raise SchemaError(source, name, f"has the storage key of {other}; choose another name")
        if name in retired:
            raise SchemaError(source, name, f"is listed under {RETIRED}; choose another name")


def _expand(source: str, name: str, entry: dict[str, Any], first_index: int) -> list[Parameter]:
    refuse_unknown_keys(source, f"{name}.", entry, (*_REQUIRED_KEYS, *_OPTIONAL_KEYS))
    for key in _REQUIRED_KEYS:
        if key not in entry and not (key in _RANGE_KEYS and "values" in entry):
            raise SchemaError(source, f"{name}.{key}", "is missing")
    per_wheel = entry.get("per_wheel", False)
    if not isinstance(per_wheel, bool) or per_wheel != ("{n}" in name):
        problem = f"is {per_wheel!r}; it must be true exactly where the name holds {{n}}"
        raise SchemaError(source, f"{name}.per_wheel", problem)
    wheels: list[int | None] = list(range(MAX_WHEELS)) if per_wheel else [None]
    return [_parameter(source, name, entry, first_index + offset, wheel) for offset, wheel in enumerate(wheels)]


def _parameter(source: str, template: str, entry: dict[str, Any], index: int, wheel: int | None) -> Parameter:
    name = template if wheel is None else template.replace("{n}", str(wheel + 1))
    if len(name) > MAX_NAME_LENGTH or not _NAME.fullmatch(name):
        raise SchemaError(source, template, f"gives the name {name}; at most {MAX_NAME_LENGTH} of A-Z 0-9 _")
    kind = take_text(source, f"{template}.kind", entry["kind"])
    if kind not in KINDS:
        hint = did_you_mean(kind, KINDS)
        raise SchemaError(source, f"{template}.kind", f"is {kind!r}{hint}; one of {', '.join(KINDS)}")
    lock = entry.get("lock")
    if lock not in (None, "disarmed"):
        raise SchemaError(source, f"{template}.lock", f'is {lock!r}; only "disarmed" is allowed')
    robot_key = entry.get("robot_key")
    values = _enum_values(source, template, kind, entry.get("values"))
    parameter = Parameter(
        index=index,
        name=name,
        kind=kind,
        unit=take_text(source, f"{template}.unit", entry["unit"]),
        minimum=_stored(source, f"{template}.min", entry["min"] if "min" in entry else min(values.values())),
        maximum=_stored(source, f"{template}.max", entry["max"] if "max" in entry else max(values.values())),
        default=_stored(source, f"{template}.default", entry["default"]),
        doc=_one_line(source, f"{template}.doc", entry["doc"]),
        values=values,
        disarmed_only=lock is not None,
        robot_key=None if robot_key is None else _robot_key(source, template, robot_key),
        wheel=wheel,
        experiment=_experiment(source, f"{template}.experiment", entry.get("experiment", STEP)),
        modules=_modules(source, f"{template}.modules", entry.get("modules"), values),
    )
    _check_range(source, template, parameter)
    return parameter


def _stored(source: str, key: str, value: object) -> float:
    number = take_number(source, key, value)
    if abs(number) > 3e38:
        raise SchemaError(source, key, f"is {value!r}; it does not fit a float32")
    return as_float32(number)


def _one_line(source: str, key: str, value: object) -> str:
    text = take_text(source, key, value)
    if not text.strip() or "\n" in text:
        raise SchemaError(source, key, f"is {text!r}; one line of documentation is needed")
    return text


def _experiment(source: str, key: str, value: object) -> str:
    text = take_text(source, key, value)
    if text not in EXPERIMENTS:
        raise SchemaError(source, key, f"is {text!r}; must be one of {', '.join(EXPERIMENTS)}")
    return text


def _robot_key(source: str, name: str, value: object) -> str:
    text = take_text(source, f"{name}.robot_key", value)
    if text.count(".") != 1:
        problem = f"is {text!r}; section.key is needed, like geometry.wheels"
        raise SchemaError(source, f"{name}.robot_key", problem)
    return text


def _enum_values(source: str, name: str, kind: str, values: object) -> dict[str, int]:
    key = f"{name}.values"
    if (kind == "enum") != (values is not None):
        raise SchemaError(source, key, 'is needed for kind = "enum" and for no other kind')
    if values is None:
        return {}
    table = take_table(source, key, values)
    for label, number in table.items():
        if not _VALUE_NAME.fullmatch(label):
            raise SchemaError(source, f"{key}.{label}", "names are lower case: a-z 0-9 _")
        if isinstance(number, bool) or not isinstance(number, int):
            raise SchemaError(source, f"{key}.{label}", f"is {number!r}; a whole number is needed")
    if not table:
        raise SchemaError(source, key, "is empty")
    if len(set(table.values())) != len(table):
        raise SchemaError(source, key, "has the same number twice")
    return dict(table)


def _modules(source: str, key: str, modules: object, values: Mapping[str, int]) -> dict[str, str]:
    if modules is None:
        return {}
    if not values:
        raise SchemaError(source, key, 'is only for kind = "enum"')
    table = take_table(source, key, modules)
    for name, header in table.items():
        if not _VALUE_NAME.fullmatch(name) or not isinstance(header, str) or not _VALUE_NAME.fullmatch(header):
            raise SchemaError(source, f"{key}.{name}", 'is a name and a header without ".h", of a-z 0-9 _')
    return dict(table)


def _check_range(source: str, template: str, parameter: Parameter) -> None:
    if parameter.minimum > parameter.maximum:
        raise SchemaError(source, f"{template}.min", "is above max")
    if parameter.kind == "bool" and (parameter.minimum, parameter.maximum) != (0.0, 1.0):
        raise SchemaError(source, f"{template}.max", "a bool has min = 0 and max = 1")
    if parameter.kind != "real":
        for key, value in (("min", parameter.minimum), ("max", parameter.maximum)):
            if not value.is_integer() or abs(value) > _EXACT_FLOAT32_INTEGER:
                problem = f"is {value!r}; a whole number that a float32 holds exactly is needed"
                raise SchemaError(source, f"{template}.{key}", problem)
    problem_or_none = parameter.problem_with(parameter.default)
    if problem_or_none is not None:
        raise SchemaError(source, f"{template}.default", problem_or_none)


def _crc(schema_version: int, parameters: list[Parameter]) -> int:
    lines = [f"schema {schema_version}"]
    for p in parameters:
        values = ",".join(f"{label}={number}" for label, number in p.values.items())
        numbers = ",".join(struct.pack("<f", x).hex() for x in (p.minimum, p.maximum, p.default))
        lines.append(f"{p.name}|{p.kind}|{p.unit}|{numbers}|{values}|{int(p.disarmed_only)}")
    return zlib.crc32("\n".join(lines).encode("utf-8"))
