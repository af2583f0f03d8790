# SPDX-License-Identifier: MIT
"""Least squares on windows: each window becomes a quadratic in the odometry matrix, every model is fitted to their sum.

A window counts as three measurements (x, y, heading; two without headings), however many poses are in it: those of one
window share their errors. Windows with far larger residuals than the others count less (Huber).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import LogError
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.pose_fit.wheel_model import Array, Model, WheelModel
from omniwheel.identification.pose_fit.windows import UNKNOWN_HEADING_SD_RAD, Window, linearised

MAX_ROUNDS = 8
MAX_STEPS = 30
CONVERGED = 1e-4
"""Largest change of a parameter, in prior standard deviations, at which the fit ends."""
RESCALED = 0.01
"""Largest relative change of the residuals' standard deviations at which the fit ends."""
LEAST_SD = np.array([5e-4, 5e-4, 5e-4])
START_SD = np.array([2e-3, 2e-3, 3e-3])
"""Standard deviation of a measured start pose [m, m, rad]."""
START_SD_POSITIONS = np.array([*START_SD[:2], UNKNOWN_HEADING_SD_RAD])
LEAST_CLUSTERS = 10
"""Runs that intervals clustered by runs need."""
HUBER = 2.0
"""Windows with residuals above this many times the median's are weighted down."""


@dataclass(frozen=True)
class Quadratics:
    """Per window (s): cost = constant - 2 gradient . d + d . curvature d with d = matrix - ``matrix`` (flattened)."""

    matrix: Array
    run: Array
    curvature: Array
    gradient: Array
    constant: Array

    def of_runs(self, runs: Sequence[int]) -> tuple[Array, Array]:
        """Return curvature (q, q) and gradient (q,) summed over the windows of these runs."""
        chosen = np.isin(self.run, runs)
        return self.curvature[chosen].sum(axis=0), self.gradient[chosen].sum(axis=0)

    def cost(self, matrix: Array, runs: Sequence[int]) -> float:
        """Return the mean cost of a window of these runs with another odometry matrix."""
        chosen = np.isin(self.run, runs)
        change = (matrix - self.matrix).ravel()
        costs = (
            self.constant[chosen]
            - 2.0 * self.gradient[chosen] @ change
            + np.einsum("i,sij,j->s", change, self.curvature[chosen], change)
        )
        return float(np.mean(costs))


@dataclass(frozen=True)
class Fit:
    """Parameters ``values`` (p,) of a model, their ``covariance`` (p, p) and the mask ``free`` (p,) of those fitted."""

    model: Model
    values: Array
    covariance: Array
    free: NDArray[np.bool_]
    matrix: Array


def linearise(windows: Sequence[Window], matrix: Array, sd: Array) -> tuple[Quadratics, Array]:
    """Return the windows' quadratics at a matrix, and the standard deviations (3,) of their residuals."""
    size = matrix.size
    count = len(windows)
    curvature, gradient = np.zeros((count, size, size)), np.zeros((count, size))
    constant, spread, measured = np.zeros(count), np.zeros((count, 3)), np.zeros(count, dtype=bool)
    for index, window in enumerate(windows):
        residual, slope, start = linearised(window, matrix)
        headings = bool(np.isfinite(window.start[2]))
        prior = np.diag(1.0 / (START_SD if headings else START_SD_POSITIONS) ** 2)
        scale = 1.0 / (sd * np.sqrt(len(residual)))
        e = (residual * scale).ravel()
        a = (slope * scale[:, None]).reshape(len(e), size)
        b = (start * scale[:, None]).reshape(len(e), 3)
        eliminated = np.linalg.solve(b.T @ b + prior, np.column_stack((b.T @ a, b.T @ e)))
        a_left, e_left = a - b @ eliminated[:, :-1], e - b @ eliminated[:, -1]
        curvature[index], gradient[index] = a.T @ a_left, a.T @ e_left
        constant[index] = e @ e_left
        spread[index] = np.mean(residual**2, axis=0)
        measured[index] = headings
    weight = _weights(constant)
    every = np.sqrt(np.average(spread, axis=0, weights=weight))
    every[2] *= np.sqrt(np.sum(weight) / max(np.sum(weight[measured]), 1e-12)) if np.any(measured) else 0.0
    position = np.hypot(every[0], every[1]) / np.sqrt(2.0)
    quadratics = Quadratics(
        matrix,
        np.array([window.run for window in windows]),
        curvature * weight[:, None, None],
        gradient * weight[:, None],
        constant * weight,
    )
    return quadratics, np.maximum(np.array([position, position, every[2]]), LEAST_SD)


