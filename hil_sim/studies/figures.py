# SPDX-License-Identifier: MIT
"""The figures of a run that studies speak of, and how a user names a number made of many runs."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hil_sim.studies.errors import StudyInputError
from omni_schema.errors import did_you_mean

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Figure:
    """How a figure is shown: in words, its unit, the factor from SI to that unit, and digits after the point."""

    label: str
    unit: str
    factor: float
    digits: int
    detail: bool = False

    @property
    def heading(self) -> str:
        """Label and unit."""
        return f"{self.label} [{self.unit}]" if self.unit else self.label

    def show(self, value: float | None) -> str:
        """Return a value in SI units as it is shown."""
        if value is None or not math.isfinite(value):
            return "–"
        return f"{value * self.factor:.{self.digits}f}"


FIGURES: Mapping[str, Figure] = {
    "position_m": Figure("position RMSE", "mm", 1e3, 3),
    "max_position_m": Figure("largest distance", "mm", 1e3, 3),
    "final_position_m": Figure("distance at the end", "mm", 1e3, 3),
    "x_m": Figure("x RMSE", "mm", 1e3, 3, detail=True),
    "y_m": Figure("y RMSE", "mm", 1e3, 3, detail=True),
    "theta_rad": Figure("heading RMSE", "mrad", 1e3, 3),
    "max_theta_rad": Figure("largest heading", "mrad", 1e3, 3),
    "final_theta_rad": Figure("heading at the end", "mrad", 1e3, 3),
    "estimate_position_m": Figure("estimated position", "mm", 1e3, 3),
    "estimate_x_m": Figure("estimated x", "mm", 1e3, 3, detail=True),
    "estimate_y_m": Figure("estimated y", "mm", 1e3, 3, detail=True),
    "estimate_theta_rad": Figure("estimated heading", "mrad", 1e3, 3),
    "nis": Figure("fixes' NIS (right: 3)", "", 1.0, 2),
    "peak_wheel_rad_s": Figure("peak wheel speed", "rad/s", 1.0, 2),
    "peak_duty": Figure("peak duty", "%", 100.0, 2),
    "rms_duty": Figure("RMS duty", "%", 100.0, 2),
    "saturated_share": Figure("time at a limit", "%", 100.0, 2),
    "chatter": Figure("chatter index", "", 1.0, 4),
}
"""Columns of a row that have a distribution; NaN where a run has none. A ``detail`` stays out of tables."""

COMPLETED = "completed"
_PLAIN = ("mean", "sd", "median", "min", "max")
_CONSTRAINT = re.compile(r"\s*([a-z_.0-9]+?)\s*(<=|>=)\s*([-+.0-9e]+)\s*")


def known_figure(name: str) -> str:
    """Return the name if it is one of FIGURES or "completed"; StudyInputError otherwise."""
    names = (*FIGURES, COMPLETED)
    if name not in names:
        raise StudyInputError(f"unknown metric {name}{did_you_mean(name, names)}; known are {', '.join(names)}")
    return name


@dataclass(frozen=True)
class Number:
    """One number made of the runs' figures: ``position_m.p95``. ``statistic`` is mean, sd, median, min, max or pNN."""

    figure: str
    statistic: str

    def __str__(self) -> str:
        return f"{self.figure}.{self.statistic}"

    def of(self, rows: NDArray[Any]) -> float:
        """Return the number for these runs; NaN if any of them has no such figure: it cannot be judged then."""
        import numpy as np  # here, not above: help and the Tab key read this table

        values = rows[self.figure].astype(np.float64)
        if len(values) == 0 or not np.all(np.isfinite(values)):
            return float("nan")
        if self.statistic == "sd":
            return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
        if self.statistic.startswith("p"):
            return float(np.quantile(values, float(self.statistic[1:]) / 100.0))
        return float(getattr(np, self.statistic)(values))

    def show(self, value: float) -> str:
        """Return a value with unit for a table."""
        figure = FIGURES.get(self.figure)
        return f"{value:.4g}" if figure is None else f"{figure.show(value)} {figure.unit}".strip()


def parse_number(text: str) -> Number:
    """Read ``figure`` (its mean) or ``figure.statistic``. Raises StudyInputError."""
    figure, _, statistic = text.strip().partition(".")
    known_figure(figure)
    statistic = statistic or "mean"
    percentile = re.fullmatch(r"p(\d{1,2}(\.\d+)?|100)", statistic)
    if statistic not in _PLAIN and not percentile:
        raise StudyInputError(
            f"{text}: unknown statistic {statistic}{did_you_mean(statistic, _PLAIN)}",
            hint=f"use {', '.join(_PLAIN)} or a percentile such as p95",
        )
    return Number(figure, statistic)


@dataclass(frozen=True)
class Constraint:
    """A bound on a number, in SI units and shares."""

    number: Number
    upper: bool
    bound: float

    def __str__(self) -> str:
        return f"{self.number} {'<=' if self.upper else '>='} {self.bound:g}"

    def violation(self, rows: NDArray[Any]) -> float:
        """Return by how much the runs miss the bound: at most 0 if they keep it, infinity if that cannot be said."""
        value = self.number.of(rows)
        if not math.isfinite(value):
            return float("inf")
        return value - self.bound if self.upper else self.bound - value


def parse_constraint(text: str) -> Constraint:
    """Read ``figure.statistic<=bound`` or ``>=``. Raises StudyInputError."""
    found = _CONSTRAINT.fullmatch(text)
    try:
        bound = float(found[3]) if found else float("nan")
    except ValueError:
        bound = float("nan")
    if found is None or not math.isfinite(bound):
        raise StudyInputError(f"{text!r} is not a constraint", hint='write it like "saturated_share.mean<=0.05"')
    return Constraint(parse_number(found[1]), found[2] == "<=", bound)
