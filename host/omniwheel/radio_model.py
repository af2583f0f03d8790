# SPDX-License-Identifier: MIT
"""A pair of XBee modems in transparent mode, between two byte streams: what a slow, lossy radio does to a conversation.

Each direction is a serial line into a modem, the air, and a serial line out of the other modem:

- the line carries a byte per ten bits of ``baud``;
- the modem makes a packet of what has come after three silent characters, or of ``packet_bytes``;
- packets go through the air one after the other, ``air_bytes_s`` fast; what waits meanwhile must fit
  into ``buffer_bytes``, or is lost;
- a packet is lost with probability ``loss``, or arrives ``latency_s`` later.

Time is an argument, chance is seeded: equal input gives equal output.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass
from types import TracebackType

from omniwheel.errors import LinkOpenError
from omniwheel.link import FileLink
from omniwheel.tcp_server import TcpServer, listen_hint

BITS_PER_BYTE = 10
SILENT_CHARACTERS = 3


@dataclass(frozen=True)
class RadioSettings:
    """One direction of a radio link; ``loss`` is per packet, ``air_bytes_s`` what an XBee carries (30 to 80 kb/s)."""

    baud: int = 9600
    loss: float = 0.0
    latency_s: float = 0.02
    packet_bytes: int = 100
    buffer_bytes: int = 202
    air_bytes_s: float = 5000.0

    @property
    def character_s(self) -> float:
        """Time of one byte on the serial line."""
        return BITS_PER_BYTE / self.baud


class RadioDirection:
    """Bytes put in at one end and taken at the other. Times must not go back."""

    def __init__(self, settings: RadioSettings, seed: int) -> None:
        self.settings = settings
        self.bytes_in = 0
        self.packets_sent = 0
        self.packets_lost = 0
        self.bytes_overflowed = 0
        self._random = random.Random(seed)
        self._line: deque[tuple[float, int]] = deque()
        self._line_free_s = 0.0
        self._packet = bytearray()
        self._last_byte_s = 0.0
        self._air: deque[tuple[float, int]] = deque()
        self._air_free_s = 0.0
        self._arrived: deque[tuple[float, bytes]] = deque()
        self._out_free_s = 0.0

    def put(self, data: bytes, now_s: float) -> None:
        """Write to the modem's serial port; the line takes its time."""
        self.bytes_in += len(data)
        at_s = max(now_s, self._line_free_s)
        for byte in data:
            at_s += self.settings.character_s
            self._line.append((at_s, byte))
        self._line_free_s = max(at_s, self._line_free_s)

    def take(self, now_s: float) -> bytes:
        """Return what has come out of the other modem's serial port by now."""
        self._advance(now_s)
        out = bytearray()
        while self._arrived and self._arrived[0][0] <= now_s:
            out += self._arrived.popleft()[1]
        return bytes(out)

    @property
    def waiting_s(self) -> float:
        """Until when the line into the modem is busy."""
        return self._line_free_s

    def _advance(self, now_s: float) -> None:
        pause_s = SILENT_CHARACTERS * self.settings.character_s
        while self._line and self._line[0][0] <= now_s:
            at_s, byte = self._line.popleft()
            if self._packet and at_s - self._last_byte_s > pause_s:
                self._send(self._last_byte_s + pause_s)
            self._receive(at_s, byte)
        if self._packet and now_s - self._last_byte_s > pause_s:
            self._send(self._last_byte_s + pause_s)

    def _receive(self, at_s: float, byte: int) -> None:
        self._last_byte_s = at_s
        while self._air and self._air[0][0] <= at_s:
            self._air.popleft()
        if len(self._packet) + sum(count for _, count in self._air) >= self.settings.buffer_bytes:
            self.bytes_overflowed += 1
            return
        self._packet.append(byte)
        if len(self._packet) == self.settings.packet_bytes:
            self._send(at_s)

    def _send(self, at_s: float) -> None:
        packet, self._packet = bytes(self._packet), bytearray()
        self._air_free_s = max(at_s, self._air_free_s) + len(packet) / self.settings.air_bytes_s
        self._air.append((self._air_free_s, len(packet)))
        self.packets_sent += 1
        if self._random.random() < self.settings.loss:
            self.packets_lost += 1
            return
        arrives_s = max(self._air_free_s + self.settings.latency_s, self._out_free_s)
        self._out_free_s = arrives_s + len(packet) * self.settings.character_s
        self._arrived.append((self._out_free_s, packet))


class Radio:
    """Both directions of a link: ``down`` from the robot, ``up`` to it."""

    def __init__(self, settings: RadioSettings, seed: int = 1) -> None:
        self.settings = settings
        self.down = RadioDirection(settings, 2 * seed)
        self.up = RadioDirection(settings, 2 * seed + 1)


class RadioBridge:
    """A TCP port that leads to a robot's link through a radio, for one ground station at a time.

    ``address`` is (host, port).
    """

    def __init__(self, robot: FileLink, settings: RadioSettings, address: tuple[str, int], *, seed: int = 1) -> None:
        self.radio = Radio(settings, seed)
        self._robot = robot
        try:
            self._server = TcpServer(*address)
        except OSError as error:
            said = f"cannot listen at {address[0]}:{address[1]}: {error.strerror}"
            raise LinkOpenError(said, hint=listen_hint(error.errno)) from error
        self.url = self._server.url

    def __enter__(self) -> RadioBridge:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def pump(self, now_s: float) -> None:
        """Move what is due; to be called every few milliseconds. Raises LinkLostError if the robot has gone."""
        if data := self._robot.read(0.0):
            self.radio.down.put(data, now_s)
        if self._server.connected and (data := self._server.read()):
            self.radio.up.put(data, now_s)
        if data := self.radio.up.take(now_s):
            self._robot.write(data)
        if data := self.radio.down.take(now_s):
            self._send(data)

    def close(self) -> None:
        """Close port and connections."""
        self._server.close()
        self._robot.close()

    def _send(self, data: bytes) -> None:
        """Pass the received bytes to the ground station; without one they are lost, as with a radio."""
        if self._server.send(data) < len(data):
            self._server.hang_up()  # it does not read
