# SPDX-License-Identifier: MIT
"""What a motion-capture system's quaternion says of a robot on the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence


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
