# SPDX-License-Identifier: MIT
"""Bytes to and from a robot: serial ports, TCP and UDP behind one small interface, named by pymavlink-style URLs.

========================  ====================================================================
``/dev/ttyACM0[,baud]``   serial port (``COM3[,baud]`` on Windows); 57600 baud unless given, which USB ignores
``tcp:HOST:PORT``         connect to a TCP server
``udp:HOST:PORT``         wait for datagrams on this address and answer all their senders (also ``udpin:``)
``udpout:HOST:PORT``      send datagrams to this address, and hear only those that it sends
========================  ====================================================================

mavutil's own connections are not used because they print to standard output and sleep while they reconnect.
"""

from __future__ import annotations

import errno
import select
import socket
from dataclasses import dataclass
from typing import Any, Protocol

import serial

from omniwheel.errors import LinkLostError, LinkOpenError, LinkUrlError

DEFAULT_BAUD = 57600
MOST_BAUD = 100_000_000
"""Faster than any serial port; what it cannot do the system refuses."""
SLOW_BAUD = 57_600
"""Below this, reading all parameters would take many seconds: those that are known are kept."""
LAST_PORT = 65535
WRITE_TIMEOUT_S = 5.0
_READ_SIZE = 65536
_ALLOWED = "use /dev/ttyACM0[,baud], COM3[,baud], tcp:host:port, udp:host:port or udpout:host:port"
_NETWORK_KINDS = {"tcp": "tcp", "udp": "udpin", "udpin": "udpin", "udpout": "udpout"}


class Link(Protocol):
    """What a connection needs of a link. A simulated link that advances its own clock in ``read`` fits too."""

    url: str

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, waiting up to ``timeout_s`` for the first byte; b"" if none. Raises LinkLostError."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``. Raises LinkLostError."""
        ...

    def close(self) -> None:
        """Close; harmless when closed already."""
        ...


class FileLink(Link, Protocol):
    """A link with a file descriptor, for code that exchanges bytes itself (the lockstep runner)."""

    def fileno(self) -> int:
        """Return the open file descriptor; it stays the link's."""
        ...


@dataclass(frozen=True)
class LinkAddress:
    """A parsed URL: ``kind`` is serial, tcp, udpin or udpout; ``number`` the baud rate or port."""

    kind: str
    place: str
    number: int


def parse_url(url: str) -> LinkAddress:
    """Understand a link URL; raise LinkUrlError with the valid forms."""
    scheme, colon, rest = url.partition(":")
    if colon and scheme in _NETWORK_KINDS:
        return _parse_network(url, _NETWORK_KINDS[scheme], rest)
    if not url or "://" in url or (colon and "/" not in scheme and not url.upper().startswith("COM")):
        raise LinkUrlError(f"cannot understand the link {url!r}", hint=_ALLOWED)
    device, comma, baud = url.partition(",")
    if not device or (comma and not _is_number(baud, MOST_BAUD)):
        raise LinkUrlError(
            f"cannot understand the link {url!r}: the baud rate must be a whole number from 1 to {MOST_BAUD}",
            hint=_ALLOWED,
        )
    return LinkAddress("serial", device, int(baud) if comma else DEFAULT_BAUD)


def is_slow(url: str) -> bool:
    """Say whether a link is a radio whose telemetry should stay as it is."""
    address = parse_url(url)
    return address.kind == "serial" and address.number < SLOW_BAUD


def _is_number(text: str, most: int) -> bool:
    """Return whether this is a whole number from 1 to ``most``; Python converts no text of thousands of digits."""
    return text.isdecimal() and len(text) <= len(str(most)) and 0 < int(text) <= most


def _parse_network(url: str, kind: str, rest: str) -> LinkAddress:
    host, _, port = rest.rpartition(":")
    if not host or "/" in host or not _is_number(port, LAST_PORT):
        raise LinkUrlError(
            f"cannot understand the link {url!r}: it lacks a host and a port from 1 to {LAST_PORT}", hint=_ALLOWED
        )
    return LinkAddress(kind, host.strip("[]"), int(port))


def open_link(url: str, *, timeout_s: float = 5.0) -> FileLink:
    """Open the link that ``url`` names. Raises LinkUrlError or LinkOpenError."""
    address = parse_url(url)
    if address.kind == "serial":
        return SerialLink(url, address)
    if address.kind == "tcp":
        return TcpLink(url, address, timeout_s)
    return UdpLink(url, address)


def _open_error(url: str, error: OSError, hint: str) -> LinkOpenError:
    reason = error.strerror or str(error) or type(error).__name__
    return LinkOpenError(f"cannot open {url}: {reason[:1].lower()}{reason[1:]}", hint=hint)


