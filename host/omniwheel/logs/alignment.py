# SPDX-License-Identifier: MIT
"""Bring a path and a ground truth together: clock offset, rotation, shift, and a mirrored frame; never the scale.

The scale is only measured: a camera whose metre is wrong and wheels that are smaller than thought cannot be told apart.
Before its first and after its last row the truth is taken to stand still. Recordings begin and end at rest, and an
offset must not become good by leaving out what it cannot explain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omniwheel.errors import LogError
from omniwheel.limits import ALIGN_WITHIN_S
from omniwheel.logs.log import Array, Truth

LEAST_OVERLAP = 0.8
"""Share of the path that must lie within the truth's time."""
MIRROR_MARGIN = 0.8
"""A mirrored frame must fit this much better: a straight path fits both ways."""
_COARSE_S, _FINE_S = 0.1, 0.01
_COARSE_ROWS = 150


@dataclass(frozen=True)
class Alignment:
    """truth(t + offset_s) = rotation (mirrored path(t)) + shift.

    ``rms_m`` is the distance left between the two and ``overlap`` the share of the path within the truth's time.
    ``offset_low_s``, ``offset_high_s`` enclose the offsets whose RMS is within 5 % of the best. ``scale`` is the
    factor on the path that would fit best, and ``shape_rms_m`` the distance that would then be left.
    """

    offset_s: float
    offset_low_s: float
    offset_high_s: float
    rotation_rad: float
    mirrored: bool
    shift: tuple[float, float]
    scale: float
    rms_m: float
    shape_rms_m: float
    overlap: float

    def to_truth(self, xy: Array) -> Array:
        """Return a path (n, 2) of the robot in the truth's frame [m]."""
        return np.asarray(_mirror(xy, self.mirrored) @ _turn(self.rotation_rad).T + np.array(self.shift))

    def to_robot(self, xy: Array) -> Array:
        """Return points (n, 2) of the truth in the robot's frame [m]."""
        return _mirror(np.asarray((xy - np.array(self.shift)) @ _turn(self.rotation_rad)), self.mirrored)


def align(
    time_s: Array, xy: Array, truth: Truth, *, search_s: float | None = None, mirrored: bool | None = False
) -> Alignment:
    """Align a path (n, 2) at ``time_s`` (n,) with the truth; ``mirrored`` None: find out. Raises LogError.

    Clock offsets up to ``search_s`` are tried: None takes ALIGN_WITHIN_S, or 0 where the truth's clock is the robot's.
    """
    if search_s is None:
        search_s = 0.0 if truth.same_clock else ALIGN_WITHIN_S
    if mirrored is None:
        plain, mirror = (align(time_s, xy, truth, search_s=search_s, mirrored=flip) for flip in (False, True))
        return mirror if mirror.rms_m < MIRROR_MARGIN * plain.rms_m else plain
    path = _mirror(xy, mirrored)
    coarse = np.arange(-search_s, search_s + 0.5 * _COARSE_S, _COARSE_S)
    every = max(1, len(time_s) // _COARSE_ROWS)
    errors = _errors(time_s[::every], path[::every], truth, coarse)
    if not np.any(np.isfinite(errors)):
        problem = f"no clock offset within ±{search_s:g} s lets the truth cover {LEAST_OVERLAP:.0%} of the path"
        raise LogError(problem, hint="give the truth of this run, or a larger --search")
    best = coarse[int(np.argmin(errors))]
    reach = min(_COARSE_S, search_s)
    fine = best + np.arange(-reach, reach + 0.5 * _FINE_S, _FINE_S)
    fine_errors = _errors(time_s[:: max(1, every // 2)], path[:: max(1, every // 2)], truth, fine)
    offset = float(fine[int(np.argmin(fine_errors))])
    rms, shape, rotation, shift, scale = _fit(path, truth_at(truth, time_s + offset))
    near = np.concatenate((coarse[errors <= 1.05 * rms], fine[fine_errors <= 1.05 * rms], [offset]))
    return Alignment(
        offset_s=offset,
        offset_low_s=float(near.min()),
        offset_high_s=float(near.max()),
        rotation_rad=rotation,
        mirrored=mirrored,
        shift=(float(shift[0]), float(shift[1])),
        scale=scale,
        rms_m=rms,
        shape_rms_m=shape,
        overlap=float(covered(truth, time_s + offset).mean()),
    )


def truth_at(truth: Truth, time_s: Array) -> Array:
    """Position of the truth (n, 2) [m] at times of its own clock; standing still before and after."""
    return np.stack([np.interp(time_s, truth.time_s, truth.xy[:, axis]) for axis in (0, 1)], axis=1)


def covered(truth: Truth, time_s: Array) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which times lie within the truth's."""
    return np.asarray((time_s >= truth.time_s[0]) & (time_s <= truth.time_s[-1]))


def _errors(time_s: Array, path: Array, truth: Truth, offsets: Array) -> Array:
    """RMS distance for each clock offset (k,) after the best rotation and shift; infinite with too little overlap."""
    times = time_s + offsets[:, None]
    there = truth_at(truth, times.ravel()).reshape(*times.shape, 2)
    p, q = path - path.mean(axis=0), there - there.mean(axis=1, keepdims=True)
    along = np.einsum("ni,kni->k", p, q)
    across = np.einsum("n,kn->k", p[:, 0], q[:, :, 1]) - np.einsum("n,kn->k", p[:, 1], q[:, :, 0])
    square = (np.sum(p**2) + np.sum(q**2, axis=(1, 2)) - 2.0 * np.hypot(along, across)) / len(p)
    overlap = covered(truth, times).mean(axis=1)
    return np.where(overlap < LEAST_OVERLAP, np.inf, np.sqrt(np.maximum(square, 0.0)))


def _fit(path: Array, there: Array) -> tuple[float, float, float, Array, float]:
    """RMS without and with the factor on the path that fits best, rotation, shift, and that factor."""
    p, q = path - path.mean(axis=0), there - there.mean(axis=0)
    along = float(np.sum(p * q))
    across = float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]))
    rotation = float(np.arctan2(across, along))
    size = float(np.sum(p**2))
    square = (size + float(np.sum(q**2)) - 2.0 * np.hypot(along, across)) / len(p)
    shift = there.mean(axis=0) - path.mean(axis=0) @ _turn(rotation).T
    scale = float(np.hypot(along, across)) / size if size > 0.0 else 1.0
    shape = (float(np.sum(q**2)) - scale * float(np.hypot(along, across))) / len(p)
    rms, shape_rms = (float(np.sqrt(max(part, 0.0))) for part in (square, shape))
    return rms, shape_rms, rotation, np.asarray(shift), scale


def _turn(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _mirror(xy: Array, mirrored: bool) -> Array:
    return xy * np.array([1.0, -1.0]) if mirrored else xy
