# SPDX-License-Identifier: MIT
"""Telemetry logs (``.tlog``) as MAVProxy, QGroundControl and pymavlink read them.

A record is the time as 8 bytes, big-endian, microseconds since 1970, then the frame as it was on the wire.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from omniwheel.errors import OutputFileError
from omniwheel.growing_file import GrowingFile

SIMULATED_EPOCH_US = 1_704_067_200_000_000
"""2024-01-01 00:00 UTC: where simulated time starts in a log."""
_STAMP = 8
_FRAME_1 = 0xFE
_SIGNED = 1


def wall_clock_us() -> int:
    """Return microseconds since 1970."""
    return time.time_ns() // 1000


def whole_records(data: bytes) -> int:
    """Return how many bytes at the start of ``data`` are whole records."""
    at = 0
    while len(data) - at > _STAMP + 3:
        magic, payload, flags = data[at + _STAMP : at + _STAMP + 3]
        size = 8 + payload if magic == _FRAME_1 else 12 + payload + (13 if flags & _SIGNED else 0)
        if at + _STAMP + size > len(data):
            break
        at += _STAMP + size
    return at


class TlogWriter:
    """Writes frames with time stamps from ``clock_us``: with a simulated clock, equal runs give equal files.

    The file can be read while it grows; see :mod:`omniwheel.growing_file` for what a kill or a full disk leaves.
    Everything here raises OutputFileError.
    """

    def __init__(self, path: Path | str, clock_us: Callable[[], int] = wall_clock_us) -> None:
        self.path = Path(path)
        self.frames = 0
        self._clock_us = clock_us
        self._file = GrowingFile(self.path, whole_records)

    def write(self, frame: bytes) -> None:
        """Append one whole MAVLink frame."""
        self._file.write(self._clock_us().to_bytes(8, "big") + frame)
        self.frames += 1

    def write_records(self, records: bytes, frames: int) -> None:
        """Append whole records that have been made elsewhere."""
        self._file.write(records)
        self.frames += frames

    def flush_if_due(self) -> None:
        """Hand out what waits for longer than a second: to be called now and then while a link is silent."""
        self._file.flush_if_due()

    def close(self) -> None:
        """Finish the file."""
        self._file.close()

    def __enter__(self) -> TlogWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self.close()
        except OutputFileError:
            if error is None:  # else that is what has to be heard of
                raise
