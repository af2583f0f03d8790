# SPDX-License-Identifier: MIT
"""The rates of telemetry that a program has asked the robot for, to ask the hub for them once it takes the port over.

Without that the hub does not know them. It would end them when another program's wish for the same message ends.
Frames are looked at byte by byte: the dialect takes longer to import than a port to open.
"""

from __future__ import annotations

from collections.abc import Hashable

_MAGIC = 0xFD
_HEADER = 10
_SIGNED = 1
_COMPONENT_AT = 6
_REQUEST_DATA_STREAM, _COMMAND_LONG = 66, 76
_GROUP_AT = 4
_COMMAND_AT = 28
_SET_MESSAGE_INTERVAL = 511
_HUB_COMPONENT = 241


class RateRequests:
    """The newest request for each message and each group, in the order in which they were sent.

    Signed ones are left out: a robot takes none twice.
    """

    def __init__(self) -> None:
        self._frames: dict[Hashable, bytes] = {}

    def watch(self, frame: bytes) -> None:
        """Take note of a frame that is sent to the robot."""
        key = _key(frame)
        if key is not None:
            self._frames.pop(key, None)
            self._frames[key] = frame

    def take(self) -> bytes:
        """Return and forget the frames."""
        frames = b"".join(self._frames.values())
        self._frames.clear()
        return frames


def is_from_robot(data: bytes) -> bool:
    """Return whether data that a hub sends begins with a frame of the robot, and not of the hub: the port is open."""
    return len(data) > _COMPONENT_AT and data[0] == _MAGIC and data[_COMPONENT_AT] != _HUB_COMPONENT


def _key(frame: bytes) -> Hashable:
    """Return which rate a frame asks for; None: it asks for none."""
    if len(frame) < _HEADER or frame[0] != _MAGIC or frame[2] & _SIGNED:
        return None
    number = int.from_bytes(frame[7:_HEADER], "little")
    payload = frame[_HEADER : _HEADER + frame[1]].ljust(_COMMAND_AT + 2, b"\0")
    if number == _REQUEST_DATA_STREAM:
        return payload[_GROUP_AT]
    is_interval = int.from_bytes(payload[_COMMAND_AT : _COMMAND_AT + 2], "little") == _SET_MESSAGE_INTERVAL
    return payload[:4] if number == _COMMAND_LONG and is_interval else None