class StreamLink:
    """A connected stream socket, which becomes the link's."""

    def __init__(self, url: str, connection: socket.socket) -> None:
        self.url = url
        self._socket = connection
        self._socket.settimeout(None)  # the lockstep runner reads and writes the descriptor itself

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self._socket.fileno()

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" if nothing did in time."""
        if not select.select([self._socket], [], [], max(0.0, timeout_s))[0]:
            return b""
        try:
            data = self._socket.recv(_READ_SIZE)
        except OSError as error:
            raise self._lost() from error
        if not data:
            raise self._lost()
        return data

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        try:
            if not select.select([], [self._socket], [], WRITE_TIMEOUT_S)[1]:
                raise LinkLostError(
                    f"{self.url} accepts no more data", hint="the robot does not read its input; restart it"
                )
            self._socket.sendall(data)
        except OSError as error:
            raise self._lost() from error

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _lost(self) -> LinkLostError:
        hint = (
            "the robot serves one client per port: check for another connected program, and that the robot still runs"
        )
        return LinkLostError(f"the robot closed the connection {self.url}", hint=hint)


class TcpLink(StreamLink):
    """A TCP client."""

    def __init__(self, url: str, address: LinkAddress, timeout_s: float) -> None:
        try:
            connection = socket.create_connection((address.place, address.number), timeout_s)
        except OSError as error:
            hint = "check host and port, and that the robot or `omni sitl` is listening"
            raise _open_error(url, error, hint) from error
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        super().__init__(url, connection)


class UdpLink:
    """UDP, as the side that waits (``udpin``) or the side that speaks first (``udpout``).

    The side that waits hears everybody and answers all of them (:mod:`omniwheel.udp_peers`). The side that speaks first
    hears only the address that it speaks to.
    """

    def __init__(self, url: str, address: LinkAddress) -> None:
        from omniwheel.udp_peers import UdpPeers  # with the dialect, which takes longer to import than a port to open

        self.url = url
        self._peers = UdpPeers() if address.kind == "udpin" else None
        try:
            family, _, _, _, where = socket.getaddrinfo(address.place, address.number, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
            if self._peers is not None:
                self._socket.bind(where)
            else:
                self._socket.connect(where)
        except OSError as error:
            hint = "udp: and udpin: need an address of this computer; udpout: sends to another one"
            raise _open_error(url, error, hint) from error

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self._socket.fileno()

    def read(self, timeout_s: float) -> bytes:
        """Return the next datagram, b"" if none came in time."""
        if not select.select([self._socket], [], [], max(0.0, timeout_s))[0]:
            return b""
        try:
            data, peer = self._socket.recvfrom(_READ_SIZE)
        except OSError as error:
            if error.errno == errno.ECONNREFUSED:
                return b""
            raise LinkLostError(f"lost {self.url}: {error.strerror}") from error
        if self._peers is not None:
            self._peers.hear(peer, data)
        return data

    def write(self, data: bytes) -> None:
        """Send a frame as a datagram; dropped while no other side is known. Raises LinkLostError if none gets it."""
        receivers = [None] if self._peers is None else self._peers.receivers(data)
        errors = [error for receiver in receivers if (error := self._send(data, receiver)) is not None]
        if errors and len(errors) == len(receivers):
            raise LinkLostError(f"lost {self.url}: {errors[0].strerror}") from errors[0]

    def _send(self, data: bytes, receiver: Any) -> OSError | None:
        """Send a datagram, ``receiver`` None: to the only address. Return why it failed, if it did."""
        try:
            if receiver is None:
                self._socket.send(data)
            else:
                self._socket.sendto(data, receiver)
        except ConnectionRefusedError:
            pass
        except OSError as error:
            return error
        return None

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class SerialLink:
    """A serial port: USB, radio or pseudo-terminal."""

    def __init__(self, url: str, address: LinkAddress) -> None:
        self.url = url
        try:
            self._port = serial.Serial(
                address.place, address.number, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True
            )
        except (OSError, ValueError) as error:
            raise _serial_open_error(url, error) from error

    def fileno(self) -> int:
        """Return the port's file descriptor (not on Windows)."""
        return int(self._port.fileno())

    def read(self, timeout_s: float) -> bytes:
        """Return what has come, b"" if nothing did in time."""
        try:
            self._port.timeout = max(0.0, timeout_s)
            first = bytes(self._port.read(1))
            return first + bytes(self._port.read(self._port.in_waiting)) if first else b""
        except (OSError, TypeError) as error:
            raise self._lost(error) from error

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        try:
            self._port.write(data)
        except (OSError, TypeError) as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Close the port."""
        self._port.close()

    def _lost(self, error: Exception) -> LinkLostError:
        return LinkLostError(f"lost the serial port {self.url}: {error}", hint="check the cable")


def _serial_open_error(url: str, error: Exception) -> LinkOpenError:
    number = getattr(error, "errno", None)
    if number == errno.ENOENT:
        return LinkOpenError(f"cannot open {url}: no such port", hint="`omni doctor` lists the serial ports")
    if number == errno.EACCES:
        hint = "on Linux, add yourself to the group dialout (or uucp) and log in again"
        return LinkOpenError(f"cannot open {url}: no permission", hint=hint)
    text = str(error)
    hint = "`omni doctor` lists the serial ports; another program may use it"
    return LinkOpenError(f"cannot open {url}: {text}", hint=hint)
