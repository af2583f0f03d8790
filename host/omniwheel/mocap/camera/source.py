# SPDX-License-Identifier: MIT
"""A camera's poses as a :class:`~omniwheel.mocap.source.MocapSource`, ``camera:FILE``."""

from __future__ import annotations

import math
import queue
import threading
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from omniwheel.errors import MocapError
from omniwheel.mocap.camera.frames import Frame, Frames, LiveFrames, open_frames
from omniwheel.mocap.camera.geometry import Located
from omniwheel.mocap.camera.watch import Look, Watcher, open_watcher
from omniwheel.mocap.source import MocapPose

_FROZEN = "repeated picture: the camera hangs"
_NOT_LATER = "its time stamp is not after the last picture's"
UNSEEN_XY_M, UNSEEN_THETA_RAD, UNSEEN_TIME_S = 0.002, 0.003, 0.005
"""What no picture says of itself: errors of lens, print and mounting, blur, and how far its time is off."""
_LONGEST_GAP_S = 0.5
"""Poses further apart do not tell how fast the robot is."""


def claim(found: Located, speed_m_s: float, rate_rad_s: float) -> tuple[float, float]:
    """Return the standard deviations that the robot is told of a pose [m, rad], at this speed.

    Larger than what the corners in the picture say: a filter that is told too little refuses the next fixes.
    """
    return (
        math.hypot(found.sd_xy_m, UNSEEN_XY_M, UNSEEN_TIME_S * speed_m_s),
        math.hypot(found.sd_theta_rad, UNSEEN_THETA_RAD, UNSEEN_TIME_S * rate_rad_s),
    )


class CameraSource:
    """Looks at each picture of ``frames``. A camera's pictures are looked at in a thread, stored ones in :meth:`read`.

    ``latency_s`` is how old a picture is when its time is taken; ``clock`` tells the frames' time. A picture that is
    not later than the one before, or the very same, gives no pose.
    """

    def __init__(
        self,
        name: str,
        frames: Frames,
        watcher: Watcher,
        *,
        latency_s: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.name = name
        self.reasons: dict[str, int] = {}
        self._frames = frames
        self._watcher = watcher
        self._latency_s = latency_s
        self._clock = clock
        self._last_s: float | None = None
        self._before: MocapPose | None = None
        self._last_print: int | None = None
        self._poses: queue.SimpleQueue[MocapPose | MocapError] = queue.SimpleQueue()
        self._closing = False
        self._thread: threading.Thread | None = None
        if isinstance(frames, LiveFrames):
            self._thread = threading.Thread(target=self._serve, name="camera poses", daemon=True)
            self._thread.start()

    def clock(self) -> float:
        """Return the present time [s]."""
        return self._clock()

    @property
    def ended(self) -> bool:
        """Whether no picture will come again."""
        return self._frames.ended

    def read(self, timeout_s: float) -> MocapPose | None:
        """Return the next pose. Raises MocapLostError if the camera is gone."""
        if self._thread is None:
            return self._next(timeout_s)
        try:
            said = self._poses.get(timeout=timeout_s) if timeout_s > 0.0 else self._poses.get_nowait()
        except queue.Empty:
            return None
        if isinstance(said, MocapError):
            raise said
        return said

    def close(self) -> None:
        """Close the camera."""
        self._closing = True
        if self._thread is not None:
            self._thread.join(3.0)
        self._frames.close()

    def look(self, frame: Frame) -> Look:
        """Return what a picture shows, unless it is the last one again."""
        mark = zlib.crc32(frame.picture.tobytes())
        late = self._last_s is not None and frame.taken_s <= self._last_s
        frozen = mark == self._last_print
        if late or frozen:
            return Look(None, _FROZEN if frozen else _NOT_LATER)
        self._last_s, self._last_print = frame.taken_s, mark
        return self._watcher.look(frame.picture)

    def _next(self, timeout_s: float) -> MocapPose | None:
        frame = self._frames.read(timeout_s)
        if frame is None:
            return None
        seen = self.look(frame)
        if seen.found is None:
            self.reasons[seen.reason] = self.reasons.get(seen.reason, 0) + 1
            return None
        found, before, taken_s = seen.found, self._before, frame.taken_s - self._latency_s
        pose = MocapPose(found.pose, taken_s, self._clock(), frame.number)
        if before is not None and 0.0 < taken_s - before.taken_s <= _LONGEST_GAP_S:
            passed_s = taken_s - before.taken_s
            speed_m_s = math.dist(pose.pose[:2], before.pose[:2]) / passed_s
            rate_rad_s = math.remainder(pose.pose.theta - before.pose.theta, math.tau) / passed_s
            sd_xy_m, sd_theta_rad = claim(found, speed_m_s, rate_rad_s)
            pose = replace(pose, sd_xy_m=sd_xy_m, sd_theta_rad=sd_theta_rad)
        self._before = pose
        return pose

    def _serve(self) -> None:
        try:
            while not self._closing:
                pose = self._next(0.1)
                if pose is not None:
                    self._poses.put(pose)
        except MocapError as error:
            self._poses.put(error)


def open_camera(name: str, path: Path) -> CameraSource:
    """Open the camera that a camera file describes. Raises MocapError."""
    watcher = open_watcher(path)
    frames = open_frames(watcher.setup)
    return CameraSource(name, frames, watcher, latency_s=watcher.setup.latency_s)
