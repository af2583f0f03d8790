# SPDX-License-Identifier: MIT
"""Where the programs of one user find each other: a locked file per port says who has it.

A file is valid while a process holds its lock, so a killed program leaves no stale one. The
folder belongs to the user alone. Without file locks (Windows) no hub is ever found, and every program opens its port.
A reader writes nothing and never fails: a full or broken disk must not keep a program from its port.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from omniwheel import files
from omniwheel.errors import LinkOpenError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

HUB, OWNER = "hub", "owner"
_REQUEST = "request"
_TRIES = 20
_TRY_S = 0.01


def can_share() -> bool:
    """Return whether programs can find each other: not on Windows, nor where no folder can be made for it."""
    try:
        return fcntl is not None and folder().is_dir()
    except OSError:
        return False


def folder() -> Path:
    """Return the user's folder for these files. Raises LinkOpenError if others can write to it."""
    base = os.environ.get("XDG_RUNTIME_DIR", "")
    path = Path(base, "omniwheel") if Path(base).is_dir() and base else _temporary()
    path.mkdir(mode=0o700, exist_ok=True)
    status = path.stat()
    if status.st_uid != os.getuid() or status.st_mode & (stat.S_IRWXG | stat.S_IRWXO) or path.is_symlink():
        hint = "remove it, or set XDG_RUNTIME_DIR to a folder of your own"
        raise LinkOpenError(f"the folder {path} is accessible to other users, or owned by another user", hint=hint)
    return path


def _temporary() -> Path:
    return Path(tempfile.gettempdir(), f"omniwheel-{os.getuid()}")


def names_of(port: str) -> tuple[str, ...]:
    """Return the names of a port: as it was given, and where that leads now. They differ for a link that can change.

    A network address has one name.
    """
    if port.startswith(("tcp:", "udp:", "udpin:", "udpout:")):
        return (port,)
    return tuple(sorted({os.path.abspath(port), os.path.realpath(port)}))


def _file(kind: str, name: str) -> Path:
    return folder() / f"{hashlib.sha256(name.encode()).hexdigest()[:20]}.{kind}"


class Claim:
    """A port's files of one kind, held until :meth:`close` or the end of the program."""

    def __init__(self, kind: str, content: Mapping[str, Any]) -> None:
        self._kind = kind
        self._content = dict(content)
        self._held: dict[str, int] = {}

    def take(self, port: str) -> bool:
        """Hold the files of all names of ``port``; False if another program holds one. Raises OutputFileError."""
        return not can_share() or all(self._take(name) for name in names_of(port))

    def _take(self, name: str) -> bool:
        if name in self._held:
            return True
        path = _file(self._kind, name)
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
            try:
                if _locked(descriptor):
                    _write(descriptor, json.dumps(self._content).encode())
                    self._held[name] = descriptor
            finally:
                if name not in self._held:
                    os.close(descriptor)
        except OSError as error:
            raise files.write_error(path, error) from error
        return name in self._held

    def close(self) -> None:
        """Let go."""
        for descriptor in self._held.values():
            os.close(descriptor)
        self._held.clear()


def _locked(descriptor: int) -> bool:
    for _ in range(_TRIES):  # a reader may hold it for a moment
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except OSError:
            time.sleep(_TRY_S)
    return False


def _write(descriptor: int, data: bytes) -> None:
    """Put ``data`` into a file in place of what it holds."""
    os.ftruncate(descriptor, 0)
    while data:
        data = data[os.write(descriptor, data) :]


def find(kind: str, port: str) -> dict[str, Any] | None:
    """Return what the program says that holds this port's file; None if there is none."""
    if not can_share():
        return None
    for name in names_of(port):
        content = _read(_file(kind, name))
        if content is not None:
            return content
    return None


def _read(path: Path) -> dict[str, Any] | None:
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:  # held, so it is true
        return _content(descriptor)
    finally:
        os.close(descriptor)
    return None


def _content(descriptor: int) -> dict[str, Any] | None:
    """Return what its holder has written; None while he is writing it, or if the disk let him write no more."""
    try:
        return dict(json.loads(os.read(descriptor, 4096)))
    except (OSError, ValueError, TypeError):
        return None


def ask_for(port: str, address: str) -> None:
    """Ask the owner of a port to go on as a client of the hub at ``address``. Raises OutputFileError."""
    for name in names_of(port):
        files.write_text(_file(_REQUEST, name), address)


def asked_for(name: str) -> str:
    """Return the address of the hub that asks for the port with this name; "" if none does."""
    try:
        return _file(_REQUEST, name).read_text(encoding="utf-8")
    except OSError:  # there is none
        return ""


def withdraw(port: str) -> None:
    """Take the request back; harmless if there is none."""
    for name in names_of(port):
        with suppress(OSError):
            _file(_REQUEST, name).unlink()
