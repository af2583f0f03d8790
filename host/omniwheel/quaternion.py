# SPDX-License-Identifier: MIT
"""What a measured quaternion says of a robot on the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_UNIT_TOLERANCE = 0.01
"""Deviation of the length from 1: exports are rounded."""


def heading(quaternion: Sequence[float]) -> float:
    """Return the turn about z [rad, -pi..pi] of a quaternion (w, x, y, z); NaN if it has no direction."""
    w, x, y, z = (float(value) for value in quaternion)
    norm2 = w * w + x * x + y * y + z * z
    if not (math.isfinite(norm2) and norm2 > 0.0):
        return math.nan
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def tilt(quaternion: Sequence[float]) -> float:
    """Return the angle [rad, 0..pi] between z before and after the turn (w, x, y, z); NaN if it has no direction."""
    w, x, y, z = (float(value) for value in quaternion)
    norm2 = w * w + x * x + y * y + z * z
    if not (math.isfinite(norm2) and norm2 > 0.0):
        return math.nan
    return math.acos(max(-1.0, min(1.0, (w * w - x * x - y * y + z * z) / norm2)))


def find_wrong_length(quaternions: NDArray[np.float64]) -> tuple[int, float] | None:
    """Return row and length of the quaternion (n, 4) that is least a rotation; None if all lengths are about 1."""
    length = np.linalg.norm(quaternions, axis=1)
    worst = int(np.argmax(np.abs(length - 1.0)))
    return (worst, float(length[worst])) if abs(length[worst] - 1.0) > _UNIT_TOLERANCE else None
