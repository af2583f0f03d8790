# SPDX-License-Identifier: MIT
"""Recordings: files of whole records that others may read, and a kill may find, while they grow.

What was recorded goes out after FLUSH_S of wall time or FLUSH_BYTES, whichever comes first, so a kill loses that much
at most. When the disk fills, the file is cut back to its last whole record and the writer says so once. From then on it
takes nothing, so that who records can still stop a robot over the same connection.
"""

from __future__ import annotations

import errno
import os
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from omniwheel.errors import OutputFileError
from omniwheel.files import open_partial, write_error

FLUSH_S = 1.0
FLUSH_BYTES = 1 << 16


class GrowingFile:
    """A recording. An existing file is replaced when the first record is there, and not before.

    ``whole`` returns how many bytes at the start of some are whole records. Raises OutputFileError.
    """

    def __init__(
        self, path: Path, whole: Callable[[bytes], int], clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.path = path
        self._whole = whole
        self._clock_s = clock_s
        self._waiting = bytearray()
        self._size = 0
        self._flushed_s = clock_s()
        self._made: Path | None = None
        self._dead = False
        try:
            self._old = path.resolve() if path.is_file() else None  # replaced when there is something to put there
            self._file = self._open_beside(self._old) if self._old is not None else self._open(path)
        except OSError as error:
            raise write_error(path, error) from error
        self._has_disk = stat.S_ISREG(os.fstat(self._file).st_mode)  # else a pipe or a terminal

    def write(self, records: bytes) -> None:
        """Append whole records. Raises OutputFileError, once: what comes after it is dropped."""
        if self._dead:
            return
        self._waiting += records
        if len(self._waiting) >= FLUSH_BYTES:
            self.flush()
        else:
            self.flush_if_due()

    def flush_if_due(self) -> None:
        """Hand out what waits if that is FLUSH_S ago; for silent links. Raises OutputFileError."""
        if self._clock_s() >= self._flushed_s + FLUSH_S:
            self.flush()

    def flush(self) -> None:
        """Hand out what waits. Raises OutputFileError."""
        self._flushed_s = self._clock_s()
        if self._dead or not self._waiting:
            return
        records = bytes(self._waiting)
        self._waiting.clear()
        done = 0
        try:
            while done < len(records):
                done += os.write(self._file, records[done:])
            if self._old is not None and self._made is not None:
                os.replace(self._made, self._old)
                self._made = self._old = None
        except OSError as error:
            self._size += self._whole(records[:done]) if self._old is None else 0
            self._dead = True
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            raise self._error(error) from error
        self._size += done

    def close(self) -> None:
        """Bring everything to the disk and close the file; one without a record is removed. Raises OutputFileError."""
        if self._file < 0:
            return
        try:
            self.flush()
            if self._has_disk and not self._dead:
                self._sync()
        finally:
            os.close(self._file)
            self._file = -1
            if self._size == 0 and self._made is not None:
                with suppress(OSError):
                    self._made.unlink()

    def _open(self, path: Path) -> int:
        made = not path.exists()
        file = os.open(path, os.O_WRONLY | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        self._made = path if made else None
        return file

    def _open_beside(self, old: Path) -> int:
        if not os.access(old, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        file, self._made = open_partial(old, stat.S_IMODE(old.stat().st_mode))
        return file

    def _sync(self) -> None:
        try:
            os.fsync(self._file)
        except OSError as error:
            raise self._error(error) from error

    def _error(self, error: OSError) -> OutputFileError:
        said = write_error(self.path, error)
        kept = "; what was recorded before is kept" if self._size > 0 else ""
        return type(said)(f"{said.message}{kept}", hint=said.hint)
