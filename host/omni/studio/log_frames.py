# SPDX-License-Identifier: MIT
"""A piece of a telemetry log as arrays. Message by message, ten hours at 200 Hz would take a quarter of an hour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni.studio.signals import KINDS, parts_of, signals_of, values
from omniwheel.dialect import Message, mavlink
from omniwheel.telemetry import Control, Fix, Telemetry, Tracking, Wheels
from omniwheel.tlog_reader import JITTER_S, ROBOT_COMPONENT, SILENT_S, RobotClock

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Kind = type[Telemetry]
STAMP, HEAD, CHECKSUM, SIGNATURE = 8, 10, 2, 13
LONGEST_RECORD = STAMP + HEAD + 255 + CHECKSUM + SIGNATURE
AS_ARRAYS: Mapping[Kind, tuple[str, ...]] = {
    Tracking: ("phase",),
    Wheels: (),
    Control: (),
    Fix: ("result",),
}
"""Kinds that come fast and can be decoded from arrays, and their fields that hold the number of a name: left 0."""
SAID = ("HEARTBEAT", "STATUSTEXT", "PARAM_VALUE", "OMNI_STATUS")
"""Messages that tell of events."""
_TYPES = {"f": "<f4", "d": "<f8", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"}
_TYPES |= {"q": "<i8", "Q": "<u8", "c": "S1"}


@dataclass
class Clock(RobotClock):
    """The clock of the robot with the id ``system``, the first one in the log; 0 before it is known."""

    system: int = 0

    def follow_all(self, robot_s: Array, stamp_s: Array) -> Array:
        """Return the log's times for the robot's times, which were recorded at ``stamp_s``, in that order."""
        if not len(robot_s):
            return robot_s
        if not self._is_continuous(robot_s + self.offset_s, stamp_s):
            return np.array([self.follow(*times) for times in zip(robot_s.tolist(), stamp_s.tolist(), strict=True)])
        time_s = robot_s + self.offset_s
        newest_s = float(np.max(time_s))
        self.newest_s = newest_s if self.newest_s is None else max(self.newest_s, newest_s)
        self.stamp_s = float(stamp_s[-1])
        return time_s

    def _is_continuous(self, time_s: Array, stamp_s: Array) -> bool:
        """Return whether neither clock jumps: then one offset fits all of these times."""
        before = [time_s[0] if self.newest_s is None else self.newest_s]
        newest = np.maximum.accumulate(np.concatenate((before, time_s)))
        steps = time_s - newest[:-1]
        stamps = np.diff(stamp_s, prepend=stamp_s[0] if self.stamp_s is None else self.stamp_s)
        went_on = np.all(steps >= -JITTER_S) and np.all(steps <= SILENT_S)
        return bool(went_on and np.all(np.abs(stamps) <= SILENT_S))


@dataclass
class Piece:
    """What a piece of a log holds.

    ``rows``: for each kind times [s], one per message, and values by signal and message. ``said``: messages that tell
    of events, with their times. ``used``: bytes that were looked at; ``lost``: those of them that are no record;
    ``bad``: records with a wrong checksum.
    """

    used: int
    lost: int
    frames: int
    rows: dict[Kind, tuple[Array, NDArray[np.float32]]] = field(default_factory=dict)
    said: list[tuple[float, Message]] = field(default_factory=list)
    bad: int = 0


def read_piece(data: bytes, clock: Clock) -> Piece:
    """Decode the whole records at the start of ``data``; what is between them and no record is passed over."""
    starts, used, lost = record_starts(data)
    piece = Piece(used, lost, len(starts))
    if not starts:
        return piece
    content = np.frombuffer(data, dtype=np.uint8)
    start = np.array(starts, dtype=np.int64)
    head = start + STAMP
    number = content[head + 7] + (content[head + 8].astype(np.int64) << 8) + (content[head + 9].astype(np.int64) << 16)
    start, number = _of_the_robot(content, start, number, clock)
    found: dict[Kind, tuple[NDArray[np.int64], Array | None, NDArray[np.float32]]] = {}
    said: list[tuple[int, Message]] = []
    for kind in KINDS:
        mine = start[number == _message_class(kind.message).id]
        if not len(mine):
            continue
        if kind in AS_ARRAYS:
            rows = _from_arrays(kind, content, mine, piece)
        else:
            rows = _one_by_one(kind, data, mine, said, piece)
        if len(rows[0]):
            found[kind] = rows
    other = [_message_class(name).id for name in SAID if name != "OMNI_STATUS"]
    for place in start[np.isin(number, other)]:
        message = _decoded(data, int(place), piece)
        if message is not None:
            said.append((int(place), message))
    _set_times(piece, found, said, clock, content)
    return piece


def record_starts(data: bytes) -> tuple[list[int], int, int]:
    """Return where whole records begin, how many bytes were looked at, and how many of these are no record."""
    starts: list[int] = []
    at, lost, end = 0, 0, len(data)
    while at + STAMP + HEAD + CHECKSUM <= end:
        if data[at + STAMP] != mavlink.PROTOCOL_MARKER_V2:
            marker = data.find(mavlink.PROTOCOL_MARKER_V2, at + STAMP + 1)
            found = (end if marker < 0 else marker) - STAMP
            lost += found - at
            at = found
            continue
        size = STAMP + HEAD + CHECKSUM + data[at + STAMP + 1]
        if data[at + STAMP + 2] & mavlink.MAVLINK_IFLAG_SIGNED:
            size += SIGNATURE
        if at + size > end:
            break
        starts.append(at)
        at += size
    return starts, at, lost


def _of_the_robot(
    content: Bytes, start: NDArray[np.int64], number: NDArray[np.int64], clock: Clock
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Leave out what stations, other components and other robots said, which a log of a link holds too."""
    system, robot = content[start + STAMP + 5], content[start + STAMP + 6] == ROBOT_COMPONENT
    telemetry = [_message_class(name).id for name in ("HEARTBEAT", *(kind.message for kind in KINDS))]
    first = np.flatnonzero(robot & np.isin(number, telemetry))
    if not clock.system and len(first):
        clock.system = int(system[first[0]])
    robot &= system == clock.system
    return start[robot], number[robot]


