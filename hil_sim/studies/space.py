# SPDX-License-Identifier: MIT
"""What is varied: axes of parameters and of the world's numbers, their points on a grid or a Sobol sequence."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np

from hil_sim.scenario import Scenario
from hil_sim.schema import WORLD_LISTS, WORLD_NUMBERS
from hil_sim.studies.errors import StudyInputError
from hil_sim.studies.plan import WORLD_PREFIX, Point
from omni_schema import Parameter, ParameterTable, SchemaError, as_float32
from omni_schema.errors import did_you_mean
from omniwheel.errors import MissingPackageError

DEFAULT_COUNT = 5
MAX_POINTS = 100_000
_SOURCE = "--param"
_FORM = "write NAME=LOW:HIGH, NAME=LOW:HIGH:COUNT or NAME=VALUE,VALUE,..."


@dataclass(frozen=True)
class Axis:
    """One quantity and its range, ends included. ``whole``: only whole numbers exist.

    ``values`` are the points on a grid. ``named`` says that they were given one by one, without a range;
    ``choices`` are the names of a choice's values.
    """

    name: str
    low: float
    high: float
    values: tuple[float, ...]
    whole: bool = False
    log: bool = False
    named: bool = False
    unit: str = ""
    choices: Mapping[float, str] = field(default_factory=dict)

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def show(self, value: float, digits: int = 6) -> str:
        """Return a value for people: a choice by its name."""
        return self.choices.get(value) or f"{value:.{digits}g}"

    @property
    def of_the_world(self) -> bool:
        """Whether it is a number of the world, not a parameter of the robot."""
        return self.name.startswith(WORLD_PREFIX)

    def at(self, share: float) -> float:
        """Return the value at a share 0..1 of the range, one that the robot can store."""
        if self.named:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        if self.whole:
            return self.low + min(math.floor(share * (self.high - self.low + 1.0)), self.high - self.low)
        value = self.low * (self.high / self.low) ** share if self.log else self.low + share * (self.high - self.low)
        return value if self.of_the_world else as_float32(value)


def parse_axis(word: str, table: ParameterTable) -> Axis:
    """Read ``NAME=LOW:HIGH``, ``NAME=LOW:HIGH:COUNT``, ``NAME=LOW:HIGH:log`` or ``NAME=VALUE,VALUE``.

    NAME is a parameter or ``world.`` and a number of the world. Raises StudyInputError.
    """
    try:
        return _parse(word, table)
    except SchemaError as error:
        raise StudyInputError(f"{error.key}: {error.problem}") from error


def _parse(word: str, table: ParameterTable) -> Axis:
    name, equals, text = word.partition("=")
    name = name.strip()
    if not equals or not name or not text.strip():
        raise StudyInputError(f"{word!r} is not a range", hint=_FORM)
    quantity = _quantity(name, table)
    if ":" not in text:
        values = tuple(quantity.parse(part.strip()) for part in text.split(","))
        if len(set(values)) < len(values):
            raise StudyInputError(f"{word!r} has a duplicate value", hint=_FORM)
        return quantity.axis(min(values), max(values), values, named=True)
    return _range(word, quantity, text.split(":"))


@dataclass(frozen=True)
class _Quantity:
    name: str
    parameter: Parameter | None

    def parse(self, text: str) -> float:
        try:
            given: float | str = float(text)
        except ValueError:
            given = text.lower()
        if self.parameter is not None:
            return self.parameter.parse(_SOURCE, self.name, given)
        number = WORLD_NUMBERS[self.name[len(WORLD_PREFIX) :]]
        if isinstance(given, str) or not number.holds(given):
            raise SchemaError(_SOURCE, self.name, f"is {text}; must be {number.allowed}")
        return given

    def axis(self, low: float, high: float, values: tuple[float, ...], **more: bool) -> Axis:
        whole = self.parameter is not None and self.parameter.kind != "real"
        unit = self.parameter.unit if self.parameter is not None else ""
        names = self.parameter.values if self.parameter is not None else {}
        choices = {float(number): name for name, number in names.items()}
        return Axis(self.name, low, high, values, whole=whole, unit=unit, choices=choices, **more)


def _quantity(name: str, table: ParameterTable) -> _Quantity:
    if name.startswith(WORLD_PREFIX):
        key = name[len(WORLD_PREFIX) :]
        if key in WORLD_LISTS:
            hint = "write it into the scenario's [world], as a list or as one number for all wheels"
            raise StudyInputError(f"{key} has one number per wheel; --set and --param cannot change it", hint=hint)
        if key not in WORLD_NUMBERS:
            hint = f"the world has {', '.join(WORLD_NUMBERS)}"
            raise StudyInputError(f"unknown number of the world {key}{did_you_mean(key, WORLD_NUMBERS)}", hint=hint)
        return _Quantity(name, None)
    parameter = table.get(name.upper())
    if parameter is None:
        of_the_world = name.lower() in map(str.lower, WORLD_NUMBERS)
        guess = did_you_mean(WORLD_PREFIX + name, map(WORLD_PREFIX.__add__, WORLD_NUMBERS) if of_the_world else ())
        guess = guess or did_you_mean(name, table)
        hint = f"`omni robots show --params NAME` prints all; a number of the world begins with {WORLD_PREFIX}"
        raise StudyInputError(f"unknown parameter {name}{guess}", hint=hint)
    return _Quantity(name.upper(), parameter)


def _range(word: str, quantity: _Quantity, parts: Sequence[str]) -> Axis:
    if len(parts) not in (2, 3) or not all(part.strip() for part in parts):
        raise StudyInputError(f"{word!r} is not a range", hint=_FORM)
    if quantity.parameter is not None and quantity.parameter.kind in ("enum", "bool"):
        raise StudyInputError(
            f"{quantity.name} is a choice, not a range", hint=f"write {quantity.name}=VALUE,VALUE,..."
        )
    low, high = quantity.parse(parts[0].strip()), quantity.parse(parts[1].strip())
    log = len(parts) == 3 and parts[2].strip() == "log"
    if low >= high:
        raise StudyInputError(f"{word!r}: {low:g} is not below {high:g}", hint=_FORM)
    if log and low <= 0.0:
        raise StudyInputError(f"{word!r}: a logarithmic range starts above 0")
    count = DEFAULT_COUNT if log or len(parts) == 2 else _count(word, parts[2])
    empty = quantity.axis(low, high, (), log=log)
    shares = [number / (count - 1) for number in range(count)]
    values = [round(low + share * (high - low)) if empty.whole else empty.at(share) for share in shares]
    return quantity.axis(low, high, tuple(dict.fromkeys(float(value) for value in values)), log=log)


def _count(word: str, text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if not 2 <= count <= MAX_POINTS:
        raise StudyInputError(f"{word!r}: {text} is not a number of points from 2 to {MAX_POINTS}", hint=_FORM)
    return count


def parse_axes(words: Sequence[str], table: ParameterTable) -> list[Axis]:
    """Read all axes; StudyInputError if there is none or one twice."""
    axes = [parse_axis(word, table) for word in words]
    found = [axis.name for axis in axes]
    if not axes:
        raise StudyInputError("no parameter is varied", hint="give --param NAME=LOW:HIGH at least once")
    if len(set(found)) < len(found):
        raise StudyInputError(f"{next(name for name in found if found.count(name) > 1)} is given twice")
    return axes


def grid(axes: Sequence[Axis], scenario: Scenario) -> list[Point]:
    """Return every combination of the axes' values, the last axis fastest."""
    count = math.prod(len(axis.values) for axis in axes)
    if count > MAX_POINTS:
        raise StudyInputError(f"a grid of {count} points is too large; at most {MAX_POINTS}", hint="try --sobol N")
    combinations = itertools.product(*(axis.values for axis in axes))
    return [_point(scenario, axes, values) for values in combinations]


def sobol(axes: Sequence[Axis], scenario: Scenario, count: int, seed: int) -> list[Point]:
    """Return the first ``count`` points of a scrambled Sobol sequence, which fills the ranges evenly.

    Raises MissingPackageError without SciPy.
    """
    try:
        qmc: Any = import_module("scipy.stats.qmc")
    except ImportError as error:
        hint = "pip install 'omniwheel[study]', or in a clone: make setup"
        raise MissingPackageError("--sobol needs SciPy, which is not installed", hint=hint) from error
    if not 1 <= count <= MAX_POINTS:
        raise StudyInputError(f"{count} points; must be 1 to {MAX_POINTS}")
    engine = qmc.Sobol(len(axes), scramble=True, seed=np.random.default_rng(seed))
    shares = engine.random_base2(math.ceil(math.log2(count)) if count > 1 else 0)[:count]
    return [
        _point(scenario, axes, [axis.at(float(share)) for axis, share in zip(axes, row, strict=True)]) for row in shares
    ]


def _point(scenario: Scenario, axes: Sequence[Axis], values: Sequence[float]) -> Point:
    return Point(scenario, {axis.name: float(value) for axis, value in zip(axes, values, strict=True)})
