# SPDX-License-Identifier: MIT
"""Errors of dead reckoning in the measures that papers report: start pose given, no alignment of the rest.

Without measured headings the start position is given, and the start heading is the one that fits the run best.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.identification.pose_fit.clock import Clock
from omniwheel.identification.pose_fit.wheel_model import Array
from omniwheel.identification.pose_fit.windows import Run, best_turn, integrate


@dataclass(frozen=True)
class Score:
    """One run's errors: position ``largest_m``, ``rms_m``, ``final_m``; largest wrapped heading error; path length.

    ``heading_rad`` is NaN where headings were not measured.
    """

    name: str
    group: str
    largest_m: float
    rms_m: float
    final_m: float
    heading_rad: float
    path_m: float

    @property
    def per_metre(self) -> float:
        """Largest position error per metre of path; NaN without a path."""
        return self.largest_m / self.path_m if self.path_m > 0.0 else float("nan")


@dataclass(frozen=True)
class Summary:
    """Median, 95th percentile and largest value over runs."""

    median: float
    percentile_95: float
    largest: float


def dead_reckoned(run: Run, matrix: Array, truth_on_log_s: Array) -> tuple[Array, Array]:
    """Return the path's poses (k, 3) and the measured ones at the poses within the log's time, from the first one."""
    inside = (truth_on_log_s >= run.time_s[0]) & (truth_on_log_s <= run.time_s[-1])
    times, measured = truth_on_log_s[inside], run.pose[inside]
    grid = np.union1d(run.time_s[(run.time_s > times[0]) & (run.time_s < times[-1])], times)
    rolled = np.column_stack([np.interp(grid, run.time_s, column) for column in run.rolled_rad.T])
    increments, rows = np.diff(rolled, axis=0), np.searchsorted(grid, times)

    def path(heading: float) -> Array:
        start = np.array([*measured[0, :2], heading])
        return np.asarray(np.vstack((start, integrate(increments, matrix, start)[0]))[rows])

    if run.has_heading:
        return path(float(measured[0, 2])), measured
    return path(best_turn(path(0.0)[:, :2], measured[:, :2])), measured


def score(run: Run, matrix: Array, clock: Clock | None = None) -> Score:
    """Score a run; without a ``clock`` the poses' times are taken as logged."""
    times = run.truth_s if clock is None else clock.on_log(run.truth_s)
    path, measured = dead_reckoned(run, matrix, times)
    distance = np.hypot(*(path - measured)[:, :2].T)
    wrapped = np.abs(np.angle(np.exp(1j * (path - measured)[:, 2])))
    return Score(
        run.name,
        run.group,
        float(np.max(distance)),
        float(np.sqrt(np.mean(distance**2))),
        float(distance[-1]),
        float(np.max(wrapped)),
        float(np.sum(np.hypot(*np.diff(measured[:, :2], axis=0).T))),
    )


def summary(scores: Sequence[Score], measure: Callable[[Score], float]) -> Summary:
    """Return median, 95th percentile and largest of a measure over the runs that have it; NaN where none has."""
    every = np.array([measure(each) for each in scores])
    values = every[np.isfinite(every)]
    if not len(values):
        return Summary(np.nan, np.nan, np.nan)
    return Summary(float(np.median(values)), float(np.percentile(values, 95.0)), float(np.max(values)))
