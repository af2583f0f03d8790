# SPDX-License-Identifier: MIT
"""A telemetry log of any length, as plots need it: in memory that does not grow with the log."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni.studio.log_frames import LONGEST_RECORD, Array, Clock, Kind, Piece, read_piece
from omni.studio.marks import Marks
from omni.studio.samples import Trace, extremes, thinned
from omni.studio.signals import MOST_WHEELS, Signal, all_signals, signals_of
from omniwheel.dialect import Message
from omniwheel.errors import LogError
from omniwheel.pose_jumps import NEAR_S, PoseJump, geometry_of, jumps_of, steps_of
from omniwheel.telemetry import Control, Tracking, Wheels
from omniwheel.telemetry_record import EventWatcher, parameters_beside

PIECE_BYTES = 1 << 20
MOST_PIECES = 32
"""A view over more of them is drawn from the overview."""
MOST_BINS = 1 << 16
"""Bins of the overview, each of which keeps its least and its largest value."""
MOST_EVENTS = 500


class Overview:
    """The least and the largest value of every signal of one kind in bins, which widen as the log goes on."""

    def __init__(self) -> None:
        self._bin = 1
        self._parts: list[tuple[Array, NDArray[np.float32]]] = []
        self._count = 0

    def add(self, time_s: Array, value: NDArray[np.float32]) -> None:
        """Take samples: their times, and values by signal and sample."""
        self._keep(np.broadcast_to(time_s, value.shape), value, self._bin)
        while self._count > 2 * MOST_BINS:
            time, whole = self.all()
            self._parts, self._count = [], 0
            self._bin *= 2
            self._keep(time, whole, 4)  # two bins, of two samples each

    def _keep(self, time_s: Array, value: NDArray[np.float32], size: int) -> None:
        if size > 2:
            places = extremes(value, size)
            time_s, value = np.take_along_axis(time_s, places, 1), np.take_along_axis(value, places, 1)
        self._parts.append((time_s, value))
        self._count += value.shape[1]

    def all(self) -> tuple[Array, NDArray[np.float32]]:
        """Return times [s] and values, each by signal and place."""
        if len(self._parts) > 1:
            times, values = zip(*self._parts, strict=True)
            self._parts = [(np.concatenate(times, axis=1), np.concatenate(values, axis=1))]
        return self._parts[0]


class JumpWatch:
    """Finds the jumps of the pose estimate in pieces of a log, and across their borders."""

    def __init__(self) -> None:
        self.jumps: list[PoseJump] = []
        self._tracking = np.zeros((0, 1 + 3))
        self._wheels = np.zeros((0, 1 + MOST_WHEELS))

    def take(self, piece: Piece, starts: Sequence[tuple[float, str]], parameters: Mapping[str, float]) -> None:
        """Look at a piece; nothing is compared across ``starts``, where another part of the log begins."""
        tracking = _in_order(self._tracking, _table(piece, Tracking, _POSE))
        self._wheels = _in_order(self._wheels, _table(piece, Wheels, _SPEEDS))
        if len(tracking):
            time_s, wheel_time_s = tracking[:, 0], self._wheels[:, 0]
            steps = steps_of(time_s, tracking[:, 1:], wheel_time_s, self._wheels[:, 1:], geometry_of(parameters))
            begins = np.searchsorted(np.array([start_s for start_s, _ in starts]), time_s)
            self.jumps += jumps_of(time_s, steps, np.diff(begins) == 0)[: MOST_EVENTS - len(self.jumps)]
            self._wheels = self._wheels[wheel_time_s >= time_s[-1] - NEAR_S]
            self._tracking = tracking[-1:]


class RecordedLog:
    """An open telemetry log. Times are seconds since its first telemetry. Raises LogError if it holds none."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._overviews: dict[Kind, Overview] = {}
        self._begins: list[tuple[int, Clock, float]] = []  # of each piece: its place, the clock and the time there
        self._cache: OrderedDict[int, Piece] = OrderedDict()
        self._watcher = EventWatcher()
        self._jumps = JumpWatch()
        self._marks = Marks()
        self._known = parameters_beside(path)
        self._starts: tuple[tuple[float, str], ...] = ()
        self.start_s, self.end_s = 0.0, 0.0
        self.lost_bytes = self.bad_frames = 0
        try:
            self._file = os.open(path, os.O_RDONLY)
        except OSError as error:
            raise LogError(f"{path.name}: {error.strerror}", hint="check that the file still exists") from error
        try:
            self._read()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let go of the file."""
        os.close(self._file)

    def _read(self) -> None:
        size, at, frames, clock = os.fstat(self._file).st_size, 0, 0, Clock()
        while at < size:
            began = replace(clock)
            piece = self._piece_at(at, clock)
            if not piece.used:
                break
            if clock.newest_s is not None:
                if not self._begins:
                    self.start_s = min(float(time_s[0]) for time_s, _ in piece.rows.values())
                self._begins.append((at, began, self.start_s if began.newest_s is None else began.newest_s))
            self._note(piece)
            self._jumps.take(piece, clock.starts, self._known)
            at += piece.used
            frames += piece.frames
        self.lost_bytes += size - at
        self._starts = clock.starts
        if not frames:
            raise LogError(f"{self.path.name} is not a telemetry log: it has no MAVLink 2 frame", hint=_HINT)
        if not self._overviews:
            raise LogError(f"{self.path.name} holds no telemetry of a robot with this firmware", hint=_HINT)
        self.end_s = max(float(np.max(overview.all()[0])) for overview in self._overviews.values())

    def _piece_at(self, at: int, clock: Clock) -> Piece:
        data = os.pread(self._file, PIECE_BYTES + LONGEST_RECORD, at)
        return read_piece(data, clock)

    def _note(self, piece: Piece) -> None:
        self.lost_bytes += piece.lost
        self.bad_frames += piece.bad
        for kind, (time_s, value) in piece.rows.items():
            self._overviews.setdefault(kind, Overview()).add(time_s, value)
        self._note_events(piece)

    def _note_events(self, piece: Piece) -> None:
        """Have marks and events made of what was said, in the order of time."""
        happened: list[tuple[float, Message | int]] = [*piece.said, *_new_sequences(piece)]
        for time_s, what in sorted(happened, key=lambda entry: entry[0]):
            if isinstance(what, int):
                self._marks.sequence(what, time_s)
            elif what.get_type() == "PARAM_VALUE":
                name, value = str(what.param_id), float(what.param_value)
                before = self._known.get(name, value)
                self._known[name] = value
                self._marks.overdue(time_s)
                if before != value:
                    self._marks.changed({name: (before, value)}, time_s)
            elif len(self._watcher.events) < MOST_EVENTS:
                self._watcher.now_s = time_s
                self._watcher.take(what)

    # ---- what a page is told

    def signals(self) -> list[Signal]:
        """Return the signals of which the log holds samples."""
        wheels = int(self._known.get("WHEELS", MOST_WHEELS))
        return [signal for signal in all_signals(wheels) if signal.kind in self._overviews]

    def marks(self) -> list[dict[str, Any]]:
        """Return changes of parameters and events on the log's time, as a page draws them."""
        self._marks.overdue(float("inf"))
        changes = [{**mark.as_json(), "time_s": mark.time_s - self.start_s} for mark in self._marks.all()]
        jumps = [(jump.time_s, jump.text) for jump in self._jumps.jumps]
        events = [
            {"number": 0, "time_s": max(time_s - self.start_s, 0.0), "changes": {}, "text": what}
            for time_s, what in (*self._watcher.events, *self._starts, *jumps)
        ]
        return sorted(changes + events, key=lambda mark: float(str(mark["time_s"])))

    def window(self, keys: Sequence[str], begin_s: float, end_s: float, width: int) -> list[Trace]:
        """Return of each of these signals what a plot of ``width`` pixels shows between two times."""
        pieces = self._pieces(begin_s, end_s)
        return [thinned(self._trace(signal, begin_s, end_s, pieces), width) for signal in self._wanted(keys)]

    def samples(self, keys: Sequence[str], begin_s: float, end_s: float) -> list[Trace]:
        """Return every sample of these signals between two times. Raises LogError for too long a stretch."""
        pieces = self._pieces(begin_s, end_s)
        if pieces is None:
            raise LogError("the selected interval of the log is too long", hint="select a shorter one with the mouse")
        return [self._trace(signal, begin_s, end_s, pieces) for signal in self._wanted(keys)]

    def path_s(self) -> float | None:
        """Return when the robot began to follow its path, past the way to its beginning; None if it never did.

        In a long log to within a bin of the overview.
        """
        overview = self._overviews.get(Tracking)
        if overview is None:
            return None
        times, values = overview.all()
        row = next(signal.column for signal in signals_of(Tracking) if signal.key == _PATH_TIME)
        on_path = np.flatnonzero(values[row] > 0.0)
        return None if not len(on_path) else float(times[row][on_path[0]] - self.start_s)

    def parameters(self) -> dict[str, float]:
        """Return what the log tells of the parameters at its end, and what lies beside it."""
        return dict(self._known)

    def _wanted(self, keys: Sequence[str]) -> list[Signal]:
        known = {signal.key: signal for signal in self.signals()}
        return [known[key] for key in keys if key in known]

    def _pieces(self, begin_s: float, end_s: float) -> list[Piece] | None:
        """Return the pieces that hold what is between two times; None if they are too many."""
        begin, end = begin_s + self.start_s, end_s + self.start_s
        times = [time_s for _, _, time_s in self._begins]
        first = max(int(np.searchsorted(times, begin)) - 1, 0)
        last = int(np.searchsorted(times, end, side="right"))
        return None if last - first > MOST_PIECES else [self._cached(n) for n in range(first, last)]

    def _trace(self, signal: Signal, begin_s: float, end_s: float, pieces: list[Piece] | None) -> Trace:
        begin, end = begin_s + self.start_s, end_s + self.start_s
        row = signal.column
        if pieces is None:
            times, values = self._overviews[signal.kind].all()
            time_s, value = times[row], values[row]
        else:
            parts = [piece.rows[signal.kind] for piece in pieces if signal.kind in piece.rows]
            time_s = np.concatenate([time_s for time_s, _ in parts] or [np.zeros(0)])
            value = np.concatenate([rows[row] for _, rows in parts] or [np.zeros(0, dtype=np.float32)])
        inside = np.isfinite(value) & (time_s >= begin) & (time_s <= end)
        time_s, value = time_s[inside], value[inside]
        newer = np.diff(np.maximum.accumulate(time_s), prepend=-np.inf) > 0.0  # a plot's times rise
        return Trace(signal.key, time_s[newer] - self.start_s, value[newer])

    def _cached(self, number: int) -> Piece:
        piece = self._cache.pop(number, None)
        if piece is None:
            at, clock, _ = self._begins[number]
            piece = self._piece_at(at, replace(clock))
            piece.said.clear()
        self._cache[number] = piece
        while len(self._cache) > MOST_PIECES:
            self._cache.popitem(last=False)
        return piece


