# SPDX-License-Identifier: MIT
"""Who speaks to a UDP port, and to which of them a frame goes: several robots, gimbals and routers may share a port."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from omniwheel.dialect import decoded, target_system
from omniwheel.stops import stop_of

MOST_PEERS = 16
"""For one more, a peer that sends no MAVLink is forgotten, else the one that has been silent for longest."""
FORGET_S = 300.0
"""A peer that has been silent for so long is forgotten, but not the last one: it may hear and not be heard."""
_HEADER_BYTES = {0xFD: 10, 0xFE: 6}
_SYSTEM_AT = {0xFD: 5, 0xFE: 3}
_CHECKSUM_BYTES, _SIGNATURE_BYTES = 2, 13
_V2, _SIGNED = 0xFD, 1


@dataclass
class _Peer:
    heard_s: float
    systems: set[int] = field(default_factory=set)


class UdpPeers:
    """The addresses that have sent something, each with the system ids in its frames. Times are ``clock``'s."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._peers: dict[Any, _Peer] = {}

    def hear(self, address: Any, datagram: bytes) -> None:
        """Take note of a datagram and of the address that sent it."""
        now_s = self._clock()
        peer = self._peers.setdefault(address, _Peer(now_s))
        peer.heard_s = now_s
        peer.systems |= systems_of(datagram)
        self._peers = {at: one for at, one in self._peers.items() if now_s - one.heard_s < FORGET_S}
        if len(self._peers) > MOST_PEERS:
            others = (at for at in self._peers if at != address)
            del self._peers[min(others, key=lambda at: (bool(self._peers[at].systems), self._peers[at].heard_s))]

    def receivers(self, frame: bytes) -> list[Any]:
        """Return the addresses that a frame goes to: those of its target system if one has been heard, else all.

        A stop goes to all of them, whomever it is for.
        """
        message = decoded(frame) if len(self._peers) > 1 else None
        if message is None or stop_of(message) is not None:
            return list(self._peers)
        system = target_system(message)
        return [at for at, peer in self._peers.items() if system in peer.systems] or list(self._peers)


def systems_of(datagram: bytes) -> set[int]:
    """Return the system ids of the frames that a datagram begins with; their checksums are not looked at."""
    systems = set[int]()
    at = 0
    while at < len(datagram) and (header := _HEADER_BYTES.get(datagram[at])) is not None:
        head = datagram[at : at + header]
        if len(head) < header:
            break
        signed = head[0] == _V2 and head[2] & _SIGNED
        at += header + head[1] + _CHECKSUM_BYTES + (_SIGNATURE_BYTES if signed else 0)
        if at <= len(datagram):
            systems.add(head[_SYSTEM_AT[head[0]]])
    return systems
