# SPDX-License-Identifier: MIT
"""What every stream of motion-capture poses looks like, and how one is named.

==========================  ==========================================================================
``vicon:HOST/OBJECT``       Vicon DataStream server and the object's name in Tracker or Nexus
``recorded:FILE``           a file of ``omni mocap record``, replayed with its own time stamps
``simulated``               a robot that drives a circle, with noise, latency and drop-outs
==========================  ==========================================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from omniwheel.errors import MocapSourceError
from omniwheel.frames import Pose

ALLOWED = "allowed are vicon:HOST/OBJECT, recorded:FILE, simulated"
DEFAULT_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class MocapPose:
    """One measured world pose: x, y [m], theta [rad, -pi..pi, counter-clockwise].

    ``taken_s`` is when the cameras saw it and ``arrived_s`` when this computer had it, both on the source's clock;
    ``frame`` is the stream's own number of the frame.
    """

    pose: Pose
    taken_s: float
    arrived_s: float
    frame: int


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


def open_source(name: str, *, seed: int = 1, timeout_s: float = DEFAULT_TIMEOUT_S) -> MocapSource:
    """Open the stream that ``name`` means, in real time. ``seed`` is the simulated one's. Raises MocapError."""
    kind, _, place = name.partition(":")
    if kind == "vicon":
        host, slash, subject = place.partition("/")
        if not (host and slash and subject):
            raise MocapSourceError(f"cannot understand {name!r}: a host and an object are needed", hint=ALLOWED)
        from omniwheel.mocap.vicon import ViconSource

        return ViconSource(host, subject, timeout_s=timeout_s)
    if kind == "recorded" and place:
        from omniwheel.mocap.recorded import RecordedSource

        return RecordedSource(Path(place))
    if name == "simulated":
        from omniwheel.mocap.simulated import SimulatedSource

        return SimulatedSource(seed=seed)
    raise MocapSourceError(f"cannot understand the motion-capture stream {name!r}", hint=ALLOWED)
