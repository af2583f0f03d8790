# SPDX-License-Identifier: MIT
"""Finds a tag's corners to a fraction of a pixel: where the lines through its four black edges meet.

Each edge is looked at in many places, across it. A line through all of them is better than what can be seen at the
corner itself. Lines are straight only without the lens, so they are fitted to directions and not to pixels.
"""

from __future__ import annotations

import numpy as np

from omniwheel.mocap.camera.lens import Lens
from omniwheel.mocap.camera.library import Array, load_cv2

_FROM, _TO = 0.12, 0.88
"""The part of an edge that is looked at: the corners themselves are round."""
_STEP_PX = 0.25
_LEAST_CONTRAST = 12.0
"""Grey levels between black and white, of 255."""


def refined(picture: Array, corners: Array, cells: int, lens: Lens) -> Array | None:
    """Return the corners (4, 2) [px] that the edges of a tag with so many cells say; None if an edge is not there."""
    fine = [
        _edge_points(picture, corners[side], corners[(side + 1) % 4], np.mean(corners, axis=0), cells)
        for side in range(4)
    ]
    if any(points is None for points in fine):
        return None
    lines = [_line(lens.directions(points)) for points in fine if points is not None]
    meet = np.array([_meeting(lines[side - 1], lines[side]) for side in range(4)])
    if not np.isfinite(meet).all():
        return None
    return lens.project(np.column_stack([meet, np.ones(4)]), np.zeros(3), np.zeros(3))[0]


def _edge_points(picture: Array, start: Array, end: Array, middle: Array, cells: int) -> Array | None:
    """Return where the picture goes from black to white across this edge: (n, 2) [px]."""
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    outward = np.array([along[1], -along[0]])
    outward = outward if float(outward @ (0.5 * (start + end) - middle)) > 0.0 else -outward
    deep = 2.0 * abs(float(outward @ (0.5 * (start + end) - middle)))
    reach = float(np.clip(0.8 * deep / cells, 1.5, 6.0))
    offsets = np.arange(-reach, reach + 1e-9, _STEP_PX)
    places = np.linspace(_FROM, _TO, int(np.clip(length, 12, 80)))
    base = start + places[:, None] * (end - start)
    grid = base[:, None, :] + offsets[None, :, None] * outward
    cv2 = load_cv2()
    where = grid.astype(np.float32)
    levels = cv2.remap(picture, where[..., 0], where[..., 1], cv2.INTER_LINEAR, None, cv2.BORDER_REPLICATE).astype(
        float
    )
    return _crossings(levels, offsets, base, outward)


def _crossings(levels: Array, offsets: Array, base: Array, outward: Array) -> Array | None:
    dark, light = np.median(levels[:, :3]), np.median(levels[:, -3:])
    if light - dark < _LEAST_CONTRAST:
        return None
    # The area above the profile tells where a step of this height would be, however wide the blur is.
    share = np.clip((light - levels) / (light - dark), -0.2, 1.2)
    at = offsets[0] - 0.5 * _STEP_PX + _STEP_PX * share.sum(axis=1)
    good = np.abs(at - np.median(at)) < 1.0
    if good.sum() < 0.7 * len(at):
        return None
    return np.asarray(base[good] + at[good, None] * outward)


def _line(points: Array) -> tuple[Array, Array]:
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    return middle, axes[0]


def _meeting(one: tuple[Array, Array], other: tuple[Array, Array]) -> Array:
    (p, u), (q, v) = one, other
    across = u[0] * v[1] - u[1] * v[0]
    if abs(across) < 1e-6:
        return np.full(2, np.nan)
    d = q - p
    return np.asarray(p + (d[0] * v[1] - d[1] * v[0]) / across * u)