def _message_class(name: str) -> Any:
    return getattr(mavlink, f"MAVLink_{name.lower()}_message")


def _from_arrays(
    kind: Kind, content: Bytes, start: NDArray[np.int64], piece: Piece
) -> tuple[NDArray[np.int64], Array | None, NDArray[np.float32]]:
    message = _message_class(kind.message)
    layout = _layout(message)
    size = content[start + STAMP + 1]
    payload = np.zeros((len(start), layout.itemsize), dtype=np.uint8)
    good = np.zeros(len(start), dtype=bool)
    for length in np.unique(size).tolist():  # zeros at the end of a payload are not sent
        mine = np.flatnonzero(size == length)
        frame = content[start[mine, None] + STAMP + np.arange(HEAD + length + CHECKSUM)]
        good[mine] = _checksum_fits(frame, message.crc_extra)
        known = min(length, layout.itemsize)
        payload[mine, :known] = frame[:, HEAD : HEAD + known]
    piece.bad += int(np.count_nonzero(~good))
    start, record = start[good], payload[good].view(layout)[:, 0]
    texts = AS_ARRAYS[kind]
    columns: Any = SimpleNamespace(
        **{name: 0 if name in texts else record[name].T for name in message.ordered_fieldnames}
    )
    telemetry: Any = kind.decoded(columns)
    rows = np.array([np.broadcast_to(part, len(start)) for part in parts_of(telemetry)], dtype=np.float32)
    return start, np.asarray(telemetry.time_s, dtype=np.float64), rows


