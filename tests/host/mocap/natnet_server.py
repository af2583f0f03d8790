# SPDX-License-Identifier: MIT
"""A NatNet server as Motive is one, on this computer: it answers a client's packets and sends it frames.

Packets are laid out as OptiTrack's NatNet SDK describes them, for the versions 3.1 and 4.1. The library under test
unpacks them by itself.
"""

from __future__ import annotations

import math
import socket
import struct
import threading
import time
from dataclasses import dataclass, field
from typing import Any

CONNECT, SERVER_INFO, REQUEST_MODELDEF, MODELDEF, FRAME = 0, 1, 4, 5, 7
GROUP = ("239.255.42.99", 1511)
TICKS_PER_S = 10_000_000
LATENCY_S = 0.008
FRAME_S = 0.005


@dataclass(frozen=True)
class Body:
    """A rigid body: x, y, z [m], quaternion (x, y, z, w), whether the cameras see it."""

    number: int
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    seen: bool = True


def packet(message: int, body: bytes) -> bytes:
    return struct.pack("<HH", message, len(body)) + body


def section(version: tuple[int, int], *entries: bytes) -> bytes:
    """Return a list with its count; from 4.1 on with its size in bytes, too."""
    body = b"".join(entries)
    size = struct.pack("<I", len(body)) if version >= (4, 1) else b""
    return struct.pack("<I", len(entries)) + size + body


def frame(version: tuple[int, int], number: int, taken_s: float, bodies: list[Body], changed: bool = False) -> bytes:
    """Return a frame whose cameras exposed at ``taken_s``."""
    each = [
        struct.pack("<I3f4ffH", body.number, *body.position, *body.rotation, 1e-4, int(body.seen)) for body in bodies
    ]
    ticks = round(taken_s * TICKS_PER_S)
    later = round(LATENCY_S * TICKS_PER_S)
    empty = section(version)
    lists = [empty, empty, section(version, *each), empty, *([empty] if version >= (4, 1) else []), empty, empty, empty]
    stamps = struct.pack("<IIdQQQH", 0, 0, taken_s, ticks, ticks + later // 2, ticks + later, 2 if changed else 0)
    return packet(FRAME, struct.pack("<I", number) + b"".join(lists) + stamps + bytes(4))


def model(version: tuple[int, int], names: dict[str, int]) -> bytes:
    """Return the description of rigid bodies with one marker each."""
    described = []
    for name, number in names.items():
        body = name.encode() + b"\0" + struct.pack("<II3f", number, 0, 0.0, 0.0, 0.0)
        body += struct.pack("<I3fI", 1, 0.0, 0.0, 0.0, 1) + (b"marker\0" if version >= (4, 0) else b"")
        size = struct.pack("<I", len(body)) if version >= (4, 1) else b""
        described.append(struct.pack("<I", 1) + size + body)
    return packet(MODELDEF, struct.pack("<I", len(described)) + b"".join(described))


def server_info(version: tuple[int, int]) -> bytes:
    name = b"Motive".ljust(256, b"\0")
    rest = struct.pack("<QHB4B", TICKS_PER_S, 1511, 0, 239, 255, 42, 99)
    return packet(SERVER_INFO, name + bytes([3, 1, 0, 0]) + bytes([*version, 0, 0]) + rest)


@dataclass
class Server:
    """Sends every 5 ms what ``bodies`` holds, to the client that asked last or to the group. All may change meanwhile.

    A client that says nothing gets ``patience`` more frames. ``delay`` frames are sent before the first answer. With
    ``moving`` the body 7 has the time of exposure for x [s], modulo 1.
    """

    version: tuple[int, int] = (4, 1)
    names: dict[str, int] = field(default_factory=lambda: {"robot": 7, "wand": 3})
    bodies: list[Body] = field(default_factory=lambda: [Body(3), Body(7)])
    changed: bool = False
    sends: bool = True
    answers: bool = True
    multicast: bool = False
    patience: float = math.inf
    moving: bool = False
    delay: int = 0
    number: int = 0

    def __post_init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(FRAME_S)
        self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.port = int(self._socket.getsockname()[1])
        self._client: Any = None
        self.heard_at = self.answered_at = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join(5.0)
        self._socket.close()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                data, self._client = self._socket.recvfrom(65536)
                self.heard_at = self.number
                self._answer(struct.unpack_from("<H", data)[0])
            except (TimeoutError, socket.timeout):  # noqa: UP041  two classes before Python 3.10
                self._send_frame()

    def _answer(self, message: int) -> None:
        if self.answers and message == CONNECT:
            for _ in range(self.delay):
                self._send_frame()
                time.sleep(FRAME_S)
            self.answered_at = self.number
            self._socket.sendto(server_info(self.version), self._client)
        elif self.answers and message == REQUEST_MODELDEF:
            self._socket.sendto(model(self.version, self.names), self._client)

    def _send_frame(self) -> None:
        patient = self.number - self.heard_at < self.patience
        if self._client is not None and self.sends and patient:
            self.number += 1
            taken_s = time.monotonic() - LATENCY_S
            if self.moving:
                self.bodies = [Body(7, (taken_s % 1.0, 0.0, 0.0), self.bodies[-1].rotation)]
            to = GROUP if self.multicast else self._client
            self._socket.sendto(frame(self.version, self.number, taken_s, self.bodies, self.changed), to)
