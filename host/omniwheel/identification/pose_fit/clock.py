# SPDX-License-Identifier: MIT
"""Clock offset, rate and warp between a log and its truth, from the body's velocity as wheels and poses measure it.

The truth's clock shows t + lag(t) when the log's shows t. ``lag`` is piecewise linear. Where the robot changes its
velocity, the difference of the two velocities over the acceleration is the error of the lag. Constant velocity shows
nothing of a lag and gets it from the neighbouring parts. Positions without headings show the speed only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from omniwheel.identification.pose_fit.wheel_model import Array
from omniwheel.identification.pose_fit.windows import Run
from omniwheel.limits import ALIGN_WITHIN_S

KNOT_S = 8.0
SMOOTHING_S = 0.08
"""Standard deviation of the Gaussian that smooths both velocities."""
GRID_S = 0.04
COARSE_S = 0.05
STIFFNESS = 30.0
"""Weight of a bend of the lag, relative to the mean information of a knot."""
ARM_M = 0.2
"""Turn rates count as the speed of a point at this distance."""
LEAST_RATE_HZ = 5.0
"""Poses further apart do not show a velocity."""
LEAST_RATE_S = 10.0
"""Shorter logs show an offset only."""


@dataclass(frozen=True)
class Clock:
    """Lag (k,) [s] of the truth's clock over the log's at ``knot_s`` (k,) of the log's clock.

    ``offset_s`` is its mean; ``rate`` its slope [s/s]; both with standard deviations. ``warp_s`` is the largest
    distance of a knot from that line. ``measured`` False: the poses are too few to show it, and 0 is assumed.
    """

    knot_s: Array
    lag_s: Array
    offset_s: float
    offset_sd_s: float
    rate: float
    rate_sd: float
    warp_s: float
    measured: bool

    def lag(self, time_s: Array) -> Array:
        """Return the lag at times of the log's clock."""
        return np.asarray(np.interp(time_s, self.knot_s, self.lag_s))

    def on_log(self, truth_s: Array) -> Array:
        """Return times of the truth's clock on the log's clock."""
        time = truth_s - self.offset_s
        for _ in range(3):
            time = truth_s - self.lag(time)
        return time


def same_clock(run: Run) -> Clock:
    """Return the clock of a run whose lag is not measured."""
    ends = np.array([run.time_s[0], run.time_s[-1]])
    return Clock(ends, np.zeros(2), 0.0, 0.0, 0.0, 0.0, 0.0, measured=False)


def measure_clock(run: Run, matrix: Array) -> Clock:
    """Measure the lag of a run with an odometry matrix."""
    span = run.truth_s[-1] - run.truth_s[0]
    if len(run.truth_s) < LEAST_RATE_HZ * span or span < 2.0 or np.max(np.diff(run.truth_s)) > 1.0:
        return same_clock(run)
    poses = _pose_velocity(run)
    if run.same_clock:
        return _refined(run, matrix, poses, same_clock(run))
    tried = np.arange(-ALIGN_WITHIN_S, ALIGN_WITHIN_S + 0.5 * COARSE_S, COARSE_S)
    grid = np.arange(run.time_s[0], run.time_s[-1], 2.0 * GRID_S)
    wheels = _wheel_velocity(run, matrix, grid)
    errors = [_mismatch(wheels, poses, grid + lag) for lag in tried]
    best = float(tried[int(np.argmin(errors))])
    start = replace(same_clock(run), lag_s=np.full(2, best), offset_s=best)
    return _refined(run, matrix, poses, _refined(run, matrix, poses, start))


def _mismatch(wheels: Array, poses: tuple[Array, Array], times: Array) -> float:
    """Mean squared difference of the velocities; the robot is taken to stand still outside of the truth's time."""
    there = np.column_stack([np.interp(times, poses[0], column, left=0.0, right=0.0) for column in poses[1].T])
    return float(np.mean((wheels - there) ** 2))


def _wheel_velocity(run: Run, matrix: Array, grid: Array) -> Array:
    """Body velocity (n, 3) [m/s, m/s, arm m/s] by the wheels at times of the log's clock; ``arm`` is ARM_M.

    Without headings it is the speed (n, 1).
    """
    rolled = np.column_stack([_interpolated_difference(run.time_s, column, grid) for column in run.rolled_rad.T])
    body = _smoothed(rolled @ matrix.T * [1.0, 1.0, ARM_M], grid[1] - grid[0])
    return body if run.has_heading else _speed(body)


