# SPDX-License-Identifier: MIT
"""A TCP port for one client at a time, which never waits: the outer end of a link that its owner polls."""

from __future__ import annotations

import errno
import socket

_READ_SIZE = 4096
_IN_USE = "another program uses this port, perhaps an old firmware process: end it, or choose another port"


def listen_hint(number: int | None) -> str:
    """Return what to do about a port that cannot be listened on, from the error's number; "" if unknown."""
    return _IN_USE if number == errno.EADDRINUSE else ""


class TcpServer:
    """Listens at once; the next client is served when the one before has gone. Raises OSError if it can't listen."""

    def __init__(self, host: str, port: int) -> None:
        self._listener = socket.create_server((host, port))
        self._listener.setblocking(False)
        self._client: socket.socket | None = None

    @property
    def url(self) -> str:
        """Where to connect to: ``tcp:HOST:PORT``, with the port that port 0 has become."""
        host, port = self._listener.getsockname()[:2]
        return f"tcp:{host}:{port}"

    @property
    def waits_on(self) -> socket.socket:
        """The socket that is readable once there is something to do."""
        return self._client if self._client is not None else self._listener

    @property
    def has_client(self) -> bool:
        """Whether a client is connected, as last seen; accepts no new one."""
        return self._client is not None

    @property
    def connected(self) -> bool:
        """Whether a client is there; takes the next one."""
        if self._client is None:
            try:
                self._client, _ = self._listener.accept()
            except OSError:
                return False
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return True

    def read(self) -> bytes:
        """Return the bytes from the client; accepts no new one."""
        if self._client is None:
            return b""
        try:
            data = self._client.recv(_READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.hang_up()
        return data

    def send(self, data: bytes) -> int:
        """Send what the client takes now, and return how much that is; all of it if there is no client, or no more."""
        if self._client is None:
            return len(data)
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self.hang_up()
            return len(data)

    def hang_up(self) -> None:
        """Close the connection, if there is one."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        """Close connection and port."""
        self.hang_up()
        self._listener.close()
