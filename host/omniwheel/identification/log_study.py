# SPDX-License-Identifier: MIT
"""Identification from foreign logs with its proof: every run is also dead-reckoned with what the other runs say."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.identification.motor_curve import CurveFit, fit_motor_curve
from omniwheel.identification.odometry_calibration import (
    Odometry,
    dead_reckon,
    identify_odometry,
    nominal_replay,
)
from omniwheel.logs.alignment import Alignment
from omniwheel.logs.log import Array, WheelLog
from omniwheel.replay import fixes_from_truth, replay

FIX_RATE_HZ = 5.0
MIN_RUNS = 2

Mapper = Callable[[Callable[[Any], Any], Iterable[Any]], list[Any]]


@dataclass(frozen=True)
class Track:
    """One dead-reckoned path in the truth's frame: ``xy`` (n, 2) [m] and how it was aligned."""

    xy: Array
    alignment: Alignment


@dataclass(frozen=True)
class Scored:
    """One run, dead-reckoned in several ways.

    With the ``nominal`` geometry; with what was ``identified`` from all runs; with what the other runs say
    (``held_out``). The last is also there without the heading, and without the counts (what the duty alone tells).
    ``nis_mean`` of the truth used as fixes, with ``nis_degrees`` degrees of freedom each.
    """

    name: str
    nominal: Track
    identified: Track
    held_out: Track
    held_out_wheels_only: Track
    held_out_duty_only: Track
    nis_mean: float
    nis_degrees: int
    rejected_share: float


@dataclass(frozen=True)
class LogStudy:
    """``whole`` from all runs, ``without`` per left-out run; ``scored`` runs; motor curve with ``lifted`` wheels."""

    whole: Odometry
    without: tuple[Odometry, ...]
    scored: tuple[Scored, ...]
    lifted: CurveFit | None

    def median_m(self, kind: str) -> float:
        """Median over the runs of the RMS distance [m] of one kind of track, a field of :class:`Scored`."""
        return float(np.median([getattr(run, kind).alignment.rms_m for run in self.scored]))

    def jackknife_sd(self, value: Callable[[Odometry], Array | float]) -> Array:
        """Standard deviation of a number of the identification, from leaving out one run at a time."""
        values = np.array([value(each) for each in self.without], dtype=np.float64)
        count = len(values)
        return np.asarray(np.sqrt((count - 1.0) / count * np.sum((values - values.mean(axis=0)) ** 2, axis=0)))


def identify_from_logs(
    runs: Sequence[WheelLog],
    robot: Robot,
    turns: Sequence[WheelLog] = (),
    lifted: Sequence[WheelLog] = (),
    run_map: Mapper | None = None,
) -> LogStudy:
    """Identify a robot from runs with truth; ``turns`` have a heading only, in ``lifted`` the wheels turned in the air.

    ``run_map`` maps like the built-in, perhaps in parallel. Raises LogError.
    """
    if len(runs) < MIN_RUNS:
        hint = "give more logs that were imported with --truth"
        raise LogError(f"{len(runs)} run with truth; leaving one out needs at least {MIN_RUNS}", hint=hint)
    names = [log.name for log in runs]
    if len(set(names)) < len(names):
        raise LogError(f"duplicate run names: {', '.join(names)}", hint="give each run once")
    jobs = [_Job(tuple(runs), robot, tuple(turns), left_out) for left_out in (None, *range(len(runs)))]
    found = (run_map or _in_turn)(run_job, jobs)
    whole, without = found[0], tuple(found[1:])
    scored = tuple(score(log, robot, whole, other) for log, other in zip(runs, without, strict=True))
    return LogStudy(whole, without, scored, fit_motor_curve(lifted) if lifted else None)


@dataclass(frozen=True)
class _Job:
    runs: tuple[WheelLog, ...]
    robot: Robot
    turns: tuple[WheelLog, ...]
    left_out: int | None


def run_job(job: _Job) -> Odometry:
    """Identify from all runs but the one left out."""
    runs = [log for index, log in enumerate(job.runs) if index != job.left_out]
    return identify_odometry(runs, job.robot, job.turns)


def _in_turn(function: Callable[[Any], Any], items: Iterable[Any]) -> list[Any]:
    return [function(item) for item in items]


def score(log: WheelLog, nominal: Robot, whole: Odometry, other: Odometry) -> Scored:
    """Dead-reckon one run in all ways, and replay it once with its truth as pose fixes."""
    held_run, held = dead_reckon(log, other.robot, other.calibration)
    tracks = [
        nominal_replay(log, nominal),
        dead_reckon(log, whole.robot, whole.calibration),
        (held_run, held),
        dead_reckon(log, other.robot, other.calibration, use_heading=False),
        dead_reckon(log.without_counts(), other.robot, other.calibration),
    ]
    fixes = fixes_from_truth(log, held, FIX_RATE_HZ)
    fixed = replay(log, other.robot, other.calibration, fixes=fixes)
    drawn = [Track(found.to_truth(run.pose[:, :2]), found) for run, found in tracks]
    return Scored(
        name=log.name,
        nominal=drawn[0],
        identified=drawn[1],
        held_out=drawn[2],
        held_out_wheels_only=drawn[3],
        held_out_duty_only=drawn[4],
        nis_mean=float(np.mean(fixed.nis)) if len(fixed.nis) else float("nan"),
        nis_degrees=fixed.nis_degrees,
        rejected_share=float(1.0 - log.good.mean()),
    )
