# SPDX-License-Identifier: MIT
"""The sockets of a hub's clients: TCP connections and UDP peers. Nothing here waits."""

from __future__ import annotations

import socket
from collections.abc import Callable
from typing import Any

from omni.hub.core import Hub
from omniwheel.errors import LinkOpenError
from omniwheel.link import LinkAddress

READ_BYTES = 4096
"""At once from one client, so that none keeps a stop of another one waiting."""
UNREAD_BYTES = 1 << 20
"""A client that leaves so much unread is sent away."""
MOST_CLIENTS = 100
"""At one address. For one more, the client that has been silent for longest is disconnected, so that idle connections
lock no other out. select() can wait for 1024 sockets."""
UDP_SILENCE_S = 10.0
"""A UDP peer that found the hub by itself is forgotten after this silence."""


class TcpClients:
    """A TCP port for any number of clients."""

    def __init__(self, hub: Hub, address: LinkAddress) -> None:
        self._hub = hub
        try:
            self._listener = socket.create_server((address.place, address.number))
        except OSError as error:
            raise _cannot_listen("tcp", address, error) from error
        self._listener.setblocking(False)
        self._clients: dict[socket.socket, int] = {}  # the one that has been silent for longest first
        self._unsent: dict[int, bytearray] = {}

    @property
    def url(self) -> str:
        """Where to connect to."""
        host, port = self._listener.getsockname()[:2]
        return f"tcp:{host}:{port}"

    def sockets(self) -> list[socket.socket]:
        """Return what may become readable."""
        return [self._listener, *self._clients]

    def unsent(self) -> list[socket.socket]:
        """Return what shall be looked at once it can be written to."""
        return [client for client, number in self._clients.items() if self._unsent[number]]

    def read(self, ready: set[Any]) -> None:
        """Take new clients, and what the others sent."""
        for client in [client for client in self._clients if client in ready]:
            try:
                data = client.recv(READ_BYTES)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            if data:
                self._clients[client] = self._clients.pop(client)
                self._hub.from_client(self._clients[client], data)
            else:
                self._leave(client)
        if self._listener in ready:
            self._accept()

    def write(self) -> None:
        """Send what the clients take now."""
        for client, number in list(self._clients.items()):
            unsent = self._unsent[number]
            unsent += self._hub.to_client(number)
            try:
                del unsent[: client.send(unsent) if unsent else 0]
            except BlockingIOError:
                pass
            except OSError:
                self._leave(client)
                continue
            if len(unsent) > UNREAD_BYTES:
                self._hub.events.append(f"{self._hub.clients[number].name} disconnected: it does not read its messages")
                self._leave(client)

    def close(self) -> None:
        """Close everything."""
        for client in self._clients:
            client.close()
        self._listener.close()

    def _accept(self) -> None:
        try:
            client, (host, port, *_) = self._listener.accept()
        except OSError:
            return
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if len(self._clients) >= MOST_CLIENTS:
            silent = next(old for old, number in self._clients.items() if number != self._hub.command.holder)
            _log_eviction(self._hub, self._clients[silent])
            self._leave(silent)
        number = self._hub.join(f"{host}:{port}")
        self._clients[client] = number
        self._unsent[number] = bytearray()

    def _leave(self, client: socket.socket) -> None:
        number = self._clients.pop(client)
        del self._unsent[number]
        client.close()
        self._hub.leave(number)


class UdpClients:
    """A UDP socket: it replies to every sender, or, if it sends first, only to its target."""

    def __init__(self, hub: Hub, address: LinkAddress, clock: Callable[[], float]) -> None:
        self._hub = hub
        self._clock = clock
        self._fixed: Any = None
        self._peers: dict[Any, tuple[int, float]] = {}
        try:
            family, _, _, _, where = socket.getaddrinfo(address.place, address.number, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
            if address.kind == "udpin":
                self._socket.bind(where)
        except OSError as error:
            raise _cannot_listen("udp", address, error) from error
        self._socket.setblocking(False)
        self.url = f"{address.kind}:{address.place}:{address.number}"
        if address.kind == "udpout":
            self._fixed = where[:2]
            self._peers[self._fixed] = (hub.join(self.url), float("inf"))

    def sockets(self) -> list[socket.socket]:
        """Return what may become readable."""
        return [self._socket]

    def unsent(self) -> list[socket.socket]:
        """Return nothing: what cannot be sent is lost, as datagrams are."""
        return []

    def read(self, ready: set[Any]) -> None:
        """Take a datagram, and forget who is silent."""
        now_s = self._clock()
        for peer, (number, until_s) in list(self._peers.items()):
            if now_s > until_s:
                del self._peers[peer]
                self._hub.leave(number)
        if self._socket not in ready:
            return
        try:
            data, peer = self._socket.recvfrom(READ_BYTES)
        except OSError:  # no listener yet: "connection refused"
            return
        if self._fixed is not None and peer[:2] != self._fixed:
            return
        peer = peer[:2]
        number, until_s = self._peers.pop(peer, (0, 0.0))  # to the end: those silent for longest come first
        if not number:
            if len(self._peers) >= MOST_CLIENTS:
                silent = next(old for old, (at, _) in self._peers.items() if at != self._hub.command.holder)
                _log_eviction(self._hub, self._peers[silent][0])
                self._hub.leave(self._peers.pop(silent)[0])
            number = self._hub.join(f"udp {peer[0]}:{peer[1]}")
        self._peers[peer] = (number, max(until_s, now_s + UDP_SILENCE_S))
        self._hub.from_client(number, data)

    def write(self) -> None:
        """Send what is there."""
        for peer, (number, _) in self._peers.items():
            data = self._hub.to_client(number)
            for start in range(0, len(data), READ_BYTES):
                try:
                    self._socket.sendto(data[start : start + READ_BYTES], peer)
                except OSError:
                    break

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


def _log_eviction(hub: Hub, number: int) -> None:
    hub.events.append(f"{hub.clients[number].name} is disconnected: more than {MOST_CLIENTS} clients, and it is silent")


def _cannot_listen(kind: str, address: LinkAddress, error: OSError) -> LinkOpenError:
    hint = "is another hub running? choose another address with --listen"
    return LinkOpenError(f"cannot listen at {kind}:{address.place}:{address.number}: {error.strerror}", hint=hint)
