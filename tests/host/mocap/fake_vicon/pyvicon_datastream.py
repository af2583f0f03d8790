# SPDX-License-Identifier: MIT
"""A stand-in for the library pyvicon-datastream 0.2.4: the classes and methods the adapter uses, with its signatures.

As in Vicon's SDK, ``get_frame`` succeeds with the old frame when no new one came within its time-out, and an occluded
segment gives None. ``script`` says what the frames hold; a process of its own makes it from the environment.
"""

from __future__ import annotations

import math
import os
import time
from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt


class Result(Enum):
    Unknown = 0
    NotImplemented = 1
    Success = 2
    InvalidHostName = 3
    ClientAlreadyConnected = 5
    ClientConnectionFailed = 6
    NotConnected = 9
    NoFrame = 10
    InvalidSubjectName = 13


class StreamMode(Enum):
    ClientPull = 0
    ClientPullPreFetch = 1
    ServerPush = 2


class Direction(Enum):
    Up = 0
    Down = 1
    Left = 2
    Right = 3
    Forward = 4
    Backward = 5


@dataclass
class Frame:
    """What the server has; position in mm, quaternion w, x, y, z, latency in s. ``result`` is what get_frame says."""

    number: int
    position: tuple[float, float, float] | None = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] | None = (1.0, 0.0, 0.0, 0.0)
    latency_s: float = 0.0
    result: Result = Result.Success


def turned(number: int, x_mm: float, y_mm: float, theta: float, latency_s: float = 0.01) -> Frame:
    """Return a frame of an object turned by theta about z."""
    return Frame(number, (x_mm, y_mm, 100.0), (math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)), latency_s)


def _scripted() -> list[Frame]:
    """Frames for a process of its own, by FAKE_VICON.

    moving; still (at x = 0.5 m); lossy (moving, occluded every third, disconnected once).
    """
    if os.environ.get("FAKE_VICON") == "still":
        return [turned(n, 500.0, 0.0, 0.0) for n in range(1, 100_000)]
    if os.environ.get("FAKE_VICON") != "lossy":
        return [turned(n, 10.0 * n, -n, 0.01 * n) for n in range(1, 100_000)]
    frames = []
    for n in range(1, 1000):
        frame = turned(n, 10.0 * n, -n, 0.01 * n)
        if n % 3 == 0:
            frame.position = None
        if n == 10:
            frame.result = Result.NotConnected
        frames.append(frame)
    return frames


class PyViconDatastream:
    script: list[Frame] | None = None
    hosts = ("vicon.local",)
    subjects = ("robot", "wand")

    def __init__(self) -> None:
        self.calls: list[str] = []
        self._frames = iter(_scripted() if self.script is None else self.script)
        self._paced = self.script is None
        self._frame: Frame | None = None
        self._connected = False
        self._segments = False

    def connect(self, ip: str) -> Result:
        self.calls.append(f"connect {ip}")
        self._connected = ip in self.hosts
        return Result.Success if self._connected else Result.ClientConnectionFailed

    def disconnect(self) -> Result:
        self._connected = False
        return Result.Success

    def is_connected(self) -> bool:
        return self._connected

    def enable_segment_data(self) -> Result:
        self._segments = True
        return Result.Success

    def set_stream_mode(self, stream_mode: StreamMode) -> Result:
        self.calls.append(f"mode {stream_mode.name}")
        return Result.Success

    def set_axis_mapping(self, X: Direction, Y: Direction, Z: Direction) -> Result:
        self.calls.append(f"axes {X.name} {Y.name} {Z.name}")
        return Result.Success

    def get_frame(self) -> Result:
        if not self._connected:
            return Result.NotConnected
        if self._paced:
            time.sleep(0.01)
        frame = next(self._frames, None)
        if frame is None:
            return Result.Success if self._frame is not None else Result.NoFrame
        self._connected = frame.result is not Result.NotConnected
        if frame.result is Result.Success:
            self._frame = frame
        return frame.result

    def get_frame_number(self) -> int:
        return self._frame.number if self._frame is not None else 0

    def get_latency_total(self) -> float:
        return self._frame.latency_s if self._frame is not None else 0.0

    def get_subject_count(self) -> int:
        return len(self.subjects)

    def get_subject_name(self, index: int) -> str | None:
        return self.subjects[index] if index < len(self.subjects) else None

    def get_subject_root_segment_name(self, name: str) -> str | None:
        return f"{name}_root" if name in self.subjects else None

    def get_segment_global_translation(self, subject_name: str, segment_name: str) -> npt.NDArray[np.float64] | None:
        assert self._segments
        assert segment_name == f"{subject_name}_root"
        return None if self._frame is None or self._frame.position is None else np.array(self._frame.position)

    def get_segment_global_quaternion(self, subject_name: str, segment_name: str) -> npt.NDArray[np.float64] | None:
        return None if self._frame is None or self._frame.quaternion is None else np.array(self._frame.quaternion)
