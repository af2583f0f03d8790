# SPDX-License-Identifier: MIT
"""A telemetry log as arrays, and the numbers that say how the drive was."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel import parameter_file
from omniwheel.dialect import Message, is_autopilot
from omniwheel.errors import DatasetError, LogError, ParameterFileError
from omniwheel.logs.run_folder import DRIVE_PARAMETERS, DRIVE_TLOG
from omniwheel.pose_jumps import Geometry, PoseJump, Steps, geometry_of, jumps_of, steps_of
from omniwheel.robots import parameter_table
from omniwheel.telemetry import Control, Heartbeat, Status, StatusText, Tracking, Wheels, decode
from omniwheel.tlog_reader import (
    ROBOT_COMPONENT,
    PartReader,
    RobotClock,
    TlogReader,
    iterate_messages,
    iterate_part,
    recorded_s,
)

Array = NDArray[np.float64]
FULL_DUTY = 0.99
MOST_NOTES = 5
"""Jumps of the pose estimate of which each is said by itself."""


@dataclass(frozen=True)
class TelemetryRecord:
    """What a robot said, in the order of its clock; times [s] on that clock.

    ``pose`` and ``reference``: rows of x [m], y [m], theta [rad, not wrapped], at ``time_s``. ``speed``, ``wanted``
    [rad/s] and ``duty`` -1..1: rows per wheel at ``wheel_time_s``. ``fixes``: rows of time, x, y, theta as they were
    sent with the robot's time. ``events``: what happened, in words. ``stops``: names of the faults that stopped it.
    ``starts``: times between the parts of the log, because the robot restarted or nothing was heard of it. No number is
    taken across. After a restart the clock goes on a second later here. ``notes``: what has to be said of the log.
    ``geometry`` is the robot's, as far as it is known: what its wheels can move it by. Where the pose estimate jumps
    further (``jumps``) no number is taken across either, and a heading goes on unwrapped from there.
    """

    time_s: Array
    pose: Array
    reference: Array
    wheel_time_s: Array
    speed: Array
    wanted: Array
    duty: Array
    events: tuple[tuple[float, str], ...]
    stops: tuple[str, ...]
    starts: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    geometry: Geometry = field(default_factory=Geometry)

    @cached_property
    def steps(self) -> Steps:
        """What lies between each row of the pose and the next."""
        return steps_of(self.time_s, self.pose, self.wheel_time_s, self.speed, self.geometry)

    @cached_property
    def jumps(self) -> tuple[PoseJump, ...]:
        """Where the pose estimate jumps within a part of the log."""
        joined = np.ones(max(len(self.time_s) - 1, 0), dtype=np.bool_)
        borders = self.borders(self.time_s)
        joined[borders[(borders > 0) & (borders < len(self.time_s))] - 1] = False
        return tuple(jumps_of(self.time_s, self.steps, joined))

    @property
    def wheels(self) -> int:
        """Number of wheels that ever turned or were driven; 4 entries are sent for every robot."""
        used = np.any((self.speed != 0.0) | (self.duty != 0.0), axis=0) if len(self.speed) else np.zeros(4, dtype=bool)
        return int(np.max(np.flatnonzero(used))) + 1 if used.any() else 3

    def borders(self, times: Array) -> NDArray[np.int64]:
        """Return the rows of some of its times at which another part begins."""
        return np.unique(np.searchsorted(times, np.array(self.starts)))

    def pose_borders(self) -> NDArray[np.int64]:
        """Return the rows of the pose at which another part begins, or to which the estimate jumped."""
        places = np.array([*self.starts, *(jump.time_s for jump in self.jumps)])
        return np.unique(np.searchsorted(self.time_s, places))

    def numbers(self) -> dict[str, float | None]:
        """Return how the drive was; None where nothing was recorded that says so.

        The distance and the speed are those that the wheels can have moved the robot by: what a pose fix moves the
        estimate by is no motion.
        """
        error = self.pose - self.reference
        rows = np.arange(len(self.time_s) - 1)
        lasts = self.steps.time_s[np.setdiff1d(rows, self.borders(self.time_s) - 1)]
        joined = np.setdiff1d(rows, self.pose_borders() - 1)
        steps = np.minimum(self.steps.distance_m, self.steps.reach_m)[joined]
        speeds = steps / self.steps.time_s[joined]
        return {
            "duration_s": float(np.sum(lasts)) if len(lasts) else None,
            "way_m": float(np.sum(steps)) if len(steps) else None,
            "position_rmse_m": _rms(np.hypot(error[:, 0], error[:, 1])),
            "heading_rmse_rad": _rms(error[:, 2]),
            "largest_error_m": float(np.max(np.hypot(error[:, 0], error[:, 1]))) if len(error) else None,
            "top_speed_m_s": float(np.max(speeds)) if len(speeds) else None,
            "top_wheel_rad_s": float(np.max(np.abs(self.speed))) if len(self.speed) else None,
            "full_duty_share": float(np.mean(np.abs(self.duty) >= FULL_DUTY)) if len(self.duty) else None,
            "pose_jumps": float(len(self.jumps)) if len(self.time_s) else None,
        }


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def read_record(path: Path, part: int | None = None) -> TelemetryRecord:
    """Read a telemetry log (.tlog), or one ``part`` of it.

    Raises LogError if it is none, or holds neither poses nor wheels.
    """
    reader = TlogReader(path)
    parts = PartReader(iterate_messages(reader))
    try:
        messages = iterate_messages(reader) if part is None else iterate_part(parts, path, part)
        record = record_of(messages, parameters_beside(path))
    except DatasetError as error:
        hint = "give a .tlog file, written by `omni record` or `omni drive`"
        raise LogError(str(error), hint=error.hint if part is not None else hint) from error
    if not len(record.time_s) and not len(record.wheel_time_s):
        raise LogError(
            f"{path} has neither OMNI_TRACKING nor OMNI_WHEELS", hint="check that it is a log of an Omniwheel robot"
        )
    said = (*record.notes, "" if part is None else parts.note(part), reader.note())
    return replace(record, notes=tuple(note for note in said if note))


def parameters_beside(log: Path) -> dict[str, float]:
    """Return what the drive began with, if the log lies in a run's folder; else nothing."""
    if log.name != DRIVE_TLOG:
        return {}
    try:
        return dict(parameter_file.read(log.with_name(DRIVE_PARAMETERS), parameter_table()))
    except ParameterFileError:
        return {}