def _layout(message: Any) -> np.dtype[Any]:
    """Return a message's payload as it is on the wire."""
    formats = message.native_format.decode().lstrip("<")
    fields = zip(message.ordered_fieldnames, formats, message.array_lengths, strict=True)
    return np.dtype([(name, _TYPES[kind], (count,)) if count else (name, _TYPES[kind]) for name, kind, count in fields])


def _checksum_fits(frame: Bytes, extra: int) -> NDArray[np.bool_]:
    """Return which frames, one per row, have the checksum that they say (CRC-16/MCRF4XX, as MAVLink has it)."""
    crc = np.full(len(frame), 0xFFFF, dtype=np.uint16)
    for column in (*frame[:, 1:-CHECKSUM].T, np.full(len(frame), extra, dtype=np.uint8)):
        low = column.astype(np.uint16) ^ (crc & 0xFF)
        low ^= (low << 4) & 0xFF
        crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    said = frame[:, -2].astype(np.uint16) | (frame[:, -1].astype(np.uint16) << 8)
    return np.asarray(crc == said)


def _one_by_one(
    kind: Kind, data: bytes, start: NDArray[np.int64], said: list[tuple[int, Message]], piece: Piece
) -> tuple[NDArray[np.int64], Array | None, NDArray[np.float32]]:
    places: list[int] = []
    times: list[float | None] = []
    rows: list[list[float]] = []
    for place in start.tolist():
        message = _decoded(data, place, piece)
        if message is None:
            continue
        telemetry = kind.decoded(message)
        places.append(place)
        times.append(getattr(telemetry, "time_s", None))
        rows.append(values(telemetry))
        if kind.message in SAID:
            said.append((place, message))
    timed = None if None in times else np.array(times, dtype=np.float64)
    table = np.array(rows, dtype=np.float32).reshape(len(rows), len(signals_of(kind)))
    return np.array(places, dtype=np.int64), timed, table.T


def _decoded(data: bytes, start: int, piece: Piece) -> Message | None:
    frame = start + STAMP
    end = frame + HEAD + data[frame + 1] + CHECKSUM
    if data[frame + 2] & mavlink.MAVLINK_IFLAG_SIGNED:
        end += SIGNATURE
    try:
        message: Message = mavlink.MAVLink(None).decode(bytearray(data[frame:end]))
    except mavlink.MAVError:
        piece.bad += 1
        return None
    return message


def _set_times(
    piece: Piece,
    found: Mapping[Kind, tuple[NDArray[np.int64], Array | None, NDArray[np.float32]]],
    said: list[tuple[int, Message]],
    clock: Clock,
    content: Bytes,
) -> None:
    """Put everything on one time axis; what has no time of its own came at the time of what was before it."""
    before_s = clock.newest_s
    timed = [(kind, start, time_s) for kind, (start, time_s, _) in found.items() if time_s is not None]
    start = np.concatenate([start for _, start, _ in timed] or [np.zeros(0, dtype=np.int64)])
    order = np.argsort(start)
    robot_s = np.concatenate([time_s for _, _, time_s in timed] or [np.zeros(0)])[order]
    stamps = content[start[order, None] + np.arange(STAMP)].view(">u8")[:, 0]
    followed = clock.follow_all(robot_s, stamps * 1e-6)
    first_s = before_s if before_s is not None else float(followed[0]) if len(followed) else 0.0
    newest = np.concatenate(([first_s], np.maximum.accumulate(followed)))
    time_s = np.empty(len(start))
    time_s[order] = followed
    at = 0
    for kind, mine, _ in timed:
        own = time_s[at : at + len(mine)]
        at += len(mine)
        in_time = np.argsort(own, kind="stable")
        piece.rows[kind] = own[in_time], found[kind][2][:, in_time]
    for kind, (mine, own_s, rows) in found.items():
        if own_s is None:
            piece.rows[kind] = newest[np.searchsorted(start[order], mine)], rows
    for place, message in sorted(said, key=lambda entry: entry[0]):
        piece.said.append((float(newest[np.searchsorted(start[order], place, side="right")]), message))
