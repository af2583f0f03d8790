# SPDX-License-Identifier: MIT
"""Effective wheel radii and wheel distance from encoders against motion capture.

As Borenstein and Feng's UMBmark, runs go both ways, so that what is wrong in one way only shows. Unlike there, whole
paths are compared. Runs are cut into windows. In each, odometry from the encoder angles is laid over the captured poses
with the best start pose. So noise of the poses stays in the residuals and never becomes a regressor, which would shrink
the answers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.estimate import Estimate, clustered_covariance
from omniwheel.identification.model import Layout

Array = NDArray[np.float64]

WINDOW_S = 4.0
MIN_FIXES = 8
MAX_STEPS = 10
SETTLED = 1e-4
"""Gauss-Newton ends with a step below this share: the paths are all but linear, the next one would be far smaller."""
_STEP = 1e-6
SHARE_MAX = 0.05
"""A radius or distance whose interval is wider than this share of it is not shown by the data."""


@dataclass(frozen=True)
class _Window:
    """Encoder increments (rows, wheels) [rad], rows before the fixes (m,) and how far beyond (m, 1), fixes (m, 3)."""

    increments_rad: Array
    row: NDArray[np.int64]
    share: Array
    pose: Array


def names(wheels: int) -> tuple[str, ...]:
    """Return the parameters' names: one radius per wheel and the distance."""
    return (*(f"wheel_{i + 1}_radius_m" for i in range(wheels)), "wheel_distance_m")


def calibrate(runs: Sequence[Dataset], layout: Layout) -> Estimate:
    """Return the effective radius of each wheel and the wheel distance. Raises IdentificationError."""
    windows = [window for run in runs for window in _windows(run)]
    wheels = len(layout.angle_rad)
    if len(windows) < wheels + 3:
        raise IdentificationError(
            f"pose fixes and encoder angles overlap in {len(windows)} windows of {WINDOW_S:g} s; "
            f"at least {wheels + 3} are needed",
            hint="log encoder counts and motion capture together for at least half a minute",
        )
    nominal = np.array([layout.radius_m] * wheels + [layout.distance_m])
    sd = np.ones(2)
    x = np.ones(len(nominal))
    for _ in range(MAX_STEPS):
        residual, slope, _ = _linearised(x, nominal, windows, layout, sd)
        step = np.linalg.lstsq(slope, residual, rcond=None)[0]
        x = x - step
        sd = sd * _noise(*_residual(x * nominal, windows, layout, sd)[:2])
        if np.max(np.abs(step)) < SETTLED:
            break
    residual, slope, cluster = _linearised(x, nominal, windows, layout, sd)
    for name, column in zip(names(wheels), slope.T, strict=True):
        if not np.any(column):
            raise _not_excited(name)
    covariance, dof = clustered_covariance(slope, residual, cluster)
    estimate = Estimate(names(wheels), x * nominal, covariance * np.outer(nominal, nominal), dof)
    for name in estimate.names:
        if not estimate.half_width(name) < SHARE_MAX * abs(estimate[name]):
            raise _not_excited(name)
    return estimate


