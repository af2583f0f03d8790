# SPDX-License-Identifier: MIT
"""The floor of a MuJoCo world: how steep, how slippery where, how bumpy. Written as a TOML file::

    [floor]
    slope_deg = 2.0               # 0: level
    uphill_deg = 90.0             # which way it rises: counter-clockwise from x
    bumps_m = 0.001               # highest above lowest point; 0: even
    bumps_length_m = 0.1          # from one bump to the next, about
    bumps_size_m = 4.0            # side of the square with bumps, its middle at 0, 0
    seed = 1                      # of the bumps

    [[patch]]                     # the later one counts where two overlap
    x_m = [0.1, 0.4]
    y_m = [-0.5, 0.5]
    friction = 0.2
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omni_schema import SchemaError
from omni_schema.toml_file import read_toml, refuse_unknown_keys, take_number, take_table

_RANGES = {
    "slope_deg": (0.0, 30.0),
    "uphill_deg": (-360.0, 360.0),
    "bumps_m": (0.0, 0.05),
    "bumps_length_m": (0.02, 10.0),
    "bumps_size_m": (0.5, 100.0),
    "seed": (0, 2**32 - 1),
}


@dataclass(frozen=True)
class Patch:
    """A rectangle of the floor with its own coefficient of friction; x and y from and to [m]."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]
    friction: float

    def holds(self, x: float, y: float) -> bool:
        """Return whether a point of the floor [m] is within."""
        return self.x_m[0] <= x <= self.x_m[1] and self.y_m[0] <= y <= self.y_m[1]


@dataclass(frozen=True)
class Floor:
    """A floor; x, y and theta of the robot are in its plane, however steep it is. Angles in degrees."""

    slope_deg: float = 0.0
    uphill_deg: float = 0.0
    bumps_m: float = 0.0
    bumps_length_m: float = 0.1
    bumps_size_m: float = 4.0
    seed: int = 1
    patches: tuple[Patch, ...] = ()

    @property
    def height_m(self) -> float:
        """Highest point above the plane z = 0."""
        return self.bumps_m

    def gravity(self, size_m_s2: float) -> tuple[float, float, float]:
        """Return gravity [m/s^2] in the floor's frame, z across the floor."""
        slope, uphill = math.radians(self.slope_deg), math.radians(self.uphill_deg)
        along = -size_m_s2 * math.sin(slope)
        return along * math.cos(uphill), along * math.sin(uphill), -size_m_s2 * math.cos(slope)

    def friction_at(self, x: float, y: float, usual: float) -> float:
        """Return the coefficient of friction at a point [m]."""
        return next((patch.friction for patch in reversed(self.patches) if patch.holds(x, y)), usual)

    def heights(self, rows: int) -> Any:
        """Return heights [m] from 0 on a square grid, rows along y; None for an even floor."""
        if self.bumps_m <= 0.0:
            return None
        random = np.random.default_rng(self.seed)
        step = self.bumps_size_m / rows
        frequency = np.fft.fftfreq(rows, step)
        squared = frequency[:, None] ** 2 + frequency[None, :] ** 2
        smooth = np.exp(-0.5 * squared * (self.bumps_length_m / 1.2) ** 2)
        noise = np.fft.ifft2(np.fft.fft2(random.standard_normal((rows, rows))) * smooth).real
        return (noise - noise.min()) * (self.bumps_m / float(np.ptp(noise)))


LEVEL = Floor()


def read_floor(path: Path) -> Floor:
    """Read a floor from a TOML file. Raises SchemaError that names file, key, value and what is allowed."""
    source, document = str(path), read_toml(path)
    refuse_unknown_keys(source, "", document, ("floor", "patch"))
    table = take_table(source, "floor", document.get("floor", {}))
    refuse_unknown_keys(source, "floor.", table, tuple(_RANGES))
    given: dict[str, Any] = {name: _within(source, f"floor.{name}", value, *_RANGES[name]) for name, value in table.items()}
    if "seed" in given:
        if given["seed"] != int(given["seed"]):
            raise SchemaError(source, "floor.seed", f"is {given['seed']}; a whole number is needed")
        given["seed"] = int(given["seed"])
    entries = document.get("patch", [])
    if not isinstance(entries, list):
        raise SchemaError(source, "patch", "write each as a table [[patch]]")
    patches = tuple(_patch(source, f"patch[{number}]", entry) for number, entry in enumerate(entries, 1))
    return Floor(**given, patches=patches)


def _patch(source: str, key: str, entry: Any) -> Patch:
    table = take_table(source, key, entry)
    refuse_unknown_keys(source, f"{key}.", table, ("x_m", "y_m", "friction"))
    friction = _within(source, f"{key}.friction", table.get("friction"), 1e-3, 10.0)
    return Patch(_span(source, f"{key}.x_m", table.get("x_m")), _span(source, f"{key}.y_m", table.get("y_m")), friction)


def _span(source: str, key: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise SchemaError(source, key, f"is {value!r}; two numbers are needed: from, to")
    low, high = (_within(source, key, item, -1e6, 1e6) for item in value)
    if low >= high:
        raise SchemaError(source, key, f"is {value!r}; the first has to be the smaller one")
    return low, high


def _within(source: str, key: str, value: object, low: float, high: float) -> float:
    number = take_number(source, key, value)
    if not low <= number <= high:
        raise SchemaError(source, key, f"is {number:g}; allowed is a number from {low:g} to {high:g}")
    return number
