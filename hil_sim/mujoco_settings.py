# SPDX-License-Identifier: MIT
"""A MuJoCo world's file: how steep, slippery and bumpy the floor is, and whether it is filmed.

It is a TOML file::

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

    [film]                        # world.gif in the run's folder; left out: none
    every_s = 0.1                 # simulated time between two pictures
    width = 640                   # pixels
    height = 480
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omni_schema import SchemaError
from omni_schema.toml_file import number_within, read_toml, refuse_unknown_keys, take_table

_RANGES = {
    "slope_deg": (0.0, 30.0),
    "uphill_deg": (-360.0, 360.0),
    "bumps_m": (0.0, 0.05),
    "bumps_length_m": (0.02, 10.0),
    "bumps_size_m": (0.5, 100.0),
    "seed": (0, 2**32 - 1),
}
_FILM_RANGES = {"every_s": (0.001, 60.0), "width": (16, 1920), "height": (16, 1080)}
_WHOLE = ("seed", "width", "height")


@dataclass(frozen=True)
class Film:
    """How the run is filmed: time between two pictures [s], and their size [pixels]."""

    every_s: float = 0.1
    width: int = 640
    height: int = 480


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


@dataclass(frozen=True)
class Settings:
    """All that such a file says; by default a level floor and no film."""

    floor: Floor = Floor()
    film: Film | None = None


def read_settings(path: Path) -> Settings:
    """Read a file. Raises SchemaError that names file, key, value and what is allowed."""
    source, document = str(path), read_toml(path)
    refuse_unknown_keys(source, "", document, ("floor", "patch", "film"))
    entries = document.get("patch", [])
    if not isinstance(entries, list):
        raise SchemaError(source, "patch", "write each as a table [[patch]]")
    patches = tuple(_patch(source, f"patch[{number}]", entry) for number, entry in enumerate(entries, 1))
    floor = Floor(**_table(source, "floor", document.get("floor", {}), _RANGES), patches=patches)
    film = Film(**_table(source, "film", document["film"], _FILM_RANGES)) if "film" in document else None
    return Settings(floor, film)


def _table(source: str, name: str, given: object, ranges: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    table = take_table(source, name, given)
    refuse_unknown_keys(source, f"{name}.", table, tuple(ranges))
    numbers = {key: number_within(source, f"{name}.{key}", value, *ranges[key]) for key, value in table.items()}
    for key in set(numbers) & set(_WHOLE):
        if numbers[key] != int(numbers[key]):
            raise SchemaError(source, f"{name}.{key}", f"is {numbers[key]}; must be a whole number")
    return {key: int(number) if key in _WHOLE else number for key, number in numbers.items()}


def _patch(source: str, key: str, entry: Any) -> Patch:
    table = take_table(source, key, entry)
    refuse_unknown_keys(source, f"{key}.", table, ("x_m", "y_m", "friction"))
    friction = number_within(source, f"{key}.friction", table.get("friction"), 1e-3, 10.0)
    return Patch(_span(source, f"{key}.x_m", table.get("x_m")), _span(source, f"{key}.y_m", table.get("y_m")), friction)


def _span(source: str, key: str, value: object) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise SchemaError(source, key, f"is {value!r}; must be two numbers: from, to")
    low, high = (number_within(source, key, item, -1e6, 1e6) for item in value)
    if low >= high:
        raise SchemaError(source, key, f"is {value!r}; the first must be smaller")
    return low, high
