# SPDX-License-Identifier: MIT
"""What every stream of motion-capture poses looks like."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from omniwheel.frames import Pose


@dataclass(frozen=True)
class MocapPose:
    """One measured world pose: x, y [m], theta [rad, -pi..pi, counter-clockwise].

    ``taken_s`` is when the cameras saw it and ``arrived_s`` when this computer had it, both on the source's clock.
    ``frame`` is the stream's own number of the frame. The standard deviations are those of x and of y, and of theta;
    0: the source does not know them.
    """

    pose: Pose
    taken_s: float
    arrived_s: float
    frame: int
    sd_xy_m: float = 0.0
    sd_theta_rad: float = 0.0


class MocapSource(Protocol):
    """A stream of poses. Occluded frames do not come out of it; what does come is finite."""

    name: str

    def clock(self) -> float:
        """Return the present time [s] on the clock of the poses' stamps."""
        ...

    def read(self, timeout_s: float) -> MocapPose | None:
        """Return the next pose, waiting up to ``timeout_s`` for it; None if there is none. Raises MocapError."""
        ...

    @property
    def ended(self) -> bool:
        """Whether no pose will ever come again."""
        ...

    def close(self) -> None:
        """Close; harmless when closed already."""
        ...


def newest(source: MocapSource, timeout_s: float) -> tuple[MocapPose | None, int]:
    """Return the newest pose that is there, waiting for the first, and how many older ones it has overtaken."""
    pose = source.read(timeout_s)
    overtaken = -1
    latest = None
    while pose is not None:
        latest, overtaken = pose, overtaken + 1
        pose = source.read(0.0)
    return latest, max(0, overtaken)
