# SPDX-License-Identifier: MIT
"""The robot's clock seen from the host, by MAVLink's TIMESYNC.

A request carries the host's time, the answer repeats it beside the robot's. If request and answer took equally long the
robot's clock was read half-way between sending and receiving. Whatever the split, that is off by at most half of the
round trip. Radios queue, so most round trips are long and lopsided. The sample that bounds the offset best is kept. It
is the quickest one until the clocks' drift has made it worth less than a newer, slower one.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median

from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import LinkTimeoutError

DRIFT = 1e-4
"""How fast the two clocks may part, s/s: two crystals of 50 ppm."""
ROBOT_RESOLUTION_S = 1e-3
"""The robot tells the time of its latest tick."""
RESTART_S = 0.25
"""No healthy sample is off by this much."""
ANSWER_S = 0.25
"""Longer than an answer takes over any link that is of use."""
_SAMPLES = 32
_PENDING = 8
_QUICK_SAMPLES = 8
_QUICK_PERIOD_S = 0.1
_WAIT_S = 0.01


@dataclass(frozen=True)
class Sample:
    """One round trip: robot's clock minus host's [s], its duration [s], when it ended on the host's clock [s]."""

    offset_s: float
    round_trip_s: float
    taken_s: float

    def error_s(self, now_s: float) -> float:
        """Return how far off the offset can be by ``now_s``."""
        return 0.5 * self.round_trip_s + ROBOT_RESOLUTION_S + DRIFT * max(0.0, now_s - self.taken_s)


class TimeSync:
    """Keeps asking a connected robot for its time; :meth:`serve` is to be called at least once per ``period_s``.

    A robot that reboots starts its clock anew; the first answer that is off by more than RESTART_S drops the old ones.
    """

    def __init__(self, connection: Connection, *, period_s: float = 2.0) -> None:
        self.period_s = period_s
        self.restarts = 0
        self._connection = connection
        self._samples: deque[Sample] = deque(maxlen=_SAMPLES)
        self._pending: deque[int] = deque(maxlen=_PENDING)
        self._next_s = connection.clock()
        self._remove = connection.add_listener(self._take)

    def close(self) -> None:
        """Stop listening."""
        self._remove()

    def serve(self) -> None:
        """Send a request if one is due: quickly at first, then every ``period_s``."""
        now_s = self._connection.clock()
        if now_s < self._next_s:
            return
        period_s = _QUICK_PERIOD_S if len(self._samples) < _QUICK_SAMPLES else self.period_s
        self._next_s = max(self._next_s + period_s, now_s)
        stamp_ns = round(now_s * 1e9)
        self._pending.append(stamp_ns)
        self._connection.send(mavlink.MAVLink_timesync_message(0, stamp_ns))

    @property
    def best(self) -> Sample | None:
        """The sample that bounds the offset best now; None before the first answer."""
        now_s = self._connection.clock()
        return min(self._samples, key=lambda sample: sample.error_s(now_s), default=None)

    def round_trip_s(self, within_s: float) -> float | None:
        """Return the median of the latest round trips [s]; None without an answer in the last ``within_s``."""
        latest = tuple(self._samples)[-_QUICK_SAMPLES:]
        if not latest or self._connection.clock() - latest[-1].taken_s > within_s:
            return None
        return median(sample.round_trip_s for sample in latest)

    @property
    def waiting(self) -> bool:
        """Whether a reply is pending. It is time-stamped when it is read, so the caller must read without delay."""
        now_s = self._connection.clock()
        return any(now_s - stamp_ns * 1e-9 < ANSWER_S for stamp_ns in self._pending)

    def wait(self, timeout_s: float) -> None:
        """Ask until the robot has answered. Raises LinkTimeoutError."""
        end_s = self._connection.clock() + timeout_s
        while not self.synchronised:
            self.serve()
            self._connection.poll(_WAIT_S)
            if self._connection.clock() > end_s:
                raise LinkTimeoutError(
                    f"the robot does not reply to TIMESYNC within {timeout_s:g} s",
                    hint="check that the radio carries both directions and has bandwidth left",
                )

    @property
    def synchronised(self) -> bool:
        """Whether the robot's clock is known."""
        return bool(self._samples)

    def robot_time_us(self, host_s: float) -> int:
        """Return a time of the host's clock in the robot's [us]; ValueError before the first answer."""
        best = self.best
        if best is None:
            raise ValueError("no TIMESYNC reply from the robot yet")
        return round((host_s + best.offset_s) * 1e6)

    def _take(self, message: Message) -> None:
        if message.get_type() != "TIMESYNC" or message.tc1 == 0 or message.ts1 not in self._pending:
            return
        self._pending.remove(message.ts1)
        now_s, sent_s = self._connection.clock(), message.ts1 * 1e-9
        sample = Sample(message.tc1 * 1e-9 - 0.5 * (sent_s + now_s), max(0.0, now_s - sent_s), now_s)
        best = self.best
        if best is not None and abs(sample.offset_s - best.offset_s) > RESTART_S + best.error_s(now_s):
            self._samples.clear()
            self.restarts += 1
        self._samples.append(sample)
