# SPDX-License-Identifier: MIT
"""Streams of motion-capture poses by name.

==========================  ==========================================================================
``vicon:HOST/OBJECT``       Vicon DataStream server and the object's name in Tracker or Nexus
``natnet:HOST/OBJECT``      OptiTrack's Motive and the rigid body's name there; HOST:PORT if its port is not 1510
``camera:FILE``             a webcam that sees tags; FILE is the camera file (the extra ``vision``)
``recorded:FILE``           a file of ``omni mocap record``, replayed with its own time stamps
``simulated``               a robot that drives a circle, with noise, latency and drop-outs
==========================  ==========================================================================
"""

from __future__ import annotations

from pathlib import Path

from omniwheel.errors import MocapSourceError
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.mocap.camera.source import open_camera
from omniwheel.mocap.natnet import NatNetSource
from omniwheel.mocap.recorded import RecordedSource
from omniwheel.mocap.simulated import SimulatedSource
from omniwheel.mocap.source import MocapSource
from omniwheel.mocap.vicon import ViconSource

ALLOWED = "use vicon:HOST/OBJECT, natnet:HOST/OBJECT, camera:FILE, recorded:FILE or simulated"


def open_source(name: str, *, seed: int = 1, timeout_s: float = DEFAULT_TIMEOUT_S) -> MocapSource:
    """Open the stream that ``name`` means, in real time. ``seed`` is the simulated one's. Raises MocapError."""
    kind, _, place = name.partition(":")
    if kind in ("vicon", "natnet"):
        host, slash, subject = place.partition("/")
        if not (host and slash and subject):
            raise MocapSourceError(f"cannot understand {name!r}: it lacks a host or an object", hint=ALLOWED)
        return _open_system(kind, host, subject, timeout_s)
    if kind == "camera" and place:
        return open_camera(name, Path(place))
    if kind == "recorded" and place:
        return RecordedSource(Path(place))
    if name == "simulated":
        return SimulatedSource(seed=seed)
    raise MocapSourceError(f"cannot understand the motion-capture stream {name!r}", hint=ALLOWED)


def _open_system(kind: str, host: str, subject: str, timeout_s: float) -> MocapSource:
    if kind == "vicon":
        return ViconSource(host, subject, timeout_s=timeout_s)
    host, colon, port = host.partition(":")
    if not colon:
        return NatNetSource(host, subject, timeout_s=timeout_s)
    if not (host and port.isdecimal() and len(port) <= 5 and 0 < int(port) < 2**16):
        raise MocapSourceError(f"{port!r} is not a port; must be from 1 to 65535", hint=ALLOWED)
    return NatNetSource(host, subject, port=int(port), timeout_s=timeout_s)
