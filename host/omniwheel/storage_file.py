# SPDX-License-Identifier: MIT
"""The file behind ``--storage``, held so that two firmwares do not write it: each would lose the other's set."""

from __future__ import annotations

from pathlib import Path
from typing import IO

from omniwheel.errors import FirmwareStartError


def hold_storage(path: Path) -> IO[bytes]:
    """Open the file, make it if need be, and lock it until the returned file is closed. Raises FirmwareStartError.

    The PC firmware takes the same lock.
    """
    try:
        file = path.open("ab")
    except OSError as error:
        raise FirmwareStartError(f"--storage {path}: {error.strerror}") from error
    try:
        _lock(file, path)
    except BaseException:
        file.close()
        raise
    return file


def _lock(file: IO[bytes], path: Path) -> None:
    try:
        import fcntl
    except ImportError:  # Windows: two firmwares on one file are then the user's own care
        return
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        hint = "end it, or use another file"
        raise FirmwareStartError(f"--storage {path}: another firmware uses it", hint=hint) from error
    except OSError:  # a file system without locks
        return
