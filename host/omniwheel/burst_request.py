# SPDX-License-Identifier: MIT
"""Whether the burst that came is the one that was asked for: the robot keeps one, and any program may begin another.

A burst has a number, but the robot does not say which one a request gets. So signals, wheels, spacing, length and start
are compared, too, and the answers that other programs get are listened to.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from omniwheel.burst import SIGNALS, TICK_S, Burst
from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import OtherBurstError

_OF_WHEELS = frozenset(("wheel_reference", "wheel_speed", "duty", "voltage", "wheel_angle"))
_NOT_IN_HIL = "tick_time"
_WRAP_MS, _NUMBERS = 2**32, 2**16
_STAMP_MS = 2.0
"""Stamps of telemetry are rounded down to a millisecond."""
_DELAY_MS = 1000.0
"""Telemetry may be on its way for so long: the robot's clock is at most so far ahead of what it shows."""


@dataclass(frozen=True)
class _Request:
    samples: int
    every: int
    signals: frozenset[str]
    wheels: frozenset[int]


class BurstRequest:
    """The last request for a burst of one connection.

    ``is_of_another`` says of a COMMAND_ACK whether it answers another program.
    """

    def __init__(self, connection: Connection, is_of_another: Callable[[Message], bool]) -> None:
        self._connection = connection
        self._is_of_another = is_of_another
        self._request: _Request | None = None
        self._ended_here = self._foreign = self._waits = False
        self._last_number: int | None = None
        self._begun_since = 0
        self._stamp: tuple[float, float] | None = None
        """The robot's newest stamp [ms], and when it came on the connection's clock [s]."""
        self._earliest: tuple[float, float] | None = None
        self._latest_s = math.inf
        connection.add_listener(self._hear)

    def _hear(self, message: Message) -> None:
        stamp_ms = getattr(message, "time_boot_ms", None)
        if stamp_ms is not None:
            self._stamp = (float(stamp_ms), self._connection.clock())
        elif message.get_type() == "COMMAND_ACK" and message.command == mavlink.MAV_CMD_OMNI_BURST:
            accepted = message.result == mavlink.MAV_RESULT_ACCEPTED
            self._foreign = self._foreign or (accepted and self._is_of_another(message))

    @contextmanager
    def asking(
        self, duration_s: float, signals: Sequence[str], every: int, wheels: Sequence[int], wait: bool
    ) -> Iterator[None]:
        """Take note of what is asked for while the context lasts; a duration of 0 ends the recording."""
        if duration_s == 0.0:
            self._ended_here = True
            yield
            return
        self._request = _Request(
            samples=math.ceil(duration_s / (every * TICK_S) - 1e-3),
            every=every,
            signals=frozenset(signals or SIGNALS) - {_NOT_IN_HIL},
            wheels=frozenset(wheels),
        )
        self._ended_here = self._foreign = False
        self._begun_since += 1
        self._waits = True
        if wait:
            yield
            return
        with self.beginning():
            yield

    @contextmanager
    def beginning(self) -> Iterator[None]:
        """Take note that a burst that waits begins while the context lasts: its command is sent and accepted."""
        if self._waits:
            self._earliest, self._latest_s = self._stamp, math.inf
        yield
        if self._waits:
            self._waits, self._latest_s = False, self._connection.clock()

    def check(self, burst: Burst) -> None:
        """Raise OtherBurstError if this is not what was asked for here; nothing was asked for: it is any burst."""
        if self._request is not None:
            wrong = self._difference(burst, self._request)
            if wrong:
                raise OtherBurstError(
                    f"another program recorded a burst meanwhile: {wrong}", hint="end that program, or repeat this"
                )
        self._last_number, self._begun_since = burst.number, 0

    def _difference(self, burst: Burst, asked: _Request) -> str:
        signals = frozenset(burst.signals) - {_NOT_IN_HIL}
        if self._foreign:
            return "the robot has accepted its request"
        if signals != asked.signals:
            return f"it holds {', '.join(sorted(signals))}, not {', '.join(sorted(asked.signals))}"
        if asked.wheels and signals & _OF_WHEELS and frozenset(burst.wheels) != asked.wheels:
            return f"it holds the wheels {burst.wheels}, not {tuple(sorted(asked.wheels))}"
        if round(burst.period_s / TICK_S) != asked.every:
            return f"it has a sample each {burst.period_s:g} s, not {asked.every * TICK_S:g} s"
        length = len(burst.time_s)
        if length > asked.samples + 1 or (length < asked.samples - 1 and not self._ended_here):
            return f"it has {length} samples, not {asked.samples}"
        ahead = (burst.number - (self._last_number or 0) - self._begun_since) % _NUMBERS
        if self._last_number is not None and 0 < ahead < _NUMBERS // 2:
            return f"it is number {burst.number}, {ahead} more than this program requested"
        return "" if self._is_in_time(burst) else "its start time differs"

    def _is_in_time(self, burst: Burst) -> bool:
        if self._earliest is None:
            return True
        stamp_ms, heard_s = self._earliest
        after_ms = (1e3 * burst.start_s - stamp_ms + _WRAP_MS / 2) % _WRAP_MS - _WRAP_MS / 2
        return -_STAMP_MS <= after_ms <= 1e3 * (self._latest_s - heard_s) + _DELAY_MS