def fit_quadratics(
    quadratics: Quadratics,
    runs: Sequence[int],
    layout: WheelModel,
    model: Model,
    start: Array,
    held: Sequence[str] = (),
) -> Fit:
    """Fit a model to the quadratics of some runs by Gauss-Newton from ``start`` (p,)."""
    curvature, gradient = quadratics.of_runs(runs)
    free = layout.free(model, held)
    nominal = layout.nominal
    prior = 1.0 / layout.prior_sd[free] ** 2
    values = np.where(free, start, nominal)
    for _ in range(MAX_STEPS):
        slope = layout.slope(values)[:, free]
        change = (layout.matrix(values) - quadratics.matrix).ravel()
        normal = slope.T @ curvature @ slope + np.diag(prior)
        right = slope.T @ (gradient - curvature @ change) + prior * (nominal - values)[free]
        step = np.linalg.solve(normal, right)
        values[free] += step
        if np.max(np.abs(step) / layout.prior_sd[free]) < 0.1 * CONVERGED:
            break
    if not np.all(values[: layout.wheels] > 0.0):
        raise LogError(
            "the poses do not follow the wheels: a radius is negative",
            hint="check the wheels' order, bearings and signs, and that each truth belongs to its log",
        )
    covariance = np.zeros((len(values),) * 2)
    covariance[np.ix_(free, free)] = np.linalg.inv(normal)
    return Fit(model, values, covariance, free, layout.matrix(values))


def fit_windows(
    windows: Sequence[Window], layout: WheelModel, model: Model, held: Sequence[str] = (), start: Array | None = None
) -> tuple[Fit, Quadratics, Array]:
    """Fit a model to windows, from the nominal geometry or ``start``; also the quadratics there and residuals' sd (3,).

    Raises LogError where the poses contradict the wheels.
    """
    values = layout.nominal if start is None else start
    runs = sorted({window.run for window in windows})
    sd = np.array([0.05, 0.05, 0.05])
    for _ in range(MAX_ROUNDS):
        quadratics, new_sd = linearise(windows, layout.matrix(values), sd)
        fit = fit_quadratics(quadratics, runs, layout, model, values, held)
        change = float(np.max(np.abs(fit.values - values) / layout.prior_sd))
        rescaled = float(np.max(np.abs(new_sd / sd - 1.0)))
        values, sd = fit.values, new_sd
        if change < CONVERGED and rescaled < RESCALED:
            break
    return fit, quadratics, sd


def _weights(cost: Array) -> Array:
    """Weights (s,) of Huber's kind from each window's cost."""
    size = np.sqrt(np.maximum(cost, 0.0))
    usual = float(np.median(size))
    return np.asarray(np.minimum(1.0, HUBER * usual / np.maximum(size, 1e-12))) if usual > 0.0 else np.ones(len(cost))


def estimate(fit: Fit, quadratics: Quadratics, layout: WheelModel) -> Estimate:
    """Return the fitted parameters with intervals: the wider of the model's own and of one clustered by runs.

    With fewer runs than LEAST_CLUSTERS the clusters are the windows. A turn of all wheels counts as tracked heading and
    what all levers have in common as distance and tracked point, so that each number is one that was measured.
    """
    free = np.flatnonzero(fit.free)
    slope = layout.slope(fit.values)[:, free]
    change = (fit.matrix - quadratics.matrix).ravel()
    score = (quadratics.gradient - quadratics.curvature @ change) @ slope
    by_run = len(np.unique(quadratics.run)) >= LEAST_CLUSTERS
    cluster = np.unique(quadratics.run, return_inverse=True)[1] if by_run else np.arange(len(score))
    count = int(cluster.max()) + 1
    summed = np.zeros((count, len(free)))
    np.add.at(summed, cluster, score)
    bread = fit.covariance[np.ix_(free, free)]
    sandwich = bread @ (summed.T @ summed) @ bread * (count / max(1, count - 1))
    to_names = _separated(layout)[:, free]
    own, clustered = (to_names @ each @ to_names.T for each in (bread, sandwich))
    wider = np.sqrt(np.maximum(1.0, np.diag(clustered) / np.maximum(np.diag(own), 1e-30)))
    covariance = own * np.outer(wider, wider)
    values = layout.nominal + _separated(layout) @ (fit.values - layout.nominal)
    shown = [index for index in free if own[index, index] > (1e-6 * layout.prior_sd[index]) ** 2]
    names = tuple(layout.names[index] for index in shown)
    return Estimate(names, values[shown], covariance[np.ix_(shown, shown)], float(max(1, count - 1)))


def _separated(layout: WheelModel) -> Array:
    """Return the matrix (p, p) that moves what the angles or the levers have in common to the plain parameters."""
    n = layout.wheels
    move = np.eye(4 * n + 5)
    angle, lever = slice(n + 4, 2 * n + 4), slice(2 * n + 4, 3 * n + 4)
    move[n + 3, angle] = -1.0 / n
    move[angle, angle] -= 1.0 / n
    common = np.column_stack((np.ones(n), -np.cos(layout.bearing_rad), -np.sin(layout.bearing_rad)))
    to_plain = np.linalg.pinv(common)
    move[n : n + 3, lever] = to_plain
    move[lever, lever] -= common @ to_plain
    return move
