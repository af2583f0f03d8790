# SPDX-License-Identifier: MIT
"""A wheel log and the ground truth beside it: what every importer makes and every method below starts from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel import files
from omniwheel.errors import LogError
from omniwheel.npz_file import read_npz
from omniwheel.pose_jumps import PoseJump

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MIN_ROWS = 20


@dataclass(frozen=True)
class Truth:
    """Ground truth on a clock and in a frame of its own.

    ``time_s`` (m,) rises, ``xy`` (m, 2) [m], ``theta`` (m,) [rad].
    ``theta`` is NaN where it is unknown or not to be trusted. ``same_clock``: the clock is known to be the robot's.
    ``jumps``: where it jumped, if it is the robot's own estimate, and goes on here from where it was.
    """

    time_s: Array
    xy: Array
    theta: Array
    same_clock: bool = False
    jumps: tuple[PoseJump, ...] = ()


@dataclass(frozen=True)
class WheelLog:
    """One run: n rows on the robot's clock, wheels in the robot file's order, positive drives counter-clockwise.

    ``time_s`` (n,) rises; nominally one row per ``period_s``, rows may be missing.
    ``counts`` (n, wheels) encoder counts since the row before, ``counts_per_revolution`` of the wheel. With
    ``sample_s`` above 0 they are those of the last ``sample_s`` [s] only. They do not add up to an angle then, and the
    noise of one tells nothing of the next.
    ``noise_rad_s`` is the standard deviation of a speed from one count (0: unknown).
    ``good`` (n, wheels) False where a count is a spike or missing.
    ``duty`` (n, wheels) -1..1 commanded at this row; zeros if it was not logged.
    ``heading_rad`` (n,) unwrapped, counter-clockwise, 0 at the first row; NaN where there is none.
    """

    name: str
    period_s: float
    counts_per_revolution: int
    time_s: Array
    counts: Array
    good: Mask
    duty: Array
    heading_rad: Array
    truth: Truth | None = None
    sample_s: float = 0.0
    noise_rad_s: float = 0.0

    def __post_init__(self) -> None:
        """Check shapes, finiteness and the clock. Raises LogError."""
        rows = len(self.time_s)
        if self.time_s.ndim != 1:
            raise LogError(f"{self.name}: the times have shape {self.time_s.shape}; must be one number per row")
        if rows < MIN_ROWS:
            raise LogError(f"{self.name}: {rows} rows; at least {MIN_ROWS} are needed")
        if self.counts.ndim != 2 or self.counts.shape[1] not in (3, 4):
            raise LogError(f"{self.name}: counts of shape {self.counts.shape}; one column for each of 3 or 4 wheels")
        for field in ("counts", "good", "duty"):
            if getattr(self, field).shape != self.counts.shape or len(self.counts) != rows:
                raise LogError(f"{self.name}: {field} has shape {getattr(self, field).shape} beside {rows} rows")
        for field in ("time_s", "counts", "duty"):
            if not np.all(np.isfinite(getattr(self, field))):
                raise LogError(f"{self.name}: {field} has a value that is not finite", hint="drop or repair that row")
        if self.heading_rad.shape != self.time_s.shape:
            raise LogError(f"{self.name}: heading_rad has shape {self.heading_rad.shape} beside {rows} rows")
        if not (0.0 < self.period_s < np.inf and self.counts_per_revolution > 0):
            raise LogError(f"{self.name}: period and counts per revolution must be positive and finite")
        if not (0.0 <= self.sample_s <= self.period_s and 0.0 <= self.noise_rad_s < np.inf):
            raise LogError(f"{self.name}: sample_s must be 0 to the period, and noise_rad_s finite and not negative")
        if np.any(np.diff(self.time_s) <= 0.0):
            raise LogError(f"{self.name}: the time does not increase", hint="drop repeated rows")

    @property
    def wheels(self) -> int:
        """Number of wheels."""
        return int(self.counts.shape[1])

    @property
    def rad_per_count(self) -> float:
        """Wheel angle of one count [rad]."""
        return 2.0 * np.pi / self.counts_per_revolution

    @property
    def step_s(self) -> Array:
        """Time since the row before (n,) [s]; the period for the first row."""
        return np.concatenate(([self.period_s], np.diff(self.time_s)))

    @property
    def wheel_rad_s(self) -> Array:
        """Speeds from the counts (n, wheels) [rad/s], spikes included."""
        over_s = self.sample_s if self.sample_s > 0.0 else self.step_s[:, None]
        return np.asarray(self.counts * self.rad_per_count / over_s)

    @property
    def quantum_rad_s(self) -> float:
        """Speed of one count in one row [rad/s]."""
        return self.rad_per_count / (self.sample_s or self.period_s)

    @property
    def counts_per_period(self) -> Array:
        """Counts (n, wheels) that each row stands for, over one period; a sample's speed is taken to last."""
        if self.sample_s > 0.0:
            return np.asarray(self.counts * (self.period_s / self.sample_s))
        return np.asarray(self.counts / np.maximum(np.round(self.step_s / self.period_s), 1.0)[:, None])

    @property
    def has_heading(self) -> bool:
        """Whether there is a heading at all."""
        return bool(np.any(np.isfinite(self.heading_rad)))

    def without_counts(self) -> WheelLog:
        """Return the same log with no count good: what is left is the duty, and the heading if there is one."""
        return replace(self, good=np.zeros_like(self.good))

    def require_truth(self) -> Truth:
        """Return the ground truth; LogError if there is none."""
        if self.truth is None:
            raise LogError(f"{self.name} has no ground truth", hint="import the log with --truth FILE")
        return self.truth

    def require_heading(self) -> None:
        """Raise LogError without a heading."""
        if not self.has_heading:
            raise LogError(
                f"{self.name} has no heading", hint="map the column of the IMU's heading ([heading] in the mapping)"
            )