def record_of(messages: Iterable[Message], parameters: Mapping[str, float] | None = None) -> TelemetryRecord:
    """Return the record of messages in the order in which they came.

    ``parameters`` of the robot, as far as they are known; else those that are among the messages count.
    """
    known = dict(parameters or {})
    tracking, wheels = _Rows(1 + 3 + 3), _Rows(1 + 3 * 4)
    watcher, clock, system, others = EventWatcher(), RobotClock(), 0, set()
    for message in messages:
        placed, turned = decode(Tracking, message), decode(Wheels, message)
        told = placed or turned
        if message.get_srcComponent() != ROBOT_COMPONENT:
            continue
        if told is not None or is_autopilot(message):
            system = system or message.get_srcSystem()
        if system not in (0, message.get_srcSystem()):
            others |= {message.get_srcSystem()} if told is not None else set()
            continue
        if told is not None:
            parts = len(clock.starts)
            watcher.now_s = time_s = clock.follow(told.time_s, recorded_s(message))
            watcher.events += clock.starts[parts:]
            if placed is not None:
                tracking.add(time_s, placed.pose, placed.reference)
            elif turned is not None:
                wheels.add(time_s, turned.speed_rad_s, turned.reference_rad_s, turned.duty)
        else:
            watcher.take(message)
            if message.get_type() == "PARAM_VALUE":
                known[str(message.param_id)] = float(message.param_value)
    poses, turns = tracking.in_order(), wheels.in_order()
    notes = [f"another part of the log begins at {time_s:.1f} s: {why}" for time_s, why in clock.starts]
    for kind, name in ((tracking, Tracking.message), (wheels, Wheels.message)):
        if kind.left_out:
            notes.append(f"{kind.left_out} of {name} are ignored: their numbers are not finite")
    notes += [f"messages of robot {number} are ignored" for number in sorted(others)]
    record = TelemetryRecord(
        time_s=poses[:, 0],
        pose=poses[:, 1:4],
        reference=poses[:, 4:7],
        wheel_time_s=turns[:, 0],
        speed=turns[:, 1:5],
        wanted=turns[:, 5:9],
        duty=turns[:, 9:13],
        events=tuple(watcher.events),
        stops=tuple(watcher.stops),
        starts=tuple(time_s for time_s, _ in clock.starts),
        notes=tuple(notes),
        geometry=geometry_of(known),
    )
    for rows in np.split(np.arange(len(poses)), record.pose_borders()):
        _unwrap(record.pose, record.reference, rows)
    return _with_jumps_said(record)


