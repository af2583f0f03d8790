# SPDX-License-Identifier: MIT
"""Runs cut into windows: dead reckoning from a measured pose, compared with the measured poses that follow.

The path of a window is linearised in the odometry matrix. The first pose of a window is a measurement, too: its error
is a nuisance parameter with the standard deviation of the truth, eliminated from each window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import LogError
from omniwheel.identification.pose_fit.wheel_model import WheelModel
from omniwheel.logs.log import Array, WheelLog

WINDOWS_S = (6.0, 240.0)
"""Shortest and longest window. A run is whole where there are enough: what is systematic adds up, noise does not."""
WINDOWS = 12
"""Windows that all runs together are cut into, as far as their length allows."""
POSES_PER_WINDOW = 40
LONGEST_STEP_S = 0.04
"""Rows nearer together than this are added up: the path is made of arcs."""
LEAST_POSES = 2
UNKNOWN_HEADING_SD_RAD = np.pi
"""Standard deviation of the heading at the start of a window whose poses have none."""


@dataclass(frozen=True)
class Run:
    """One log for the fit.

    ``time_s`` (n,); ``rolled_rad`` (n, 3 wheels) as ``WheelModel.rolled`` returns it; ``truth_s`` (m,) on the truth's
    clock and ``pose`` (m, 3) [m, m, rad], heading unwrapped, or all NaN where the truth has positions only.
    ``group``: runs of one group are left out together.
    """

    name: str
    group: str
    time_s: Array
    rolled_rad: Array
    truth_s: Array
    pose: Array
    same_clock: bool

    @property
    def wheels(self) -> int:
        """Number of wheels."""
        return int(self.rolled_rad.shape[1]) // 3

    @property
    def period_s(self) -> float:
        """Median time between two rows [s]."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def has_heading(self) -> bool:
        """Whether the poses have a heading; else they are the positions of one marker."""
        return bool(np.isfinite(self.pose[0, 2]))


@dataclass(frozen=True)
class Window:
    """Wheel angle increments (m, 3 wheels) from a measured ``start`` (3,), and ``pose`` (k, 3) after rows ``row``."""

    run: int
    increment_rad: Array
    start: Array
    row: NDArray[np.int64]
    pose: Array


def run_of(log: WheelLog, group: str, layout: WheelModel) -> Run:
    """Return what the fit needs of a log. Raises LogError where the truth is missing.

    A truth without any heading is taken as the positions of one marker. Headings may be wrapped: full turns between
    two poses are those that the documented geometry gives.

    Every count is used as logged: one that was marked as a spike adds up to the angle like any other.
    """
    truth = log.require_truth()
    if log.sample_s > 0.0:
        raise LogError(
            f"{log.name}: its counts are samples of a speed and do not add up to an angle",
            hint="identify it with: omni identify logs",
        )
    placed = np.all(np.isfinite(truth.xy), axis=1)
    known = placed & np.isfinite(truth.theta)
    headings = bool(np.any(known)) or not np.any(placed)
    if not headings:
        known = placed
    if np.sum(known) < LEAST_POSES:
        raise LogError(
            f"{log.name}: {np.sum(known)} poses of its truth are complete; {LEAST_POSES} are needed",
            hint="correct the columns of [truth] in the column mapping; without truth.theta, positions suffice",
        )
    angle = log.counts * log.rad_per_count
    angle[0] = 0.0  # what the wheels rolled before the first row
    angle = np.cumsum(angle, axis=0)
    heading = np.full(int(np.sum(known)), np.nan)
    if headings:
        # Between two poses far apart the robot may have turned more than half a turn, as the wheels show.
        turned = angle @ layout.matrix(layout.nominal)[2, : layout.wheels]
        turned_there = np.interp(truth.time_s[known], log.time_s, turned)
        heading = turned_there + np.unwrap(truth.theta[known] - turned_there)
    pose = np.column_stack((truth.xy[known], heading))
    rolled = layout.rolled(log.time_s, angle)
    return Run(log.name, group, log.time_s, rolled, truth.time_s[known], pose, truth.same_clock)


def window_length_s(runs: Sequence[Run]) -> float:
    """Return the length of the windows into which these runs are cut [s]."""
    total_s = sum(float(run.truth_s[-1] - run.truth_s[0]) for run in runs)
    return min(max(total_s / WINDOWS, WINDOWS_S[0]), WINDOWS_S[1])


