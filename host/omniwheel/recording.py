# SPDX-License-Identifier: MIT
"""What came over a link since the connection, kept in memory, or in a file of the system's once it is much."""

from __future__ import annotations

import tempfile
import threading
from collections.abc import Callable, Mapping
from typing import IO

from omniwheel.files import write_error
from omniwheel.run import Run

IN_MEMORY = 16 << 20
"""Bytes that are kept in memory; half an hour at 50 Hz."""


class Recording:
    """A recorder of a connection that can be read while it goes on."""

    def __init__(self, clock_us: Callable[[], int]) -> None:
        self._clock_us = clock_us
        self._lock = threading.Lock()
        self._file: IO[bytes] = tempfile.SpooledTemporaryFile(max_size=IN_MEMORY)  # noqa: SIM115  it lives as long

    def write(self, frame: bytes) -> None:
        """Append one whole MAVLink frame, with the time. Raises OutputFileError."""
        with self._lock:
            try:
                self._file.write(self._clock_us().to_bytes(8, "big") + frame)
            except OSError as error:
                raise write_error(tempfile.gettempdir(), error) from error

    def run(self, parameters: Mapping[str, float], robot_file: bytes) -> Run:
        """Return everything so far, with what is known of the robot."""
        with self._lock:
            self._file.seek(0)
            records = self._file.read()
        return Run.from_records(records, parameters=parameters, robot_file=robot_file)