_HINT = "give a .tlog file, written by `omni record`, `omni drive` or the studio"
_SEQUENCE = "control.config_sequence"
_PATH_TIME = "tracking.path_time"
_POSE = ("tracking.pose.x", "tracking.pose.y", "tracking.pose.theta")
_SPEEDS = tuple(f"wheels.speed.{wheel + 1}" for wheel in range(MOST_WHEELS))


def _table(piece: Piece, kind: Kind, keys: Sequence[str]) -> Array:
    """Return rows of time and these signals; none if the piece has no such messages."""
    if kind not in piece.rows:
        return np.zeros((0, 1 + len(keys)))
    time_s, values = piece.rows[kind]
    column = {signal.key: signal.column for signal in signals_of(kind)}
    return np.column_stack((time_s, *(values[column[key]] for key in keys))).astype(np.float64)


def _in_order(before: Array, rows: Array) -> Array:
    """Return the rows of two tables in the order of time, each time once; the latest of those of one time."""
    both = np.concatenate((before, rows))
    both = both[np.argsort(both[:, 0], kind="stable")]
    return np.asarray(both[np.diff(both[:, 0], append=np.inf) > 0.0])


def _new_sequences(piece: Piece) -> list[tuple[float, int]]:
    """Return when which number of a parameter set came into use; the first one of a piece is always among them."""
    if Control not in piece.rows:
        return []
    times, values = piece.rows[Control]
    numbers = values[next(signal.column for signal in signals_of(Control) if signal.key == _SEQUENCE)]
    places = np.flatnonzero(np.diff(numbers, prepend=np.nan) != 0.0)
    return [(float(times[place]), int(numbers[place])) for place in places.tolist()]
