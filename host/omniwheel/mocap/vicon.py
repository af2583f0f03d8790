# SPDX-License-Identifier: MIT
"""Vicon DataStream, through the library ``pyvicon-datastream`` (the extra ``vicon``).

Vicon gives millimetres, a quaternion, and for each frame the latency since the cameras saw it [s]. The library's
``get_frame`` waits for up to a second while it holds Python's interpreter lock. In that time no thread of the process
could stop a robot. :class:`ViconSource` therefore keeps it in a process of its own.
"""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from omniwheel.errors import MocapLibraryError, MocapLostError, MocapSourceError
from omniwheel.frames import Pose
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.mocap.reader import ProcessSource
from omniwheel.mocap.source import MocapPose
from omniwheel.quaternion import heading

LIBRARY = "pyvicon_datastream"
_MM = 1e-3
_SUBJECTS_SHOWN = 20


def load_library() -> Any:
    """Return the library; MocapLibraryError if it is not installed or its native part does not load."""
    try:
        return importlib.import_module(LIBRARY)
    except ImportError as error:
        hint = "pip install 'omniwheel[vicon]' (compiles Vicon's SDK: needs a C++ compiler and the internet)"
        raise MocapLibraryError(f"the Vicon library {LIBRARY} is not usable here: {error}", hint=hint) from error


class ViconStream:
    """The library as a stream of poses, in this process: :meth:`read` blocks for up to a second.

    ``library`` is the module (or one like it), ``clock`` gives the stamps.
    """

    def __init__(self, host: str, subject: str, *, library: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self.host = host
        self.subject = subject
        self.occluded = 0
        self.connections = 0
        self._library = library
        self._clock = clock
        self._client = library.PyViconDatastream()
        self._segment: str | None = None
        self._last_frame: int | None = None

    def connect(self) -> None:
        """Connect and ask for the segments, each frame pushed as it comes, x forward, y left, z up."""
        v = self._library
        result = self._client.connect(self.host)
        if result not in (v.Result.Success, v.Result.ClientAlreadyConnected):
            hint = "check that Tracker or Nexus is running and port 801 is reachable"
            raise MocapLostError(f"no Vicon DataStream at {self.host}: {result.name}", hint=hint)
        steps = (
            self._client.enable_segment_data(),
            self._client.set_stream_mode(v.StreamMode.ServerPush),
            self._client.set_axis_mapping(v.Direction.Forward, v.Direction.Left, v.Direction.Up),
        )
        if any(step != v.Result.Success for step in steps):
            names = ", ".join(step.name for step in steps)
            raise MocapLostError(f"the Vicon server {self.host} rejected required settings: {names}")
        self.connections += 1
        self._segment = None

    def read(self) -> MocapPose | None:
        """Return the next frame's pose; None if the object is occluded or no frame came. Raises MocapLostError."""
        result = self._client.get_frame()
        if result == self._library.Result.NotConnected:
            raise MocapLostError(f"the Vicon server {self.host} closed the stream")
        if result != self._library.Result.Success:
            return None
        arrived_s = self._clock()
        frame = int(self._client.get_frame_number())
        if frame == self._last_frame:
            return None
        self._last_frame = frame
        pose = self._pose()
        if pose is None:
            self.occluded += 1
            return None
        return MocapPose(pose, arrived_s - self._latency_s(), arrived_s, frame)

    def _latency_s(self) -> float:
        latency_s = float(self._client.get_latency_total())
        return latency_s if math.isfinite(latency_s) and latency_s > 0.0 else 0.0

    def _pose(self) -> Pose | None:
        segment = self._root_segment()
        position = self._client.get_segment_global_translation(self.subject, segment)
        rotation = self._client.get_segment_global_quaternion(self.subject, segment)
        if position is None or rotation is None:
            return None
        pose = Pose(float(position[0]) * _MM, float(position[1]) * _MM, heading(rotation))
        return pose if all(math.isfinite(value) for value in pose) else None

    def _root_segment(self) -> str:
        if self._segment is None:
            name = self._client.get_subject_root_segment_name(self.subject)
            if name is None:
                raise self._unknown_subject()
            self._segment = str(name)
        return self._segment

    def _unknown_subject(self) -> MocapSourceError:
        count = min(int(self._client.get_subject_count()), _SUBJECTS_SHOWN)
        names = [str(self._client.get_subject_name(index)) for index in range(count)]
        hint = f"it has {', '.join(names)}" if names else "it has no objects: enable one in Tracker"
        return MocapSourceError(f"the Vicon server {self.host} has no object {self.subject!r}", hint=hint)

    def close(self) -> None:
        """Disconnect."""
        self._client.disconnect()


class ViconSource(ProcessSource):
    """A Vicon stream as a :class:`~omniwheel.mocap.source.MocapSource`; connects again by itself when it was lost.

    Starts a process: see :class:`~omniwheel.mocap.reader.ProcessSource`. Raises MocapLibraryError, MocapSourceError (no
    such object) or MocapLostError (not reachable within ``timeout_s``).
    """

    def __init__(self, host: str, subject: str, *, timeout_s: float = DEFAULT_TIMEOUT_S) -> None:
        super().__init__(f"vicon:{host}/{subject}", partial(_open, host, subject), timeout_s=timeout_s)


def _open(host: str, subject: str) -> ViconStream:
    return ViconStream(host, subject, library=load_library())
