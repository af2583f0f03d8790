# SPDX-License-Identifier: MIT
"""MAVLink frames as bytes: signatures taken off and put on, payload, sender and sequence number left as they are."""

from __future__ import annotations

import hashlib
import struct

from omniwheel.dialect import Message, mavlink
from omniwheel.signing import Signer, timestamp

SIGNATURE_BYTES = 13
_V1, _V2 = 0xFE, 0xFD
_V1_HEADER, _V2_HEADER = 6, 10
_SIGNED = 1


def is_signed(message: Message) -> bool:
    """Return whether the message came in a MAVLink 2 frame with a signature."""
    frame = message.get_msgbuf()
    return frame[0] == _V2 and bool(frame[2] & _SIGNED)


def _frame(flags: int, message: Message) -> bytearray:
    """Return the message's MAVLink 2 frame with these flags, up to its checksum."""
    raw = bytes(message.get_msgbuf())
    if raw[0] == _V1:
        payload = raw[_V1_HEADER:-2]
        head = struct.pack("<BBBBBBBHB", _V2, len(payload), flags, 0, raw[2], raw[3], raw[4], raw[5], 0)
    else:
        payload = raw[_V2_HEADER : _V2_HEADER + raw[1]]
        head = bytes([_V2, raw[1], flags]) + raw[3:_V2_HEADER]
    body = bytearray(head + payload)
    crc = mavlink.x25crc(body[1:])
    crc.accumulate(bytes([message.crc_extra]))
    return body + struct.pack("<H", crc.crc)


def unsigned(message: Message) -> bytes:
    """Return the message's frame without signature; the frame as it came if it has none."""
    return bytes(_frame(0, message)) if is_signed(message) else bytes(message.get_msgbuf())


class Stamp:
    """Signs frames with one key and one link id; each time stamp is newer than the one before."""

    def __init__(self, signer: Signer) -> None:
        self._signer = signer
        self._last = 0

    def follow(self, stamp: int) -> None:
        """Go on behind a time stamp that was heard, as every MAVLink signer does."""
        self._last = max(self._last, stamp)

    def signed(self, message: Message) -> bytes:
        """Return the message's frame with a new signature in place of its own, if it had one."""
        self._last = max(self._last + 1, timestamp(self._signer.clock()))
        frame = _frame(_SIGNED, message) + struct.pack("<BQ", self._signer.link_id, self._last)[:7]
        return bytes(frame + hashlib.sha256(self._signer.key + bytes(frame)).digest()[:6])
