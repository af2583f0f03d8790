# SPDX-License-Identifier: MIT
"""Which poses are no measurement: the rules of the robot's firmware (firmware/app/services/pose_fixes.cpp).

The original robot has no firmware of ours that would check them, so the host does. What the wheels were told takes the
place of what they did.
"""

from __future__ import annotations

import math

from omniwheel.frames import Pose
from omniwheel.mocap.source import MocapPose

FROZEN_TRAVEL = 0.005
"""Further than this [m or rad] no sensor, however coarse, measures the same pose twice."""
MOST_ZERO_OFFSET = 0.02
"""As far [m, rad] from the estimate, three exact zeros are no measurement."""
MOST_SD_XY_M = 1.0


class FixChecks:
    """Looks at poses before the filter takes them."""

    def __init__(self) -> None:
        self._last: Pose | None = None
        self._travelled = 0.0

    def moved(self, distance: float) -> None:
        """Take note of how far [m or rad] the wheels should have moved the robot."""
        self._travelled += distance

    def refusal(self, measured: MocapPose, estimate: Pose | None) -> str:
        """Return why a pose is no measurement, "" for one that may be. ``estimate``: None before the first fix."""
        pose = measured.pose
        if not all(math.isfinite(value) for value in pose):
            return "not finite"
        if measured.sd_xy_m > MOST_SD_XY_M:
            return "its error may be metres"
        if estimate is not None and _zeros_far_from(estimate, pose):
            return "it is all zeros, as from a tracker without sight"
        if pose != self._last:
            self._travelled = 0.0
        self._last = pose
        return "it repeats itself" if self._travelled > FROZEN_TRAVEL else ""


def _zeros_far_from(estimate: Pose, pose: Pose) -> bool:
    near = max(abs(estimate.x), abs(estimate.y), abs(math.remainder(estimate.theta, math.tau))) <= MOST_ZERO_OFFSET
    return tuple(pose) == (0.0, 0.0, 0.0) and not near
