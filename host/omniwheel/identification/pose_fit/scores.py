# SPDX-License-Identifier: MIT
"""Errors of dead reckoning in the measures that papers report: start pose given, no alignment of the rest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.identification.pose_fit.clock import Clock
from omniwheel.identification.pose_fit.wheel_model import Array
from omniwheel.identification.pose_fit.windows import Run, integrate


@dataclass(frozen=True)
class Score:
    """One run's errors: position ``largest_m``, ``rms_m``, ``final_m``; largest wrapped heading error; path length."""

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
    path = np.vstack((measured[:1], integrate(np.diff(rolled, axis=0), matrix, measured[0])[0]))
    return path[np.searchsorted(grid, times)], measured


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
    """Return median, 95th percentile and largest of a measure."""
    values = np.array([measure(each) for each in scores])
    return Summary(float(np.median(values)), float(np.percentile(values, 95.0)), float(np.max(values)))
