# SPDX-License-Identifier: MIT
"""Do two firmwares say the same, byte for byte? Compares the frames of a robot in two telemetry logs."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from omniwheel.dialect import mavlink

APART: Mapping[str, frozenset[str]] = {
    "OMNI_STATUS": frozenset({"tick_us_mean", "tick_us_max"}),
    "OMNI_HEALTH": frozenset({"tick_jitter_us_max", "stack_free", "heap_free", "reset_cause"}),
    "AUTOPILOT_VERSION": frozenset({"board_version", "vendor_id", "product_id", "uid", "uid2"}),
}
"""What may differ between boards, by message: how long things took by the processor's own clock, and its memory.
Also why it started, and which board it is.

Frames' sequence numbers may differ by an offset that stays: what was said before the log began is not in it.
"""

_STAMP = struct.Struct(">Q")
_HEADER = 10
_CHECKSUM = 2
_SIZES = {
    "uint64_t": 8,
    "int64_t": 8,
    "double": 8,
    "uint32_t": 4,
    "int32_t": 4,
    "float": 4,
    "uint16_t": 2,
    "int16_t": 2,
}
_MOST_SHOWN = 20


@dataclass(frozen=True)
class LoggedFrame:
    """A frame of a telemetry log: time stamp [us], its bytes."""

    time_us: int
    data: bytes

    @property
    def message_id(self) -> int:
        """Number of its message."""
        return int.from_bytes(self.data[7:10], "little")

    @property
    def sequence(self) -> int:
        """Its number on the link, modulo 256."""
        return self.data[4]

    @property
    def sender(self) -> tuple[int, int]:
        """System and component."""
        return self.data[5], self.data[6]

    def fields(self) -> dict[str, bytes]:
        """Return each field's bytes, by name; a message that is not known is one field."""
        payload = self.data[_HEADER : _HEADER + self.data[1]]
        kind = mavlink.mavlink_map.get(self.message_id)
        if kind is None:
            return {"payload": payload}
        payload = payload.ljust(kind.unpacker.size, b"\0")
        types = dict(zip(kind.fieldnames, kind.fieldtypes, strict=True))
        found = {}
        at = 0
        for name, count in zip(kind.ordered_fieldnames, kind.lengths, strict=True):
            size = _SIZES.get(types[name], 1) * count
            found[name] = payload[at : at + size]
            at += size
        return found


@dataclass(frozen=True)
class Comparison:
    """``frames`` were compared; ``differences`` says what differs, the first ones, "" if nothing does."""

    frames: int
    differences: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether all that must be the same is."""
        return not self.differences


def frames(stream: bytes) -> Iterator[LoggedFrame]:
    """Cut a stream of whole MAVLink 2 frames without signatures; their time is 0."""
    at = 0
    while at < len(stream):
        begin, at = at, at + _HEADER + stream[at + 1] + _CHECKSUM
        yield LoggedFrame(0, stream[begin:at])


def read_frames(path: Path) -> Iterator[LoggedFrame]:
    """Read a telemetry log of such frames."""
    log = path.read_bytes()
    at = 0
    while at < len(log):
        (time_us,) = _STAMP.unpack_from(log, at)
        begin = at + _STAMP.size
        at = begin + _HEADER + log[begin + 1] + _CHECKSUM
        yield LoggedFrame(time_us, log[begin:at])


def compare_logs(one: Path, other: Path, apart: Mapping[str, frozenset[str]] = APART) -> Comparison:
    """Compare every frame of two logs, the host's own ones included, but for the fields in ``apart``."""
    offsets: dict[tuple[int, int], int] = {}
    differences: list[str] = []
    count = 0
    for first, second in zip_longest(read_frames(one), read_frames(other)):
        count += 1
        differences += _differences(first, second, offsets, apart)
        if len(differences) >= _MOST_SHOWN:
            break
    return Comparison(count, tuple(differences))


def _differences(
    first: LoggedFrame | None,
    second: LoggedFrame | None,
    offsets: dict[tuple[int, int], int],
    apart: Mapping[str, frozenset[str]],
) -> list[str]:
    if first is None or second is None:
        longer = first if second is None else second
        assert longer is not None
        return [f"{_name(longer)} at {longer.time_us} us is in one log only"]
    head = f"{_name(first)} at {first.time_us} us"
    if (first.message_id, first.sender, first.time_us) != (second.message_id, second.sender, second.time_us):
        return [f"{head} in one log, {_name(second)} from {second.sender} at {second.time_us} us in the other"]
    found = []
    offset = (first.sequence - second.sequence) % 256
    if offsets.setdefault(first.sender, offset) != offset:
        found.append(f"{head}: a frame is missing by the sequence numbers {first.sequence} and {second.sequence}")
        offsets[first.sender] = offset
    others = second.fields()
    for name, data in first.fields().items():
        if data != others[name] and name not in apart.get(_name(first), ()):
            found.append(f"{head}: {name} is {data.hex()} in one log, {others[name].hex()} in the other")
    return found


def _name(frame: LoggedFrame) -> str:
    kind = mavlink.mavlink_map.get(frame.message_id)
    return f"message {frame.message_id}" if kind is None else str(kind.msgname)
