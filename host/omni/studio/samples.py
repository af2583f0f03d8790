# SPDX-License-Identifier: MIT
"""The latest minutes of every signal, and what of them a plot of a given width can show."""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omni.studio.signals import Signal, signals_of, values
from omniwheel.telemetry import Telemetry
from omniwheel.tlog_reader import RobotClock

CAPACITY = 150_000
"""Samples kept per message: 12.5 minutes at 200 Hz. The oldest ones go."""
_BLOCK = struct.Struct("<II")
_HEADER = struct.Struct("<HHId")
SAMPLES_SINCE, SAMPLES_WINDOW, SAMPLES_PART = 1, 2, 3
"""What came since the last message; everything that a page keeps; what a plot sees between two times."""
MOST_NUMBER = 0xFFFF

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trace:
    """A piece of one signal: times on the page's clock [s] and values in the signal's unit."""

    key: str
    time_s: Array
    value: NDArray[np.float32]


class _Ring:
    """Samples of one message. The memory is taken once: it does not grow with the hours.

    It is filled at once. What is only reserved, as by ``np.zeros``, is taken page by page as samples come. For a
    message that comes once a second, that goes on for 41 hours.
    """

    def __init__(self, width: int) -> None:
        self.time_s = np.full(CAPACITY, np.nan)
        self.value = np.full((width, CAPACITY), np.nan, dtype=np.float32)
        self.count = 0
        """All that ever came."""

    def append(self, time_s: float, row: list[float]) -> None:
        place = self.count % CAPACITY
        self.time_s[place] = time_s
        self.value[:, place] = row
        self.count += 1

    def since(self, number: int, column: int) -> tuple[Array, NDArray[np.float32]]:
        """Return the samples from this number on, as far as they are still there and are numbers."""
        first = max(number, self.count - CAPACITY, 0)
        places = np.arange(first, self.count) % CAPACITY
        value = self.value[column, places]
        there = np.isfinite(value)
        return self.time_s[places][there], value[there]


class SampleStore:
    """Takes telemetry and gives it back by signal.

    Times are the robot's clock. It begins at 0 again when the robot restarts: then the store's time goes on instead.
    """

    def __init__(self) -> None:
        self._rings: dict[type[Telemetry], _Ring] = {}
        self._clock = RobotClock()
        self.now_s = 0.0
        """The newest sample's time."""
        self.arrived_s = 0.0
        """When the newest message came, on this computer's clock [s since 1970]."""

    def take(self, telemetry: Telemetry) -> float:
        """Keep a message; return its time."""
        kind = type(telemetry)
        self.arrived_s = time.time()
        robot_s = getattr(telemetry, "time_s", None)
        if robot_s is None:
            time_s = self.now_s
        else:
            time_s = self._clock.follow(robot_s, time.monotonic())
            self.now_s = max(self.now_s, time_s)
        ring = self._rings.get(kind)
        if ring is None:
            ring = self._rings[kind] = _Ring(len(signals_of(kind)))
        ring.append(time_s, values(telemetry))
        return time_s

    def count(self, signal: Signal) -> int:
        """Return the number that the next sample of this signal will have."""
        ring = self._rings.get(signal.kind)
        return 0 if ring is None else ring.count

    def since(self, signal: Signal, number: int) -> Trace:
        """Return the samples from this number on."""
        ring = self._rings.get(signal.kind)
        if ring is None:
            return Trace(signal.key, np.zeros(0), np.zeros(0, dtype=np.float32))
        return Trace(signal.key, *ring.since(number, signal.column))

    def window(self, signal: Signal, begin_s: float, end_s: float, width: int) -> Trace:
        """Return what a plot of ``width`` pixels shows between two times: per pixel the least and the largest value."""
        whole = self.since(signal, 0)
        inside = (whole.time_s >= begin_s) & (whole.time_s <= end_s)
        return thinned(Trace(signal.key, whole.time_s[inside], whole.value[inside]), width)


def thinned(trace: Trace, width: int) -> Trace:
    """Return at most ``2 * width`` samples that keep every spike: the least and the largest of each bin, in order."""
    count = len(trace.time_s)
    if count <= 2 * width:
        return trace
    chosen = np.unique(extremes(trace.value[None], -(-count // width)))
    return Trace(trace.key, trace.time_s[chosen], trace.value[chosen])


def extremes(value: NDArray[np.float32], size: int) -> NDArray[np.int64]:
    """Return where the least and the largest number of each ``size`` columns are, in order, for every row of ``value``.

    The last bin may be shorter. What is no number is passed over; a bin without any gives its first place.
    """
    rows, count = value.shape
    bins = -(-count // size)
    padded = np.pad(value, ((0, 0), (0, bins * size - count)), mode="edge").reshape(rows, bins, size)
    known = np.isfinite(padded)
    least = np.where(known, padded, np.inf).argmin(axis=2)  # the first of equals: never one of the padding
    largest = np.where(known, padded, -np.inf).argmax(axis=2)
    places = np.sort(np.stack((least, largest), axis=2), axis=2) + size * np.arange(bins)[None, :, None]
    return np.asarray(places.reshape(rows, 2 * bins), dtype=np.int64)


def packed(kind: int, arrived_s: float, traces: Sequence[Trace], keys: Sequence[str], number: int = 0) -> bytes:
    """Return traces as the page reads them, little-endian.

    First two u16, ``kind`` and ``number``: which list of signals the page had asked for. Then a u32, how many traces
    there are, and an f64: when the newest message arrived, on this computer's clock [s since 1970]. Then for each trace
    two u32: its place in that list of signals, and its number n of samples. Behind them n f64 times [s] and n f32
    values, padded to 8 bytes.
    """
    places = {key: place for place, key in enumerate(keys)}
    parts = [_HEADER.pack(kind, number, len(traces), arrived_s)]
    for trace in traces:
        value = trace.value.astype("<f4").tobytes()
        parts += [
            _BLOCK.pack(places[trace.key], len(trace.time_s)),
            trace.time_s.astype("<f8").tobytes(),
            value,
            b"\0" * (-len(value) % 8),
        ]
    return b"".join(parts)
