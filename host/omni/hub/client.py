# SPDX-License-Identifier: MIT
"""One client of the hub: its parser for received bytes and its send buffer."""

from __future__ import annotations

from typing import Any

from omni.hub.frame_finder import SILENCE_S, FrameFinder
from omni.hub.rules import Kind, kind_of
from omniwheel.dialect import HUB_COMPONENT, Message, mavlink

TEXT_PERIOD_S = 2.0
"""A client is told the same thing once in this time."""
TEXT_CHARACTERS = 50


class _Collector:
    """The file that pymavlink writes frames to."""

    def __init__(self, frames: bytearray) -> None:
        self._frames = frames

    def write(self, frame: bytes) -> None:
        self._frames += frame


class Client:
    """A program at the hub. ``name`` is what others are told of it; ``raw``: it takes the robot's signatures itself."""

    def __init__(self, number: int, name: str) -> None:
        self.number = number
        self.name = name
        self.raw = False
        self.systems: set[int] = set()
        self.out = bytearray()
        self.left_out = 0
        self.beat: Message | None = None
        """Its latest heartbeat of a station."""
        self._finder = FrameFinder(lambda message: kind_of(message) is Kind.STOP)
        self._heard_s = float("-inf")
        self._speaker: Any = mavlink.MAVLink(_Collector(self.out), 1, HUB_COMPONENT)
        self._told_s: dict[str, float] = {}

    def parse(self, data: bytes, now_s: float) -> list[Message]:
        """Return the messages of the dialect that are complete with ``data``, which has just come."""
        self._heard_s = now_s
        return self._finder.take(data)

    def parse_rest(self, now_s: float) -> list[Message]:
        """Return the messages inside half a frame whose rest has not come for too long."""
        late = self._finder.waits and now_s - self._heard_s > SILENCE_S
        return self._finder.give_up() if late else []

    def queue_text(self, system: int, text: str, severity: int, now_s: float, about: str = "") -> None:
        """Send a status text of the hub. With ``about``, at most one about this in two seconds."""
        if about and now_s - self._told_s.get(about, float("-inf")) < TEXT_PERIOD_S:
            return
        self._told_s[about] = now_s
        self._speaker.srcSystem = system
        self._speaker.send(mavlink.MAVLink_statustext_message(severity, text[:TEXT_CHARACTERS].encode()))

    def acknowledge(self, message: Message, result: int, receipt: int, source: tuple[int, int], sequence: int) -> None:
        """Answer a command in the robot's place: its sender looks for an answer from where it was sent to."""
        speaker: Any = mavlink.MAVLink(_Collector(self.out), *source)
        speaker.seq = sequence
        whom = (message.get_srcSystem(), message.get_srcComponent())
        speaker.send(mavlink.MAVLink_command_ack_message(message.command, result, 0, receipt, *whom))
