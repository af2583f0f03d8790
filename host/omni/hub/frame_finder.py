# SPDX-License-Identifier: MIT
"""Finds MAVLink frames in a client's bytes, by the same rules as the robot's own parser (firmware/app/link/codec.h).

pymavlink's parser believes every start byte. After one byte of noise it waits for up to 280 bytes and throws away what
stands inside them, stops too.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from enum import Enum, auto
from typing import Any

from omniwheel.dialect import Message, mavlink

LONGEST_STOP = 10 + 35 + 2 + 13
"""Bytes of the longest frame that a stop can be: MAVLink 2's header, COMMAND_INT, checksum, signature."""
SILENCE_S = 0.2
"""A frame whose rest does not come within this time was none."""
_V1, _V2 = 0xFE, 0xFD
_V1_HEADER, _V2_HEADER = 6, 10
_CHECKSUM, _SIGNATURE = 2, 13
_SIGNED = 1


class _Match(Enum):
    INCOMPLETE = auto()
    NO = auto()
    FRAME = auto()
    FOREIGN = auto()
    """Of a standard message that the dialect does not have."""


class FrameFinder:
    """Takes bytes as they come and gives the messages of the dialect, MAVLink 1 and 2. Signatures are not checked.

    A frame may begin with a start byte, flags that we know and the number of a standard message or one of ours. In
    MAVLink 1 the length must be that message's, too. All else is noise at once. After a wrong checksum it looks again
    from the next byte on, so nothing that arrived whole is lost. What stands inside a whole frame is its payload.

    A truncated frame looks like one that is still arriving. So a stop inside an unfinished frame is returned as soon as
    its last byte is there, and once more in its turn. ``is_stop`` tells what a stop is.
    """

    def __init__(self, is_stop: Callable[[Message], bool]) -> None:
        self._is_stop = is_stop
        self._held = bytearray()
        self._looked = 0
        """Stops inside an unfinished frame have been given if they end up to here."""
        self._codec: Any = mavlink.MAVLink(None)

    @property
    def waits(self) -> bool:
        """Whether the beginning of a frame is held."""
        return bool(self._held)

    def take(self, data: bytes) -> list[Message]:
        """Return the messages that are complete with ``data``."""
        self._held += data
        return list(self._found())

    def give_up(self) -> list[Message]:
        """Return what stands inside an unfinished frame whose rest does not come."""
        messages: list[Message] = []
        while self._held:
            self._drop(1)
            messages += self._found()
        return messages

    def _found(self) -> Iterator[Message]:
        while self._held:
            match, length, message = self._match(0)
            if match is _Match.INCOMPLETE:
                yield from self._early_stops()
                return
            self._drop(1 if match is _Match.NO else length)
            if message is not None:
                yield message

    def _early_stops(self) -> Iterator[Message]:
        for at in range(max(1, self._looked - LONGEST_STOP), len(self._held)):
            _, length, message = self._match(at)
            if message is not None and at + length > self._looked and self._is_stop(message):
                yield message
        self._looked = len(self._held)

    def _drop(self, count: int) -> None:
        del self._held[:count]
        self._looked = max(0, self._looked - count)

    def _match(self, at: int) -> tuple[_Match, int, Message | None]:
        """Return what stands at this place, its length, and the message if it is one of the dialect."""
        start = self._held[at]
        header = {_V1: _V1_HEADER, _V2: _V2_HEADER}.get(start)
        if header is None:
            return _Match.NO, 0, None
        head = self._held[at : at + header]
        if len(head) < header:
            return _Match.INCOMPLETE, 0, None
        payload, flags = head[1], head[2] if start == _V2 else 0
        number = int.from_bytes(head[7:10], "little") if start == _V2 else head[5]
        seed, least = mavlink.familiar_messages.get(number, (None, 0))
        if seed is None or flags & ~_SIGNED or (start == _V1 and payload != least):
            return _Match.NO, 0, None
        covered = header + payload
        length = covered + _CHECKSUM + (_SIGNATURE if flags & _SIGNED else 0)
        frame = self._held[at : at + length]
        if len(frame) < length:
            return _Match.INCOMPLETE, 0, None
        checksum = mavlink.x25crc(frame[1:covered])
        checksum.accumulate(bytes([seed]))
        if frame[covered : covered + _CHECKSUM] != struct.pack("<H", checksum.crc):
            return _Match.NO, 0, None
        if number not in mavlink.mavlink_map:
            return _Match.FOREIGN, length, None
        try:
            return _Match.FRAME, length, self._codec.decode(frame)
        except mavlink.MAVError:
            return _Match.FOREIGN, length, None
