# SPDX-License-Identifier: MIT
"""Every number that a robot's telemetry holds, as a signal with a name, a unit and a sentence.

The list comes from the classes of :mod:`omniwheel.telemetry`. A new field there is a new signal here.
"""

from __future__ import annotations

import ast
import dataclasses
import difflib
import inspect
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, get_args, get_origin, get_type_hints

from omni.studio.bounds import limit_of
from omniwheel.errors import OmniError
from omniwheel.frames import Pose, Twist
from omniwheel.telemetry import (
    Battery,
    Control,
    Fix,
    FlowState,
    GyroState,
    Health,
    Status,
    Telemetry,
    Tracking,
    Wheels,
)

KINDS: tuple[type[Telemetry], ...] = (Tracking, Wheels, Control, Fix, GyroState, FlowState, Battery, Status, Health)
"""In the order in which a page lists them."""
_UNIT_ENDINGS = ("_rad_s", "_m_s", "_us_mean", "_us_max", "_us", "_V", "_A", "_s")
_LEFT_OUT = ("_rad_s", "_m_s", "_rad", "_m", "_V", "_A", "_s")
_AXES = ("x", "y", "theta")
MOST_WHEELS = 4
_LONGEST_QUOTE = 80


class UnknownSignalError(OmniError):
    """A key that no signal can have."""


@dataclass(frozen=True)
class Signal:
    """One number of telemetry.

    ``key`` is unique, like ``wheels.speed.2``. ``column`` is its place in :func:`values` of its class.
    """

    key: str
    group: str
    label: str
    unit: str
    doc: str
    kind: type[Telemetry]
    column: int


def values(telemetry: Telemetry) -> list[float]:
    """Return the numbers of a message in the order of its signals."""
    return [float(part) for part in parts_of(telemetry)]


def parts_of(telemetry: Telemetry) -> list[Any]:
    """Return what a message holds in the order of its signals, as it is: arrays if it was decoded from arrays."""
    found: list[Any] = []
    for name, parts in _fields(type(telemetry)):
        value: Any = getattr(telemetry, name)
        found.extend(value if parts else [value])
    return found


@cache
def signals_of(kind: type[Telemetry]) -> tuple[Signal, ...]:
    """Return the signals of one class of telemetry."""
    group = kind.__name__.lower().removesuffix("state")
    docs = _attribute_docs(kind)
    found: list[Signal] = []
    for name, parts in _fields(kind):
        doc = docs.get(name, "")
        units = _units(doc, name)
        plain = _without_unit(name)
        for number, part in enumerate(parts or ("",)):
            unit = units[number] if number < len(units) else units[-1]
            words = plain.replace("_", " ")
            label = f"{words} {part}" if part else words
            key = f"{group}.{plain}.{part}" if part else f"{group}.{plain}"
            found.append(Signal(key, group, label, unit, doc, kind, len(found)))
    return tuple(found)


def all_signals(wheels: int, without: Collection[type[Telemetry]] = ()) -> list[Signal]:
    """Return every signal that a robot with so many wheels has, ``without`` what it never sends."""
    beyond = [f".{number}" for number in range(wheels + 1, 5)]
    per_wheel = {Wheels}
    return [
        signal
        for kind in KINDS
        if kind not in without
        for signal in signals_of(kind)
        if not (kind in per_wheel and any(signal.key.endswith(ending) for ending in beyond))
    ]


@cache
def possible_signals() -> Mapping[str, Signal]:
    """Return every signal that some robot has, by key: with all sensors and the most wheels."""
    return {signal.key: signal for signal in all_signals(MOST_WHEELS)}


def require_possible(keys: Iterable[str], possible: Collection[str]) -> None:
    """Raise UnknownSignalError for the first key that is not among ``possible``."""
    for key in keys:
        if key not in possible:
            quote = key[:_LONGEST_QUOTE]
            near = difflib.get_close_matches(quote, possible, 1)
            raise UnknownSignalError(f"unknown signal {quote!r}", hint=f"did you mean {near[0]}?" if near else "")


def signals_as_json(signals: Iterable[Signal], existing: Collection[str]) -> list[dict[str, Any]]:
    """Return what a page shows of signals. ``absent``: its key is not among ``existing``, so it has no samples."""
    return [
        {
            "key": s.key,
            "group": s.group,
            "label": s.label,
            "unit": s.unit,
            "doc": s.doc,
            "limit": limit_of(s.key),
            "absent": s.key not in existing,
        }
        for s in signals
    ]


@cache
def _fields(kind: type[Telemetry]) -> tuple[tuple[str, Sequence[str]], ...]:
    """Return the numeric fields and the names of their parts, none for a single number. The time is no signal."""
    hints = get_type_hints(kind)
    found: list[tuple[str, Sequence[str]]] = []
    for field in dataclasses.fields(kind):
        hint = hints[field.name]
        if field.name == "time_s":
            continue
        if hint in (float, int, bool):
            found.append((field.name, ()))
        elif hint in (Pose, Twist):
            found.append((field.name, hint._fields))
        elif get_origin(hint) is tuple and get_args(hint)[0] in (float, int):
            count = len(get_args(hint))
            found.append((field.name, _AXES if count == len(_AXES) else [str(n) for n in range(1, count + 1)]))
    return tuple(found)


@cache
def _attribute_docs(kind: type[Telemetry]) -> dict[str, str]:
    """Return the sentence below each attribute in the class's source."""
    tree = ast.parse(inspect.getsource(kind)).body[0]
    assert isinstance(tree, ast.ClassDef)
    found: dict[str, str] = {}
    for line, below in zip(tree.body, tree.body[1:], strict=False):
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name) and isinstance(below, ast.Expr):
            found[line.target.id] = inspect.cleandoc(str(ast.literal_eval(below.value)))
    return found


def _units(doc: str, name: str) -> list[str]:
    in_brackets = [unit.strip() for bracket in re.findall(r"\[([^]]*)\]", doc) for unit in bracket.split(",")]
    if in_brackets:
        return in_brackets
    ending = next((ending for ending in _UNIT_ENDINGS if name.endswith(ending)), "")
    return [ending[1:].removesuffix("_mean").removesuffix("_max").replace("_", "/")]


def _without_unit(name: str) -> str:
    for ending in _LEFT_OUT:
        name = name.removesuffix(ending)
    return name