def _linearised(
    x: Array, nominal: Array, windows: Sequence[_Window], layout: Layout, sd: Array
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return residuals, their slope by parameters in units of ``nominal``, and their windows."""
    residual, _, cluster = _residual(x * nominal, windows, layout, sd)
    moved = [_residual((x + _STEP * unit) * nominal, windows, layout, sd)[0] for unit in np.eye(len(nominal))]
    return residual, (np.array(moved) - residual).T / _STEP, cluster


def _not_excited(name: str) -> IdentificationError:
    what = "the robot does not turn" if name == "wheel_distance_m" else "the robot does not move along x and y"
    return IdentificationError(
        f"{name} cannot be identified from these runs: {what} enough, or poses have no heading",
        hint="drive circles and spins both ways in view of the motion capture",
    )


def _windows(run: Dataset) -> list[_Window]:
    if run.wheel_angle_rad is None or len(run.pose_time_s) == 0:
        return []
    windows = []
    rows = max(2, round(WINDOW_S / run.period_s))
    heading = run.pose[:, 2].copy()
    known = np.isfinite(heading)
    heading[known] = np.unwrap(heading[known])
    pose = np.column_stack((run.pose[:, :2], heading))
    for first in range(0, len(run.time_s) - rows, rows):
        times = run.time_s[first : first + rows + 1]
        inside = (run.pose_time_s >= times[0]) & (run.pose_time_s <= times[-1])
        moved = np.diff(run.wheel_angle_rad[first : first + rows + 1], axis=0)
        if np.sum(inside) >= MIN_FIXES and np.all(np.isfinite(moved)):
            place = np.interp(run.pose_time_s[inside], times, np.arange(rows + 1))
            row = np.minimum(place.astype(np.int64), rows - 1)
            windows.append(_Window(moved, row, (place - row)[:, None], pose[inside]))
    return windows


def body_per_wheel(values: Array, angle_rad: Array) -> Array:
    """Return the matrix (wheels, 3) that makes body motion [m, m, rad] of wheel increments; values: radii, distance."""
    rows = np.column_stack((-np.sin(angle_rad), np.cos(angle_rad), np.full(len(angle_rad), values[-1])))
    matrix: Array = values[:-1, None] * np.linalg.pinv(rows).T
    return matrix


def odometry(increments_rad: Array, to_body: Array) -> Array:
    """Return poses (rows + 1, 3) from wheel increments (rows, wheels) and :func:`body_per_wheel`, starting at zero."""
    body = increments_rad @ to_body
    theta = np.concatenate(([0.0], np.cumsum(body[:, 2])))
    middle = 0.5 * (theta[:-1] + theta[1:])
    dx = np.cos(middle) * body[:, 0] - np.sin(middle) * body[:, 1]
    dy = np.sin(middle) * body[:, 0] + np.cos(middle) * body[:, 1]
    return np.column_stack((np.concatenate(([0.0], np.cumsum(dx))), np.concatenate(([0.0], np.cumsum(dy))), theta))


def _residual(
    values: Array, windows: Sequence[_Window], layout: Layout, sd: Array
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return residuals in units of ``sd`` (position [m], heading [rad]), which are headings, and the window of each."""
    parts, kinds, clusters = [], [], []
    to_body = body_per_wheel(values, layout.angle_rad)
    for number, window in enumerate(windows):
        path = odometry(window.increments_rad, to_body)
        at_fix = path[window.row] + window.share * (path[window.row + 1] - path[window.row])
        position, heading = _laid_over(at_fix, window.pose, sd)
        parts += [position / sd[0], heading / sd[1]]
        kinds += [np.zeros(len(position)), np.ones(len(heading))]
        clusters.append(np.full(len(position) + len(heading), number))
    return np.concatenate(parts), np.concatenate(kinds), np.concatenate(clusters)


def _laid_over(path: Array, pose: Array, sd: Array) -> tuple[Array, Array]:
    """Return what is left of positions (2 m,) and known headings after the best rotation and shift of the path."""
    known = np.isfinite(pose[:, 2])
    turn_from_heading = float(np.mean(pose[known, 2] - path[known, 2])) if np.any(known) else 0.0
    p = (path[:, 0] + 1j * path[:, 1]) * np.exp(1j * turn_from_heading)
    z = pose[:, 0] + 1j * pose[:, 1]
    p, z = p - p.mean(), z - z.mean()
    information = float(np.sum(np.abs(p) ** 2)) / sd[0] ** 2
    extra = float(np.angle(np.sum(np.conj(p) * z))) if information > 0.0 else 0.0
    extra *= information / (information + np.sum(known) / sd[1] ** 2)
    left = z - p * np.exp(1j * extra)
    heading = pose[known, 2] - path[known, 2] - turn_from_heading - extra
    return np.concatenate((left.real, left.imag)), heading


def _noise(residual: Array, kind: Array) -> Array:
    """Return the standard deviation of positions and headings; 1 where there are none or they fit exactly."""
    return np.array([np.std(residual[kind == k]) or 1.0 if np.any(kind == k) else 1.0 for k in (0.0, 1.0)])
