# SPDX-License-Identifier: MIT
"""What a drive returns: where the robot was, where it should have been, and how long it took."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.frames import Pose
from omniwheel.telemetry import Tracking

Array = NDArray[np.float64]
Progress = Callable[[Tracking], object]
"""Called with what the robot says of its pose while it drives."""


@dataclass(frozen=True, repr=False)
class Driven:
    """A drive that ended as it should.

    ``time_s`` (n,) is the robot's clock, ``poses`` (n, 3) are the estimated world poses then: x [m], y [m],
    theta [rad]. ``duration_s`` is how long the drive took on the program's clock.
    """

    time_s: Array
    poses: Array
    duration_s: float

    @property
    def pose(self) -> Pose:
        """The last pose; NaN if the robot said nothing meanwhile."""
        return Pose(*map(float, self.poses[-1])) if len(self.poses) else Pose(math.nan, math.nan, math.nan)

    @property
    def distance_m(self) -> float:
        """Length of the line through the poses [m]."""
        return float(np.hypot(*np.diff(self.poses[:, :2], axis=0).T).sum())

    @property
    def errors(self) -> Array | None:
        """Estimate minus reference (n, 3) [m, m, rad]; None of a drive with a velocity, which follows no poses."""
        return None

    @property
    def largest_error_m(self) -> float | None:
        """Largest distance between estimate and reference [m]; None of a drive with a velocity."""
        return None

    def __repr__(self) -> str:
        return f"<Driven: {self}>"

    def __str__(self) -> str:
        x, y, theta = self.pose
        return f"{self.distance_m:.3f} m in {self.duration_s:.1f} s, to x = {x:.3f} m, y = {y:.3f} m, {theta:.3f} rad"


@dataclass(frozen=True, repr=False)
class DrivenPath(Driven):
    """A drive to a pose, or along a path.

    ``references`` (n, 3) are the wanted world poses at ``time_s``, ``goal`` is where the drive should end; None if
    nothing said so.
    """

    references: Array
    goal: Pose | None = None

    @property
    def errors(self) -> Array:
        """Estimate minus reference (n, 3) [m, m, rad]."""
        error = self.poses - self.references
        error[:, 2] = np.remainder(error[:, 2] + math.pi, math.tau) - math.pi
        return error

    @property
    def largest_error_m(self) -> float:
        """Largest distance between estimate and reference [m]; NaN if the robot said nothing meanwhile."""
        errors = self.errors
        return float(np.hypot(errors[:, 0], errors[:, 1]).max()) if len(errors) else math.nan

    @property
    def overshoot_m(self) -> float:
        """How far the robot went past its goal, along the line from the first pose to it [m]; NaN without a goal."""
        if self.goal is None or not len(self.poses):
            return math.nan
        line = np.array(self.goal[:2]) - self.poses[0, :2]
        length = float(np.hypot(*line))
        along = (self.poses[:, :2] - self.poses[0, :2]) @ (line / length) if length > 0.0 else np.zeros(1)
        return max(0.0, float(along.max()) - length)


def driven(rows: Sequence[Tracking], duration_s: float) -> Driven:
    """Return what was driven with a velocity, from what the robot said meanwhile."""
    return Driven(*_times_and_poses(rows), duration_s)


def driven_path(rows: Sequence[Tracking], duration_s: float, goal: Pose | None) -> DrivenPath:
    """Return what was driven to a pose or along a path, from what the robot said meanwhile."""
    references = np.array([row.reference for row in rows], dtype=np.float64).reshape(-1, 3)
    return DrivenPath(*_times_and_poses(rows), duration_s, references, goal)


def _times_and_poses(rows: Sequence[Tracking]) -> tuple[Array, Array]:
    poses = np.array([row.pose for row in rows], dtype=np.float64).reshape(-1, 3)
    return np.array([row.time_s for row in rows]), poses