def cut(run: Run, number: int, truth_on_log_s: Array, window_s: float = WINDOWS_S[1]) -> list[Window]:
    """Cut a run whose poses were measured at ``truth_on_log_s`` (m,) of the log's clock; ``number`` names the run."""
    usable = np.flatnonzero((truth_on_log_s >= run.time_s[0]) & (truth_on_log_s <= run.time_s[-1]))
    if len(usable) < LEAST_POSES:
        return []
    times = truth_on_log_s[usable]
    parts = max(1, round((times[-1] - times[0]) / window_s))
    edges = np.unique(np.searchsorted(times, np.linspace(times[0], times[-1], parts + 1)))
    return [_window(run, number, usable, times, int(first), int(last)) for first, last in pairwise(edges)]


def _window(run: Run, number: int, usable: NDArray[np.int64], times: Array, first: int, last: int) -> Window:
    chosen = np.unique(np.linspace(first, last, min(last - first, POSES_PER_WINDOW) + 1).round().astype(int))
    rows = run.time_s[:: max(1, int(LONGEST_STEP_S / run.period_s))]
    between = rows[(rows > times[first]) & (rows < times[last])]
    grid = np.union1d(between, times[chosen])
    rolled = np.column_stack([np.interp(grid, run.time_s, column) for column in run.rolled_rad.T])
    row = np.searchsorted(grid, times[chosen])
    pose = run.pose[usable[chosen]]
    return Window(number, np.diff(rolled, axis=0), pose[0], row[1:].astype(np.int64) - 1, pose[1:])


def integrate(increment_rad: Array, matrix: Array, start: Array) -> tuple[Array, Array, Array]:
    """Return poses (m, 3) after each increment, the headings halfway (m,), and the steps (m, 2) in the world [m]."""
    body = increment_rad @ matrix.T
    heading = start[2] + np.cumsum(body[:, 2])
    half = 0.5 * body[:, 2]
    middle = heading - half
    chord = np.sinc(half / np.pi)
    cosine, sine = chord * np.cos(middle), chord * np.sin(middle)
    step = np.column_stack((cosine * body[:, 0] - sine * body[:, 1], sine * body[:, 0] + cosine * body[:, 1]))
    return np.column_stack((start[:2] + np.cumsum(step, axis=0), heading)), middle, step


def with_start_heading(window: Window, matrix: Array) -> Window:
    """Return a window of positions with the start heading that turns its path onto them, by least squares."""
    path = integrate(window.increment_rad, matrix, np.array([*window.start[:2], 0.0]))[0][window.row, :2]
    heading = best_turn(np.vstack((window.start[:2], path)), np.vstack((window.start[:2], window.pose[:, :2])))
    return replace(window, start=np.array([*window.start[:2], heading]))


def best_turn(path: Array, measured: Array) -> float:
    """Return the rotation [rad] that, with a shift, brings the points of a path (k, 2) nearest to the measured ones."""
    p, q = path - path.mean(axis=0), measured - measured.mean(axis=0)
    return float(np.arctan2(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]), np.sum(p * q)))


def linearised(window: Window, matrix: Array) -> tuple[Array, Array, Array]:
    """Return residuals (k, 3) pose minus path, and the path's slope by matrix (k, 3, 9 w) and start pose (k, 3, 3).

    Where the poses have no heading, its residuals and slopes are 0.
    """
    headings = bool(np.isfinite(window.start[2]))
    window = window if headings else with_start_heading(window, matrix)
    u, row = window.increment_rad, window.row
    path, middle, step = integrate(u, matrix, window.start)
    firsts = np.concatenate(([0], row[:-1] + 1))

    def summed(columns: Array) -> Array:
        return np.asarray(np.cumsum(np.add.reduceat(columns[: row[-1] + 1], firsts, axis=0), axis=0))

    half_way = np.cumsum(u, axis=0) - 0.5 * u
    ahead, aside = summed(np.cos(middle)[:, None] * u), summed(np.sin(middle)[:, None] * u)
    turn = summed(u)
    slope = np.zeros((len(row), 3, 3, u.shape[1]))
    slope[:, 0, 0], slope[:, 0, 1], slope[:, 0, 2] = ahead, -aside, summed(-step[:, 1:] * half_way)
    slope[:, 1, 0], slope[:, 1, 1], slope[:, 1, 2] = aside, ahead, summed(step[:, :1] * half_way)
    slope[:, 2, 2] = turn
    start = np.tile(np.eye(3), (len(row), 1, 1))
    moved = path[row, :2] - window.start[:2]
    start[:, 0, 2], start[:, 1, 2] = -moved[:, 1], moved[:, 0]
    residual = window.pose - path[row]
    if not headings:
        residual[:, 2], slope[:, 2], start[:, 2] = 0.0, 0.0, 0.0
    return residual, slope.reshape(len(row), 3, -1), start


def groups_of(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return the groups in the order in which they come."""
    return tuple(dict.fromkeys(run.group for run in runs))
