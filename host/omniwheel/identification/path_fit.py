# SPDX-License-Identifier: MIT
"""Radii from paths beside their truth, and turning from headings: two linear fits and how their settings are chosen.

Both are drawn towards "all wheels and directions alike". How much is a setting. It is chosen by leaving out one of the
runs at hand at a time. A run that the fit as a whole is to be judged by has no part in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from omniwheel.errors import LogError
from omniwheel.logs.alignment import align, truth_at
from omniwheel.logs.log import Array, WheelLog

Item = TypeVar("Item")

RIDGES = (0.001, 0.003, 0.01, 0.03, 0.1)
"""Weights of "all alike" that are tried, as shares of the mean excitation."""
USUAL_RIDGE = 0.03
"""The weight where there are too few runs to choose one."""
LEAST_RUNS = 3
MAX_ROUNDS = 20
CONVERGED_M = 1e-5
TURN_WINDOW_S = 0.5
LEAST_TURN_RAD = 0.4
"""Windows with less turning say more of noise and drift than of the wheel distance."""


@dataclass(frozen=True)
class Settings:
    """What was chosen: the weight of "all alike" for the radii, and for turning (None: really all alike).

    ``counts``: whether the wheel filter trusts the counts as their likelihood says, or next to not at all.
    """

    ridge: float
    turn_ridge: float | None
    counts: bool


@dataclass(frozen=True)
class Rolled:
    """A run and its wheels' angles since the row before (n, 2 wheels) [rad], forward turning first."""

    log: WheelLog
    angle_rad: Array


def path_basis(rolled: Rolled, inverse: Array, heading: Array) -> Array:
    """Return g (n, 2, 2 wheels) [m per m of radius]: a wheel's forward or reverse path on a heading (n,) [rad]."""
    middle = 0.5 * (heading + np.concatenate((heading[:1], heading[:-1])))
    cosine, sine = np.cos(middle)[:, None], np.sin(middle)[:, None]
    wide = np.tile(inverse, 2)
    ahead, aside = rolled.angle_rad * wide[0], rolled.angle_rad * wide[1]
    return np.stack(
        [np.cumsum(cosine * ahead - sine * aside, axis=0), np.cumsum(sine * ahead + cosine * aside, axis=0)], axis=1
    )


def turned(rolled: Rolled, inverse: Array, gains: Array) -> Array:
    """Heading (n,) [rad] that the wheels tell, 0 at the first row; ``gains`` (2 wheels,): radius over distance."""
    heading = np.cumsum((rolled.angle_rad * np.tile(inverse[2], 2)) @ gains)
    return np.asarray(heading - heading[0])


def fit_turning(logs: Sequence[Rolled], inverse: Array, ridge: float | None) -> Array | None:
    """Radius over distance (2 wheels,) by which the wheels turn the body as the measured headings say.

    By least squares over windows in which the heading was measured all along. ``ridge`` None: one for all. Returns None
    if the robot hardly turned.
    """
    count = logs[0].angle_rad.shape[1]
    rows = np.ones((count, 1)) if ridge is None else np.eye(count)
    normal, right, turning = np.zeros((rows.shape[1],) * 2), np.zeros(rows.shape[1]), 0.0
    for rolled in logs:
        heading = rolled.log.heading_rad
        length = max(2, round(TURN_WINDOW_S / rolled.log.period_s))
        starts = np.arange(0, len(heading) - length, max(1, length // 2))
        unknown = np.concatenate(([0], np.cumsum(~np.isfinite(heading))))
        starts = starts[unknown[starts + length + 1] == unknown[starts]]
        angles = np.cumsum(rolled.angle_rad * np.tile(inverse[2], 2), axis=0) @ rows
        there, turn = angles[starts + length] - angles[starts], heading[starts + length] - heading[starts]
        normal += there.T @ there
        right += there.T @ turn
        turning += float(np.sum(np.abs(turn)[np.abs(turn) >= LEAST_TURN_RAD]))
    if turning < 2.0 * LEAST_TURN_RAD:
        return None
    found = rows @ np.linalg.solve(normal + _alike(normal, ridge or 0.0), right)
    return np.asarray(found) if np.all(found > 0.0) else None


def fit_radii(
    logs: Sequence[WheelLog], bases: Sequence[Array], mirrored: Sequence[bool], start: Array, ridge: float | None
) -> Array:
    """Radii (2 wheels,) [m], forward then reverse, by least squares and alignment in turn, from ``start``.

    ``ridge`` None: one radius for all. Raises LogError if a radius is negative.
    """
    rows = np.ones((len(start), 1)) if ridge is None else np.eye(len(start))
    count, radii = rows.shape[1], start
    for _ in range(MAX_ROUNDS):
        normal, right = np.zeros((count, count)), np.zeros(count)
        for log, basis, flip in zip(logs, bases, mirrored, strict=True):
            truth = log.require_truth()
            found = align(log.time_s, basis @ radii, truth, mirrored=flip)
            target = found.to_robot(truth_at(truth, log.time_s + found.offset_s))
            columns = ((basis - basis.mean(axis=0)) @ rows).reshape(-1, count)
            wanted = (target - target.mean(axis=0)).reshape(-1)
            normal += columns.T @ columns / len(target)
            right += columns.T @ wanted / len(target)
        new = rows @ np.linalg.solve(normal + _alike(normal, ridge or 0.0), right)
        if not np.all(new > 0.0):
            raise LogError(
                "the truth does not follow the wheels: a radius is negative",
                hint="check the wheels' order, bearings and signs, and that each truth belongs to its log",
            )
        change, radii = float(np.max(np.abs(new - radii))), new
        if change < CONVERGED_M:
            break
    return np.asarray(radii)


def choose_turning(runs: Sequence[Rolled], turns: Sequence[Rolled], inverse: Array) -> float | None:
    """Return the ridge with which runs left out are told their heading best; None: one gain for all."""
    if len(runs) < LEAST_RUNS:
        return None

    def error(ridge: float | None) -> float:
        square = 0.0
        for out, rolled in enumerate(runs):
            gains = fit_turning([*_others(runs, out), *turns], inverse, ridge)
            if gains is None:
                return np.inf
            off = turned(rolled, inverse, gains) - rolled.log.heading_rad
            square += float(np.var(off[np.isfinite(off)]))
        return square

    return min((None, *RIDGES), key=error)


def choose_ridge(
    logs: Sequence[WheelLog], bases: Sequence[Array], mirrored: Sequence[bool], start: Array
) -> tuple[float, float]:
    """Return the ridge with which runs left out are nearest to their truth, and their mean RMS distance [m]."""
    if len(logs) < LEAST_RUNS:
        return USUAL_RIDGE, 0.0

    errors = dict.fromkeys(RIDGES, 0.0)
    for index, log in enumerate(logs):
        others = _others(logs, index), _others(bases, index), _others(mirrored, index)
        radii = fit_radii(*others, start, None)
        for ridge in sorted(RIDGES, reverse=True):
            radii = fit_radii(*others, radii, ridge)
            found = align(log.time_s, bases[index] @ radii, log.require_truth(), mirrored=mirrored[index])
            errors[ridge] += found.rms_m / len(logs)
    best = min(errors, key=errors.__getitem__)
    return best, errors[best]


def _others(part: Sequence[Item], index: int) -> list[Item]:
    return [*part[:index], *part[index + 1 :]]


def _alike(normal: Array, ridge: float) -> Array:
    """What draws the unknowns of a fit towards their mean."""
    count = len(normal)
    return np.asarray(ridge * float(np.trace(normal)) / count * (np.eye(count) - np.full((count, count), 1.0 / count)))
