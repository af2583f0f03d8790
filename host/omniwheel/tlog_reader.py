# SPDX-License-Identifier: MIT
"""Reads telemetry logs (``.tlog``, ``.mcap``) record by record, passes over what is no record, finds robots' restarts.

The memory it needs does not grow with the log.
"""

from __future__ import annotations

import errno
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO

from omniwheel import mcap_file
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import DatasetError

STAMP = 8
ENDINGS = (".tlog", mcap_file.ENDING)
"""Of files that are telemetry logs."""
NO_LOG_HINT = "record with `omni identify live --log`, or ask for OMNI_SAMPLE at 50 Hz before `omni record`"
_CHUNK = 1 << 20
_LONGEST = STAMP + 10 + 255 + 2 + 13
_MARKERS = (mavlink.PROTOCOL_MARKER_V1, mavlink.PROTOCOL_MARKER_V2)
ROBOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1, as which the firmware sends."""
LATE_S = 1.0
"""A radio may bring a message so late. What lies further back is of a clock that began again."""
SILENT_S = 5.0
"""After so long without the robot's time, nothing is known of what was between."""
RESTARTED = "the robot restarted"
WRAPPED = "the robot's clock of 32 bits wrapped"
PAUSED_S = 0.3
"""The telemetry that is drawn or integrated comes more often."""
JITTER_S = 0.02
"""Messages of one link come out of order by so much at most, but for what a radio brings late."""
WRAP_S = 2.0**32 * 1e-3
_TIMED = {
    "OMNI_TRACKING": ("time_boot_ms", 1e-3),
    "OMNI_WHEELS": ("time_boot_ms", 1e-3),
    "OMNI_SAMPLE": ("time_us", 1e-6),
}


@dataclass
class TlogReader:
    """Iterates over the messages of a log in their order; afterwards ``skipped`` says how many bytes are no record.

    :func:`recorded_s` tells when each was recorded.
    Frames of MAVLink 1 and 2 are read. Frames with a wrong checksum are skipped. Raises OSError; of a file .mcap also
    what :func:`omniwheel.mcap_file.read_mcap` raises.
    """

    path: Path
    skipped: int = 0
    frames: int = 0
    records: bytes | None = None
    """The log itself, where it is in no file."""

    def _open(self) -> IO[bytes]:
        if self.records is not None:
            return BytesIO(self.records)
        if self.path.is_char_device():  # /dev/zero has no end
            raise OSError(errno.EINVAL, "is a device; give a file", str(self.path))
        if self.path.suffix.lower() == mcap_file.ENDING:
            return BytesIO(mcap_file.read_mcap(self.path).records)
        return self.path.open("rb")

    def __iter__(self) -> Iterator[Message]:
        self.skipped = self.frames = 0
        codec = mavlink.MAVLink(None)
        data, at, ended = b"", 0, False
        with self._open() as file:
            while True:
                if not ended and len(data) - at < 2 * _LONGEST:
                    more = file.read(_CHUNK)
                    ended = not more
                    data, at = data[at:] + more, 0
                    continue
                if at >= len(data):
                    return
                message, end = _record(codec, data, at, ended)
                if message is None:
                    self.skipped += end - at
                else:
                    self.frames += 1
                    yield message
                at = end

    def note(self) -> str:
        """Say what was skipped; "" if nothing."""
        return f"{self.skipped} bytes outside MAVLink frames were skipped" if self.skipped else ""


def _record(codec: mavlink.MAVLink, data: bytes, at: int, ended: bool) -> tuple[Message | None, int]:
    """Return the message of the record at a place and where it ends; without one, where the next may begin."""
    frame = at + STAMP
    end = _frame_end(data, frame)
    if 0 < end <= len(data):
        try:
            message: Message = codec.decode(bytearray(data[frame:end]))
        except mavlink.MAVError:
            message = None  # type: ignore[assignment]
        follows = end + STAMP
        sure = data[follows] in _MARKERS if follows < len(data) else ended and end == len(data)
        if message is not None and (sure or not _is_unknown(message)):
            vars(message)["_timestamp"] = int.from_bytes(data[at:frame], "big") * 1e-6  # where pymavlink has it
            return message, end
        if sure:
            return None, end
    found = [place for marker in _MARKERS if (place := data.find(marker, frame + 1)) >= 0]
    place = min(found) - STAMP if found else len(data) if ended else len(data) - STAMP
    return None, max(place, at + 1)


def recorded_s(message: Message) -> float | None:
    """Return when a message of a log was recorded [s since 1970]; None of one that comes from elsewhere."""
    stamp_s: float | None = vars(message).get("_timestamp")
    return stamp_s


def _is_unknown(message: Message) -> bool:
    """Say whether a message is of no dialect that we know: its checksum cannot be looked at."""
    return message.get_type().startswith("UNKNOWN_")


def _frame_end(data: bytes, frame: int) -> int:
    """Return where a frame ends, or 0 if none begins there."""
    if frame + 3 > len(data) or data[frame] not in _MARKERS:
        return 0
    if data[frame] == mavlink.PROTOCOL_MARKER_V1:
        return frame + 8 + data[frame + 1]
    if data[frame + 2] & ~mavlink.MAVLINK_IFLAG_SIGNED:  # an unknown flag: the frame has another layout
        return 0
    return frame + 12 + data[frame + 1] + (13 if data[frame + 2] else 0)


def _is_restart(robot_s: float, went_s: float, recorded_s: float) -> bool:
    """Return whether a robot's clock that moved by ``went_s`` to ``robot_s`` began again.

    ``recorded_s`` is what the recorder's clock moved by meanwhile. It moves back where logs were joined in another
    order. After a restart it has moved by the robot's new time or more. A late message comes among others.
    """
    if went_s < -JITTER_S and (recorded_s < -JITTER_S or recorded_s >= robot_s):
        return True
    return not -SILENT_S <= recorded_s <= went_s + SILENT_S and not 0.0 <= went_s <= PAUSED_S


