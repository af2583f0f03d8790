# SPDX-License-Identifier: MIT
"""Telemetry logs (``.tlog``) as MAVProxy, QGroundControl and pymavlink read them.

A record is the time as 8 bytes, big-endian, microseconds since 1970, then the frame as it was on the wire.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType


def wall_clock_us() -> int:
    """Return microseconds since 1970."""
    return time.time_ns() // 1000


class TlogWriter:
    """Writes frames with time stamps from ``clock_us``: with a simulated clock, equal runs give equal files."""

    def __init__(self, path: Path | str, clock_us: Callable[[], int] = wall_clock_us) -> None:
        self.path = Path(path)
        self.frames = 0
        self._clock_us = clock_us
        self._file = self.path.open("wb")

    def write(self, frame: bytes) -> None:
        """Append one whole MAVLink frame."""
        self._file.write(self._clock_us().to_bytes(8, "big"))
        self._file.write(frame)
        self.frames += 1

    def write_records(self, records: bytes, frames: int) -> None:
        """Append whole records that have been made elsewhere."""
        self._file.write(records)
        self.frames += frames

    def close(self) -> None:
        """Finish the file."""
        self._file.close()

    def __enter__(self) -> TlogWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()