def _with_jumps_said(record: TelemetryRecord) -> TelemetryRecord:
    """Return a record whose events and notes name the jumps of the pose estimate."""
    if not record.jumps:
        return record
    events = [*record.events, *((jump.time_s, jump.text) for jump in record.jumps)]
    notes = [
        f"at {jump.time_s:.2f} s {jump.text}: the jump is not counted as motion" for jump in record.jumps[:MOST_NOTES]
    ]
    if len(record.jumps) > MOST_NOTES:
        notes.append(f"{len(record.jumps)} jumps in total")
    return replace(record, events=tuple(sorted(events, key=lambda event: event[0])), notes=(*record.notes, *notes))


class _Rows:
    """Rows of numbers that came one by one, of which the first is the time; ``left_out`` had one that is not finite."""

    def __init__(self, width: int) -> None:
        self.left_out = 0
        self._width = width
        self._numbers = array("d")

    def add(self, time_s: float, *parts: Sequence[float]) -> None:
        row = [time_s, *(number for part in parts for number in part)]
        if all(map(math.isfinite, row)):
            self._numbers.extend(row)
        else:
            self.left_out += 1

    def in_order(self) -> Array:
        """Return the rows in the order of time; the latest of those of one time."""
        table = np.frombuffer(self._numbers, dtype=np.float64).reshape(-1, self._width)
        table = table[np.argsort(table[:, 0], kind="stable")]
        return table[np.diff(table[:, 0], append=np.inf) > 0.0]


def _unwrap(pose: Array, reference: Array, rows: NDArray[np.int64]) -> None:
    """Have the headings of some rows go on beyond half a turn, the reference's beside the estimate's."""
    if not len(rows):
        return
    pose[rows, 2], reference[rows, 2] = np.unwrap(pose[rows, 2]), np.unwrap(reference[rows, 2])
    off = pose[rows[0], 2] - reference[rows[0], 2]
    reference[rows, 2] += 2.0 * math.pi * np.round(off / (2.0 * math.pi))


class EventWatcher:
    """Notes what happened: changes of state, mode and parameters, and what the robot said.

    ``now_s`` is the time of what is taken next; ``events`` are times and words, ``stops`` names of stop faults.
    """

    def __init__(self) -> None:
        self.now_s = 0.0
        self.events: list[tuple[float, str]] = []
        self.stops: list[str] = []
        self._last: dict[str, Any] = {}

    def take(self, message: Message) -> None:
        """Take one message of the robot, of any kind."""
        status, text = decode(Status, message), decode(StatusText, message)
        beat, control = decode(Heartbeat, message), decode(Control, message)
        if status is not None:
            self._changed("state", status.state)
            self.stops += [fault for fault in status.fault_history if fault not in self.stops]
        elif text is not None:
            self.events.append((self.now_s, text.text))
        elif beat is not None:
            self._changed("mode", beat.mode)
        elif control is not None:
            self._changed("parameters", control.config_sequence)

    def _changed(self, what: str, value: Any) -> None:
        if what in self._last and self._last[what] != value:
            self.events.append((self.now_s, "parameters changed" if what == "parameters" else f"{what} {value}"))
        self._last[what] = value
