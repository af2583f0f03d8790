# SPDX-License-Identifier: MIT
"""How everything here writes files, so that a full disk or a kill leaves the old file or the new one, never a piece.

A file is written beside its target under a name that begins with a dot and ends in ``.part``. It is brought to the
disk, and then takes the target's place. What goes wrong is an :class:`omniwheel.errors.OutputFileError`; nothing is
left behind then. Logs that grow while they are looked at are :mod:`omniwheel.tlog`'s.
"""

from __future__ import annotations

import errno
import json
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from omniwheel.errors import OutputFileError, OutputPathError

_ALL = 0o666
_HINTS = {
    errno.ENOSPC: "the disk is full: free some space, or choose another folder",
    errno.EDQUOT: "your disk quota is used up: remove some of your files, or choose another folder",
    errno.EFBIG: "the file size limit is reached: see `ulimit -f`, or choose another disk",
    errno.EIO: "the disk has a fault: use another one",
}
_BAD_PATHS = (
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.EEXIST,
    errno.ENAMETOOLONG,
    errno.ELOOP,
)
"""Errors of bad input rather than of the disk."""


def home() -> Path | None:
    """Return the user's folder; None for a user without one, as in a container."""
    try:
        return Path.home()
    except RuntimeError:
        return None


def write_bytes(path: Path | str, content: bytes) -> None:
    """Write a file; an existing one is replaced only once the new one is whole. Raises OutputFileError."""
    with replaced(path) as file:
        file.write(content)


def write_text(path: Path | str, text: str) -> None:
    """Write a file in UTF-8, as :func:`write_bytes` does."""
    write_bytes(path, text.encode("utf-8"))


def write_json(path: Path | str, data: Mapping[str, Any]) -> None:
    """Write plain data as JSON, for people to read too, as :func:`write_bytes` does."""
    write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n")


def create(path: Path | str, content: bytes, mode: int = _ALL) -> None:
    """Write a file that must not exist yet: FileExistsError if it does, OutputFileError if it cannot be written."""
    target = Path(path)
    with _explained(target):
        partial, file = _open_partial(target, mode)
        try:
            with file:
                file.write(content)
                _to_disk(file)
            _take_free_name(partial, target)
        finally:
            with suppress(OSError):
                partial.unlink()
        _sync_folder(target.parent)


def save_picture(figure: Any, path: Path | str) -> None:
    """Write a matplotlib figure in the format that the name's ending says, PNG if it has none.

    Raises OutputFileError; OutputPathError for an ending that is no picture's.
    """
    ending = Path(path).suffix[1:].lower() or "png"
    if ending not in figure.canvas.get_supported_filetypes():
        raise OutputPathError(
            f"{path}: {ending!r} is not an image format", hint="use a name that ends in .png, .svg or .pdf"
        )
    with replaced(path) as file:
        figure.savefig(file, format=ending, metadata={"Software": None} if ending == "png" else None)


@contextmanager
def replaced(path: Path | str) -> Iterator[IO[bytes]]:
    """Yield a file to write into. It takes the place of ``path`` when the block ends; not if the block raises.

    Raises OutputFileError, also for an OSError in the block. What is no regular file, as /dev/stdout, is written as it
    is.
    """
    target = Path(path)
    with _explained(target):
        target = target.resolve()  # a link stays one
        if target.exists() and not target.is_file() and not target.is_dir():
            with target.open("wb") as special:
                yield special
            return
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        partial, file = _open_partial(target, _mode_of(target))
        try:
            with file:
                yield file
                _to_disk(file)
            os.replace(partial, target)
        except BaseException:
            with suppress(OSError):
                partial.unlink()
            raise
        _sync_folder(target.parent)


def write_error(path: Path | str, error: OSError) -> OutputFileError:
    """Return the error that says why a file cannot be written, and what helps."""
    kind = OutputPathError if error.errno in _BAD_PATHS else OutputFileError
    hint = _HINTS.get(error.errno or 0, "check folder and permissions")
    return kind(f"cannot write {path}: {error.strerror or error}", hint=hint)


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except FileExistsError:
        raise
    except OSError as error:
        raise write_error(path, error) from error


def open_partial(target: Path, mode: int = _ALL) -> tuple[int, Path]:
    """Open a new file beside ``target``, to take its place later; return descriptor and path. Raises OSError."""
    partial = target.with_name(f".{target.name[:200]}.{secrets.token_hex(4)}.part")
    return os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), mode), partial


def _open_partial(target: Path, mode: int) -> tuple[Path, IO[bytes]]:
    descriptor, partial = open_partial(target, mode)
    return partial, os.fdopen(descriptor, "w+b")


def _mode_of(target: Path) -> int:
    return stat.S_IMODE(target.stat().st_mode) if target.exists() else _ALL


def _to_disk(file: IO[bytes]) -> None:
    file.flush()
    os.fsync(file.fileno())


def _take_free_name(partial: Path, target: Path) -> None:
    try:
        os.link(partial, target)
    except OSError as error:
        if error.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS):
            raise
        if target.exists():  # no hard links here, as on a memory card: as good as it gets
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from error
        os.replace(partial, target)


def _sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where folders can be opened and synced."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EACCES):
            raise
    finally:
        os.close(descriptor)
