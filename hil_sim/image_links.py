# SPDX-License-Identifier: MIT
"""Where others connect to the links of an emulated board: a TCP port or a pseudo-terminal, one client at a time."""

from __future__ import annotations

import os
import select
import termios
import tty
from abc import ABC, abstractmethod
from pathlib import Path

from omniwheel.errors import FirmwareStartError
from omniwheel.tcp_server import TcpServer, listen_hint

_READ_SIZE = 4096
_KEPT = 1 << 16
"""Bytes kept for a client that does not read."""


class ImagePort(ABC):
    """The outer end of a link; ``name`` is what to connect to."""

    name: str

    def __init__(self) -> None:
        self._unsent = bytearray()
        self._sessions = 0
        self._in_session = False

    @property
    def session(self) -> int:
        """Number of the connected client, 0: none; polled at every call."""
        before, self._in_session = self._in_session, self.connected
        self._sessions += int(self._in_session and not before)
        return self._sessions if self._in_session else 0

    @property
    @abstractmethod
    def connected(self) -> bool:
        """Whether a client has it open; looks anew at every call."""

    @property
    def full(self) -> bool:
        """Whether the client reads too slowly for more to be kept for it."""
        return len(self._unsent) >= _KEPT

    @abstractmethod
    def read(self) -> bytes:
        """Return what the client has sent; never waits."""

    def write(self, data: bytes) -> None:
        """Send what fits now and keep the rest. Without a client it is lost, as on a cable that ends nowhere."""
        if self.connected:
            self._unsent += data
            self.flush()
        else:
            self._unsent.clear()

    def flush(self) -> None:
        """Send what was kept, as far as the client takes it."""
        if self._unsent:
            del self._unsent[: self._send(bytes(self._unsent))]

    @abstractmethod
    def _send(self, data: bytes) -> int: ...

    @abstractmethod
    def wait(self, timeout_s: float | None) -> None:
        """Sleep until there may be something to read, or a client."""

    @abstractmethod
    def hang_up(self) -> None:
        """Take the port away from its client, as when a board restarts; others may connect."""

    @abstractmethod
    def close(self) -> None:
        """Close it for good."""


class TcpPort(ImagePort):
    """A TCP server; the next client is served when the one before has gone."""

    def __init__(self, host: str, port: int) -> None:
        super().__init__()
        try:
            self._server = TcpServer(host, port)
        except OSError as error:
            said = f"cannot listen at {host}:{port}: {error.strerror}"
            raise FirmwareStartError(said, hint=listen_hint(error.errno)) from error
        self.name = self._server.url

    @property
    def connected(self) -> bool:
        """Whether a client is there; takes the next one."""
        return self._server.connected

    def read(self) -> bytes:
        """Return what the client has sent."""
        data = self._server.read()
        self._forget_if_gone()
        return data

    def _send(self, data: bytes) -> int:
        taken = self._server.send(data)
        self._forget_if_gone()
        return taken

    def wait(self, timeout_s: float | None) -> None:
        """Sleep until something has come."""
        select.select([self._server.waits_on], [], [], timeout_s)

    def hang_up(self) -> None:
        """Close the connection."""
        self._server.hang_up()
        self._forget_if_gone()

    def _forget_if_gone(self) -> None:
        """Keep nothing of a client that has gone: the next one is another session."""
        if not self._server.has_client:
            self._unsent.clear()
            self._in_session = False

    def close(self) -> None:
        """Close connection and server."""
        self.hang_up()
        self._server.close()


class TerminalPort(ImagePort):
    """A pseudo-terminal, with a symbolic link to it if one is wanted. Connected while some program has it open."""

    def __init__(self, symlink: str) -> None:
        super().__init__()
        self._master, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        terminal = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, select.POLLIN)
        self._symlink = _symlink(Path(symlink), terminal) if symlink else None
        self.name = f"pty:{symlink or terminal}"

    @property
    def connected(self) -> bool:
        """Whether a program has it open: without one the terminal says that it hangs up."""
        events = self._poll.poll(0)
        gone = any(event & select.POLLHUP for _, event in events)
        if gone:
            self._unsent.clear()
        return not gone

    def read(self) -> bytes:
        """Return what was written to the terminal."""
        try:
            return os.read(self._master, _READ_SIZE)
        except OSError:  # no data, or no client
            return b""

    def _send(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0
        except OSError:
            return len(data)

    def wait(self, timeout_s: float | None) -> None:
        """Sleep until bytes arrive; without a client in short naps, as a terminal cannot be waited for."""
        if self.connected:
            self._poll.poll(None if timeout_s is None else timeout_s * 1e3)
        else:
            select.select([], [], [], 0.05 if timeout_s is None else min(timeout_s, 0.05))

    def hang_up(self) -> None:
        """Drop what is on its way: a pseudo-terminal can't be taken away from a program."""
        self._unsent.clear()
        termios.tcflush(self._master, termios.TCIOFLUSH)

    def close(self) -> None:
        """Close it and remove the symbolic link."""
        os.close(self._master)
        if self._symlink is not None:
            self._symlink.unlink(missing_ok=True)


def _symlink(path: Path, terminal: str) -> Path:
    if path.is_symlink():
        path.unlink()
    try:
        path.symlink_to(terminal)
    except OSError as error:
        raise FirmwareStartError(f"cannot link {path} to the terminal: {error.strerror}") from error
    return path


def open_port(link: str) -> ImagePort:
    """Open ``tcp:HOST:PORT`` (port 0: a free one) or ``pty[:SYMLINK]``. Raises FirmwareStartError."""
    kind, _, address = link.partition(":")
    if kind == "pty":
        return TerminalPort(address)
    host, _, port = address.rpartition(":")
    if kind != "tcp" or not host or not port.isdigit() or int(port) > 65535:
        raise FirmwareStartError(f"link '{link}'; must be tcp:HOST:PORT with a port from 0 to 65535, or pty[:SYMLINK]")
    return TcpPort(host, int(port))
