# SPDX-License-Identifier: MIT
"""Pictures with the time at which they were taken: from a camera, a video, or a folder of pictures.

A camera's driver knows when a picture was taken, on the monotonic clock, and OpenCV passes that on (Video4Linux). Where
it does not, the time is that of the grab. A thread grabs all pictures and keeps the newest: none waits in the driver.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from omniwheel.errors import MocapLostError, MocapSourceError
from omniwheel.mocap.camera.library import Array, load_cv2
from omniwheel.mocap.camera.setup import CameraSetup

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff")
_DRIVER_LATE_S = 0.5
"""A driver's time may be so long ago; an older one counts from somewhere else."""


@dataclass(frozen=True)
class Frame:
    """A grey picture (height, width) of uint8, when it was taken [s], and its number."""

    picture: Array
    taken_s: float
    number: int


class Frames(Protocol):
    """A stream of pictures."""

    def read(self, timeout_s: float) -> Frame | None:
        """Return the next picture, waiting up to ``timeout_s``; None if there is none. Raises MocapLostError."""
        ...

    @property
    def ended(self) -> bool:
        """Whether no picture will ever come again."""
        ...

    def close(self) -> None:
        """Close; harmless when closed already."""
        ...


def read_picture(path: Path) -> Array:
    """Return a picture file as grey levels. Raises MocapSourceError."""
    picture = load_cv2().imread(str(path), load_cv2().IMREAD_GRAYSCALE)
    if picture is None:
        raise MocapSourceError(f"{path} is not a picture that OpenCV can read", hint=f"endings: {', '.join(ENDINGS)}")
    return np.asarray(picture)


def pictures_in(folder: Path) -> list[Path]:
    """Return the pictures of a folder, by name. Raises MocapSourceError if there are none."""
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not found:
        raise MocapSourceError(f"{folder} has no pictures", hint=f"endings: {', '.join(ENDINGS)}")
    return found


class StoredFrames:
    """A folder of pictures, or a video, at the camera file's rate. The first one is taken now."""

    def __init__(
        self,
        setup: CameraSetup,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        path = Path(str(setup.device))
        self._paths = pictures_in(path) if path.is_dir() else None
        self._video = None if self._paths is not None else _opened(str(path), setup)
        self._period_s = 1.0 / setup.rate_Hz
        self._clock = clock
        self._sleep = sleep
        self._start_s = clock()
        self._number = 0
        self._next = self._load()

    def _load(self) -> Array | None:
        if self._paths is not None:
            return read_picture(self._paths[self._number]) if self._number < len(self._paths) else None
        assert self._video is not None
        good, picture = self._video.read()
        return _grey(picture) if good else None

    def read(self, timeout_s: float) -> Frame | None:
        """Return the next picture when its time has come."""
        taken_s = self._start_s + self._number * self._period_s
        left_s = taken_s - self._clock()
        if left_s > 0.0 and timeout_s > 0.0:
            self._sleep(min(left_s, timeout_s))
        if self._next is None or left_s > timeout_s:
            return None
        frame = Frame(self._next, taken_s, self._number)
        self._number += 1
        self._next = self._load()
        return frame

    @property
    def ended(self) -> bool:
        """Whether the last picture has been handed out."""
        return self._next is None

    def close(self) -> None:
        """Close the video."""
        if self._video is not None:
            self._video.release()


class LiveFrames:
    """A camera. ``capture`` is OpenCV's, opened; ``clock`` must be the one that its driver stamps with."""

    ended = False

    def __init__(self, capture: Any, name: str, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._capture = capture
        self._name = name
        self._clock = clock
        self._number = 0
        self._newest: Frame | None = None
        self._lost = False
        self._closing = False
        self._there = threading.Condition()
        self._thread = threading.Thread(target=self._grab, name="camera", daemon=True)
        self._thread.start()

    def _grab(self) -> None:
        while not self._closing:
            good, picture = self._capture.read()
            taken_s = self._stamp()
            with self._there:
                self._lost = not good
                if good:
                    self._newest = Frame(_grey(picture), taken_s, self._number)
                    self._number += 1
                self._there.notify_all()
            if not good:
                return

    def _stamp(self) -> float:
        now_s = self._clock()
        said_s = 1e-3 * float(self._capture.get(load_cv2().CAP_PROP_POS_MSEC))
        return said_s if now_s - _DRIVER_LATE_S < said_s <= now_s else now_s

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest picture not returned before."""
        with self._there:
            self._there.wait_for(lambda: self._newest is not None or self._lost, max(0.0, timeout_s))
            frame, self._newest = self._newest, None
            if frame is None and self._lost:
                raise MocapLostError(f"the camera {self._name} delivers no more pictures", hint="check its cable")
            return frame

    def close(self) -> None:
        """Close the camera."""
        self._closing = True
        self._thread.join(3.0)
        self._capture.release()


def open_frames(setup: CameraSetup) -> Frames:
    """Open what the camera file names. Raises MocapSourceError, MocapLostError, MocapLibraryError."""
    device = setup.device
    if isinstance(device, str) and not device.startswith("/dev/") and "://" not in device:
        path = Path(device)
        if not path.exists():
            raise MocapSourceError(f"{path}: no such video or folder", hint="see camera.device in the camera file")
        return StoredFrames(setup)
    capture = _opened(device, setup)
    cv2 = load_cv2()
    wanted = [
        (cv2.CAP_PROP_FRAME_WIDTH, setup.width),
        (cv2.CAP_PROP_FRAME_HEIGHT, setup.height),
        (cv2.CAP_PROP_FPS, setup.rate_Hz),
        (cv2.CAP_PROP_BUFFERSIZE, 1),
        (cv2.CAP_PROP_AUTOFOCUS, 0),  # another focus is another lens
    ]
    if setup.exposure is not None:
        wanted += [(cv2.CAP_PROP_AUTO_EXPOSURE, 1), (cv2.CAP_PROP_EXPOSURE, setup.exposure)]
    for key, value in wanted:
        capture.set(key, value)
    return LiveFrames(capture, str(device))


def _opened(device: int | str, setup: CameraSetup) -> Any:
    capture = load_cv2().VideoCapture(device)
    if not capture.isOpened():
        hint = f"see camera.device in {setup.path}; another program may have the camera"
        raise MocapLostError(f"the camera or video {device} cannot be opened", hint=hint)
    return capture


def _grey(picture: Array) -> Array:
    cv2 = load_cv2()
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture)