def _interpolated_difference(time_s: Array, values: Array, grid: Array) -> Array:
    half = 0.5 * (grid[1] - grid[0])
    return np.asarray((np.interp(grid + half, time_s, values) - np.interp(grid - half, time_s, values)) / (2.0 * half))


def _pose_velocity(run: Run) -> tuple[Array, Array]:
    """Times of the truth's clock, and the velocity by the poses, with the columns of ``_wheel_velocity``."""
    grid = np.arange(run.truth_s[0], run.truth_s[-1], GRID_S)
    rates = [_interpolated_difference(run.truth_s, column, grid) for column in run.pose.T]
    if not run.has_heading:
        return grid, _speed(_smoothed(np.column_stack(rates[:2]), GRID_S))
    heading = np.interp(grid, run.truth_s, run.pose[:, 2])
    cosine, sine = np.cos(heading), np.sin(heading)
    body = (cosine * rates[0] + sine * rates[1], -sine * rates[0] + cosine * rates[1], ARM_M * rates[2])
    return grid, _smoothed(np.column_stack(body), GRID_S)


def _speed(velocity: Array) -> Array:
    """Return the speed (n, 1) of velocities (n, 2 or more)."""
    return np.asarray(np.hypot(velocity[:, 0], velocity[:, 1])[:, None])


def _smoothed(columns: Array, step_s: float) -> Array:
    reach = max(1, round(3.0 * SMOOTHING_S / step_s))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step_s / SMOOTHING_S) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(columns, ((reach, reach), (0, 0)), mode="edge")
    return np.column_stack([np.convolve(column, kernel, mode="valid") for column in padded.T])


def _refined(run: Run, matrix: Array, poses: tuple[Array, Array], start: Clock) -> Clock:
    """Improve a lag by one Gauss-Newton step on the velocities; ``poses`` as ``_pose_velocity`` returns them."""
    grid = np.arange(run.time_s[0], run.time_s[-1], GRID_S)
    pose_s, pose_velocity = poses
    times = grid + start.lag(grid)
    inside = (times > pose_s[0]) & (times < pose_s[-1])
    if np.sum(inside) < 2.0 / GRID_S:
        return start
    acceleration = np.gradient(pose_velocity, GRID_S, axis=0)
    there, change = (
        np.column_stack([np.interp(times[inside], pose_s, column) for column in table.T])
        for table in (pose_velocity, acceleration)
    )
    error = _wheel_velocity(run, matrix, grid)[inside] - there
    knots = np.linspace(grid[0], grid[-1], max(2, round((grid[-1] - grid[0]) / KNOT_S) + 1))
    hats = np.column_stack([np.interp(grid[inside], knots, unit) for unit in np.eye(len(knots))])
    information = hats.T @ (hats * np.sum(change**2, axis=1)[:, None])
    mean_information = float(np.trace(information)) / len(knots)
    if mean_information <= 0.0:
        return start
    bends = np.diff(np.eye(len(knots)), 2, axis=0)
    before = start.lag(knots)
    normal = information + mean_information * (STIFFNESS * bends.T @ bends + 1e-3 * np.eye(len(knots)))
    right = hats.T @ np.sum(change * error, axis=1) - mean_information * STIFFNESS * bends.T @ (bends @ before)
    lag = before + np.linalg.solve(normal, right)
    left = error - change * (hats @ (lag - before))[:, None]
    independent = max(1.0, 2.0 * SMOOTHING_S * np.sqrt(np.pi) / GRID_S)
    covariance = np.linalg.inv(normal) * float(np.mean(left**2)) * independent
    return _described(knots, lag, covariance)


def _described(knots: Array, lag: Array, covariance: Array) -> Clock:
    """Return the clock with its mean, slope and warp."""
    centred = knots - knots.mean()
    rate = np.zeros(len(knots)) if np.ptp(knots) < LEAST_RATE_S else centred / np.sum(centred**2)
    mean = np.full(len(knots), 1.0 / len(knots))
    offset, slope = float(mean @ lag), float(rate @ lag)
    warp = float(np.max(np.abs(lag - offset - slope * centred)))
    spread = float(np.sqrt(mean @ covariance @ mean)), float(np.sqrt(rate @ covariance @ rate))
    return Clock(knots, lag, offset, spread[0], slope, spread[1], warp, measured=True)
