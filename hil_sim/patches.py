# SPDX-License-Identifier: MIT
"""Patches of the floor with another friction, as a scenario's ``[[patch]]`` gives them.

A patch is a rectangle along the world's axes, or a circle::

    [[patch]]
    x_m = [0.1, 0.4]              # from, to
    y_m = [-0.5, 0.5]
    friction = 0.3                # factor on friction_coefficient

    [[patch]]
    centre_m = [1.0, 0.0]
    radius_m = 0.2
    friction = 0.3

Where two overlap, the later one counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from omni_schema import SchemaError
from omni_schema.toml_file import number_within, refuse_unknown_keys
from omniwheel._core import lib

MAX_PATCHES: int = lib.HIL_MAX_PATCHES
LEAST_FRICTION, MOST_FRICTION = 0.001, 10.0
FARTHEST_m = 1e6
_RECTANGLE, _CIRCLE = ("x_m", "y_m"), ("centre_m", "radius_m")


@dataclass(frozen=True)
class FloorPatch:
    """A part of the floor. ``friction`` is a factor on the friction coefficient, 0.001 to 10.

    ``x_m`` and ``y_m`` go from, to [m, world frame]. With a ``radius_m`` above 0 it is a circle, and the first of each
    is its middle.
    """

    x_m: tuple[float, float]
    y_m: tuple[float, float]
    friction: float
    radius_m: float = 0.0

    def holds(self, x_m: float, y_m: float) -> bool:
        """Return whether a point of the floor [m, world frame] is within; the edge is."""
        if self.radius_m > 0.0:
            return (x_m - self.x_m[0]) ** 2 + (y_m - self.y_m[0]) ** 2 <= self.radius_m**2
        return self.x_m[0] <= x_m <= self.x_m[1] and self.y_m[0] <= y_m <= self.y_m[1]

    def document(self) -> dict[str, Any]:
        """Return the patch as a scenario file has it."""
        if self.radius_m > 0.0:
            return {
                "centre_m": [self.x_m[0], self.y_m[0]],
                "radius_m": self.radius_m,
                "friction": self.friction,
            }
        return {"x_m": list(self.x_m), "y_m": list(self.y_m), "friction": self.friction}


def factor_at(patches: Sequence[FloorPatch], x_m: float, y_m: float) -> float:
    """Return the factor on the friction coefficient at a point of the floor [m, world frame]; 1 beside all patches."""
    return next((patch.friction for patch in reversed(patches) if patch.holds(x_m, y_m)), 1.0)


def parse_patch(source: str, key: str, entry: dict[str, Any]) -> FloorPatch:
    """Read an entry of ``[[patch]]``. Raises SchemaError that names key, value and what is allowed."""
    refuse_unknown_keys(source, f"{key}.", entry, (*_RECTANGLE, *_CIRCLE, "friction"))
    given = {name for name in (*_RECTANGLE, *_CIRCLE) if name in entry}
    friction = number_within(source, f"{key}.friction", entry.get("friction"), LEAST_FRICTION, MOST_FRICTION)
    if given == set(_RECTANGLE):
        x_m, y_m = (_pair(source, f"{key}.{name}", entry[name]) for name in _RECTANGLE)
        for name, (low, high) in zip(_RECTANGLE, (x_m, y_m), strict=True):
            if low >= high:
                raise SchemaError(
                    source, f"{key}.{name}", f"is [{low:g}, {high:g}]; the first must be below the second"
                )
        return FloorPatch(x_m, y_m, friction)
    if given == set(_CIRCLE):
        x, y = _pair(source, f"{key}.centre_m", entry["centre_m"])
        return FloorPatch(
            (x, x), (y, y), friction, number_within(source, f"{key}.radius_m", entry["radius_m"], 1e-6, FARTHEST_m)
        )
    problem = f"has {', '.join(sorted(given)) or 'no place'}; give x_m and y_m, or centre_m and radius_m"
    raise SchemaError(source, key, problem)


def parse_patches(source: str, entries: Sequence[dict[str, Any]]) -> tuple[FloorPatch, ...]:
    """Read all entries of ``[[patch]]``. Raises SchemaError."""
    if len(entries) > MAX_PATCHES:
        raise SchemaError(source, "patch", f"has {len(entries)} entries; must be at most {MAX_PATCHES}")
    return tuple(parse_patch(source, f"patch[{number}]", entry) for number, entry in enumerate(entries, 1))


def _pair(source: str, key: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise SchemaError(source, key, f"is {value!r}; must be a list of two numbers")
    first, second = (
        number_within(source, f"{key}[{i + 1}]", item, -FARTHEST_m, FARTHEST_m) for i, item in enumerate(value)
    )
    return first, second
