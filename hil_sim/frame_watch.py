# SPDX-License-Identifier: MIT
"""Where frames begin and end in a stream of MAVLink 2 bytes that others will read."""

from __future__ import annotations

_MAGIC = 0xFD
_HEADER = 10
_CHECKSUM = 2
_SIGNATURE = 13
_SIGNED = 0x01


class FrameWatch:
    """Fed with pieces of a stream that begins at a frame; tells which messages are complete.

    Checksums are not looked at: the stream comes over a link that loses nothing. A byte between frames that begins
    none is passed over.
    """

    def __init__(self) -> None:
        self._begun = bytearray()

    @property
    def between(self) -> bool:
        """Whether no frame is half-way."""
        return not self._begun

    def feed(self, data: bytes) -> list[int]:
        """Take the next piece; return the numbers of the messages that ended in it."""
        self._begun += data
        ended: list[int] = []
        at = 0
        while True:
            at = self._begun.find(_MAGIC, at)
            if at < 0:
                self._begun.clear()
                return ended
            head = self._begun[at : at + _HEADER]
            if len(head) < _HEADER:
                break
            length = _HEADER + head[1] + _CHECKSUM + (_SIGNATURE if head[2] & _SIGNED else 0)
            if len(self._begun) < at + length:
                break
            ended.append(int.from_bytes(head[7:10], "little"))
            at += length
        del self._begun[:at]
        return ended