def save_log(log: WheelLog, path: Path) -> None:
    """Write a log as NPZ, with the names and units of :class:`WheelLog`. Raises OutputFileError."""
    truth = log.truth
    empty = np.zeros(0)
    with files.replaced(path) as file:
        np.savez_compressed(
            file,
            name=np.array(log.name),
            period_s=np.array(log.period_s),
            counts_per_revolution=np.array(log.counts_per_revolution),
            sample_s=np.array(log.sample_s),
            noise_rad_s=np.array(log.noise_rad_s),
            time_s=log.time_s,
            counts=log.counts,
            good=log.good,
            duty=log.duty,
            heading_rad=log.heading_rad,
            truth_time_s=empty if truth is None else truth.time_s,
            truth_xy=np.zeros((0, 2)) if truth is None else truth.xy,
            truth_theta=empty if truth is None else truth.theta,
            truth_same_clock=np.array(truth is not None and truth.same_clock),
        )


def load_log(path: Path) -> WheelLog:
    """Read a log that :func:`save_log` wrote. Raises LogError."""
    try:
        return _from_arrays(read_npz(path))
    except LogError:
        raise
    except (OSError, KeyError, ValueError, TypeError, OverflowError) as error:
        hint = "make it from a CSV file with: omni logs import LOG.csv --mapping FILE --out LOG.npz"
        why = f": {error.strerror}" if isinstance(error, OSError) and error.strerror else ""
        raise LogError(f"{path} is not an imported log{why}", hint=hint) from error


def _from_arrays(stored: Mapping[str, NDArray[Any]]) -> WheelLog:
    """Make a log of what :func:`save_log` stores. Raises KeyError, ValueError, TypeError or OverflowError."""
    times = _numbers(stored["truth_time_s"])
    truth = None
    if len(times):
        same_clock = bool(stored["truth_same_clock"])
        truth = Truth(times, _numbers(stored["truth_xy"]), _numbers(stored["truth_theta"]), same_clock)
        if truth.xy.shape != (len(times), 2) or truth.theta.shape != times.shape:
            raise ValueError("the truth's arrays differ in length")
    return WheelLog(
        name=str(stored["name"]),
        period_s=float(stored["period_s"]),
        counts_per_revolution=int(stored["counts_per_revolution"]),
        time_s=_numbers(stored["time_s"]),
        counts=_numbers(stored["counts"]),
        good=stored["good"].astype(np.bool_),
        duty=_numbers(stored["duty"]),
        heading_rad=_numbers(stored["heading_rad"]),
        truth=truth,
        sample_s=float(stored.get("sample_s", np.zeros(()))),
        noise_rad_s=float(stored.get("noise_rad_s", np.zeros(()))),
    )


def _numbers(values: NDArray[Any]) -> Array:
    return np.atleast_1d(values.astype(np.float64))