@dataclass
class RobotClock:
    """The robot's clock over a log: goes on where its 32 bits wrap, and where the robot restarted and it began again.

    ``starts`` are times between the parts of the log, with what happened there, in words: nothing may be differentiated
    or integrated across.
    """

    newest_s: float | None = None
    offset_s: float = 0.0
    starts: tuple[tuple[float, str], ...] = ()
    stamp_s: float | None = None

    def follow(self, robot_s: float, stamp_s: float | None = None) -> float:
        """Return the log's time for the next of the robot's times, which was recorded at ``stamp_s`` if that is known.

        A clock that began again may be where the old one was. Then the recorder's clock shows the time between. A
        simulated robot's clock stands still for as long as it is paused.
        """
        time_s = robot_s + self.offset_s
        if self.newest_s is None:
            self.newest_s = time_s
        went_s = time_s - self.newest_s
        recorded_s = None if stamp_s is None or self.stamp_s is None else stamp_s - self.stamp_s
        self.stamp_s = stamp_s
        if went_s < -LATE_S and abs(went_s + WRAP_S) < SILENT_S:
            self.offset_s += WRAP_S
            time_s += WRAP_S
        elif went_s < -LATE_S or (recorded_s is not None and _is_restart(robot_s, went_s, recorded_s)):
            self.offset_s += LATE_S - went_s
            time_s = self.newest_s + LATE_S
            self.starts += ((self.newest_s + 0.5 * LATE_S, RESTARTED),)
        elif went_s > SILENT_S:
            silent = f"no message of the robot for {went_s:.1f} s"
            self.starts += ((0.5 * (self.newest_s + time_s), silent),)
        self.newest_s = max(self.newest_s, time_s)
        return time_s


def robot_time_s(message: Message) -> float | None:
    """Return the robot's time of what it tells regularly of its motion; None of any other message."""
    name, unit = _TIMED.get(message.get_type(), ("", 0.0))
    return float(getattr(message, name)) * unit if name and message.get_srcComponent() == ROBOT_COMPONENT else None


@dataclass(frozen=True)
class LogPart:
    """A part of a log without a restart: its number, from 1, and its first and last time on the log's clock [s]."""

    number: int
    begin_s: float
    end_s: float


class PartReader:
    """Iterates over messages with the number of the part that each is in; afterwards ``parts`` has all parts.

    A part ends where the robot restarted, where nothing was heard of it, and where its clock of 32 bits wraps. If
    several robots are in the log, the first one is taken, and what others said of their motion is left out.
    """

    def __init__(self, messages: Iterable[Message]) -> None:
        self.parts: list[LogPart] = []
        self.why = ""
        """Why the second part begins."""
        self._messages = messages

    def __iter__(self) -> Iterator[tuple[int, Message]]:
        clock, system, begin_s, end_s = RobotClock(), 0, 0.0, 0.0
        self.parts, self.why = [], ""
        number, starts, offset_s = 1, 0, 0.0
        for message in self._messages:
            robot_s = robot_time_s(message)
            if robot_s is not None:
                system = system or message.get_srcSystem()
                if message.get_srcSystem() != system:
                    continue
                is_first = clock.newest_s is None
                time_s = clock.follow(robot_s, recorded_s(message))
                if is_first:
                    begin_s = end_s = time_s
                elif len(clock.starts) > starts or clock.offset_s != offset_s:
                    self.why = self.why or (clock.starts[-1][1] if len(clock.starts) > starts else WRAPPED)
                    self.parts.append(LogPart(number, begin_s, end_s))
                    number, begin_s, end_s = number + 1, time_s, time_s
                starts, offset_s = len(clock.starts), clock.offset_s
                end_s = max(end_s, time_s)
            yield number, message
        self.parts.append(LogPart(number, begin_s, end_s))

    def note(self, number: int) -> str:
        """Say which of how many parts this is; "" if there is one."""
        if len(self.parts) == 1:
            return ""
        part = self.parts[number - 1]
        return f"part {number} of {len(self.parts)}, {part.end_s - part.begin_s:.1f} s: {self.why}"

    def listed(self) -> str:
        """Say how long each part is."""
        return ", ".join(f"{part.number}: {part.end_s - part.begin_s:.1f} s" for part in self.parts)


def longest_part(messages: Iterable[Message]) -> tuple[list[Message], str]:
    """Return the messages of a log's longest part, and which of how many it is; "" if there is one."""
    reader = PartReader(messages)
    parts: list[list[Message]] = [[]]
    for number, message in reader:
        if number > len(parts):
            parts.append([])
        parts[-1].append(message)
    longest = max(reader.parts, key=lambda part: part.end_s - part.begin_s).number
    return parts[longest - 1], reader.note(longest)


def iterate_messages(reader: TlogReader) -> Iterator[Message]:
    """Give the messages of a telemetry log in their order. Raises DatasetError."""
    try:
        yield from reader
    except OSError as error:
        raise DatasetError(f"{reader.path}: {error.strerror}", hint="give a .tlog file") from error
    if not reader.frames:
        raise DatasetError(f"{reader.path} is not a telemetry log: it has no MAVLink frame", hint=NO_LOG_HINT)


def iterate_part(parts: PartReader, path: Path, part: int) -> Iterator[Message]:
    """Give the messages of one part of a log. Raises DatasetError."""
    yield from (message for number, message in parts if number == part)
    if not 1 <= part <= len(parts.parts):
        raise DatasetError(f"{path} has no part {part}", hint=f"its parts are {parts.listed()}")
