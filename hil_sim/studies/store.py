# SPDX-License-Identifier: MIT
"""The file that a study's finished batches are kept in: append-only, every record with its own checksum.

A record is, little-endian::

    4 bytes   "OMNB"
    4         number of runs, at most the plan's batch size
    16        key: which runs these are (plan.Batch.key)
    n         rows, as many as a batch has, those after the last run all zero
    4         CRC-32 of everything before

All records of a file have one length. What is torn or damaged is no record: its batch is done again.
"""

from __future__ import annotations

import os
import struct
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.studies.errors import StudyFolderError
from omniwheel.errors import OutputFileError
from omniwheel.files import write_error

MAGIC = b"OMNB"
KEY_BYTES = 16
_HEAD = struct.Struct(f"<4sI{KEY_BYTES}s")
_CHECK = struct.Struct("<I")
_SYNC_EVERY_S = 1.0
_MOST_RUNS = 4096
"""Batch sizes that are looked for in a file of another one."""


class BatchStore:
    """Finished batches by key. One process at a time; the file is made if it is not there, emptied if ``fresh``."""

    def __init__(self, path: Path, row: np.dtype[Any], batch_runs: int, *, fresh: bool = False) -> None:
        self._row = row
        self._batch_runs = batch_runs
        self._length = _HEAD.size + batch_runs * row.itemsize + _CHECK.size
        self._path = path
        self._places: dict[bytes, tuple[int, int]] = {}
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            _lock(self._file, path)
            if fresh:
                os.ftruncate(self._file, 0)
            self._read()
        except BaseException:
            os.close(self._file)
            raise
        self._synced_s = time.monotonic()

    def __enter__(self) -> BatchStore:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __len__(self) -> int:
        return len(self._places)

    def close(self) -> None:
        """Bring everything to the disk and let go of the file."""
        if self._file >= 0:
            file, self._file = self._file, -1
            try:
                with self._explained():
                    os.fsync(file)
            finally:
                os.close(file)

    def holds(self, key: bytes, runs: int) -> bool:
        """Return whether at least this many runs of a batch are there."""
        return key in self._places and self._places[key][1] >= runs

    def get(self, key: bytes, runs: int) -> NDArray[Any]:
        """Return a batch's first runs; KeyError if they are not there."""
        if not self.holds(key, runs):
            raise KeyError(key)
        offset = self._places[key][0] + _HEAD.size
        return np.frombuffer(os.pread(self._file, runs * self._row.itemsize, offset), self._row)

    def put(self, key: bytes, rows: NDArray[Any]) -> None:
        """Append a batch; once this returns, an end of the process cannot lose it."""
        padded = np.zeros(self._batch_runs, self._row)
        padded[: len(rows)] = rows
        body = _HEAD.pack(MAGIC, len(rows), key) + padded.tobytes()
        record = memoryview(body + _CHECK.pack(zlib.crc32(body)))
        with self._explained():
            os.lseek(self._file, self._end, os.SEEK_SET)
            while record:
                record = record[os.write(self._file, record) :]
            self._places[key] = (self._end, len(rows))
            self._end += self._length
            if time.monotonic() > self._synced_s + _SYNC_EVERY_S:
                os.fsync(self._file)
                self._synced_s = time.monotonic()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            said = write_error(self._path, error)
            hint = f"{said.hint}; finished batches are kept: repeat the command to continue"
            raise OutputFileError(said.message, hint=hint) from error

    def _read(self) -> None:
        """Find the whole records; a torn one at the end is written over by the next."""
        self._refuse_other_batches()
        self._end = os.fstat(self._file).st_size // self._length * self._length
        os.ftruncate(self._file, self._end)
        for offset in range(0, self._end, self._length):
            record = os.pread(self._file, self._length, offset)
            magic, runs, key = _HEAD.unpack_from(record)
            (check,) = _CHECK.unpack_from(record, self._length - _CHECK.size)
            if magic == MAGIC and runs <= self._batch_runs and check == zlib.crc32(record[: -_CHECK.size]):
                self._places[key] = (offset, runs)

    def _refuse_other_batches(self) -> None:
        """Records of another length would all be taken for torn ones."""
        head = os.pread(self._file, _HEAD.size, 0)
        if not head.startswith(MAGIC) or self._record_length(self._batch_runs):
            return
        whole = os.fstat(self._file).st_size // self._row.itemsize
        for runs in range(1, min(whole, _MOST_RUNS) + 1):
            if self._record_length(runs):
                hint = f"give --batch {runs}, or choose another folder with --out"
                raise StudyFolderError(f"{self._path} has batches of {runs} runs", hint=hint)

    def _record_length(self, runs: int) -> int:
        """Return the length of the first record if it is one of this many runs, else 0."""
        length = _HEAD.size + runs * self._row.itemsize + _CHECK.size
        record = os.pread(self._file, length, 0)
        whole = len(record) == length and record[-_CHECK.size :] == _CHECK.pack(zlib.crc32(record[: -_CHECK.size]))
        return length if whole else 0


def _lock(file: int, path: Path) -> None:
    try:
        import fcntl
    except ImportError:  # Windows: two studies in one folder are then the user's own care
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        hint = "wait for it, or choose another folder with --out"
        raise StudyFolderError(f"another process works on the study in {path.parent}", hint=hint) from error
