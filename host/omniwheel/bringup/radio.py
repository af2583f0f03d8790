# SPDX-License-Identifier: MIT
"""The radio link: round trips and losses by PING within a share of its bytes, signal strength if the radio tells it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from omniwheel.bringup.result import Findings, Result
from omniwheel.byte_budget import BITS_PER_BYTE, ByteBudget
from omniwheel.dialect import Message, mavlink
from omniwheel.limits import RADIO_BAUD, RADIO_LOSS_LIMIT, RADIO_ROUND_TRIP_LIMIT_S
from omniwheel.robot import Robot

SHARE = 0.3
"""Of the link's bytes each way that the pings may use."""
PING_BYTES = 26
RATE_HZ = 10.0
ANSWER_TIMEOUT_S = 1.5
"""A ping that took longer is lost."""
_SEQUENCE_WRAP = 256


@dataclass(frozen=True)
class RadioWindow:
    """What was measured over a while: pings, times [s] (nan: no answer), share of the robot's frames that got lost.

    ``rssi`` and ``remote_rssi`` come from RADIO_STATUS, in the radio's own units; None: the radio does not tell.
    """

    sent: int
    answered: int
    round_trip_s: tuple[float, ...]
    down_loss: float
    rssi: int | None = None
    remote_rssi: int | None = None

    @property
    def loss(self) -> float:
        """Share of pings without an answer."""
        return 1.0 - self.answered / self.sent if self.sent else math.nan

    def percentile_s(self, share: float) -> float:
        """Return the round trip that ``share`` of the answers do not exceed."""
        ordered = sorted(self.round_trip_s)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else math.nan


class RadioProbe:
    """Pings a robot and listens."""

    def __init__(self, robot: Robot, baud: int = RADIO_BAUD) -> None:
        self._connection = robot.connection
        bytes_s = SHARE * baud / BITS_PER_BYTE
        self._budget = ByteBudget(bytes_s, max(2.0 * PING_BYTES, 0.2 * bytes_s), self._connection.clock)
        self._number = 0
        self._sent_s: dict[int, float] = {}
        self._trips_s: dict[int, float] = {}
        self._sequence: int | None = None
        self._frames = 0
        self._missing = 0
        self._status: Message | None = None
        self._remove = self._connection.add_listener(self._take)

    def close(self) -> None:
        """Stop listening."""
        self._remove()

    def measure(self, duration_s: float) -> RadioWindow:
        """Ping for ``duration_s``, then wait for the last answers."""
        clock = self._connection.clock
        first = self._number
        self._frames = self._missing = 0
        end_s = clock() + duration_s
        next_s = clock()
        while clock() < end_s:
            if clock() >= next_s and self._budget.admits(PING_BYTES):
                self._ping()
                next_s = max(next_s + 1.0 / RATE_HZ, clock())
            self._connection.pump(min(0.02, max(0.0, end_s - clock())))
        mine = range(first, self._number)
        last_s = clock() + ANSWER_TIMEOUT_S
        while clock() < last_s and not all(n in self._trips_s for n in mine):
            self._connection.pump(0.02)
        trips = tuple(self._trips_s[n] for n in mine if n in self._trips_s)
        total = self._frames + self._missing
        return RadioWindow(
            sent=self._number - first,
            answered=len(trips),
            round_trip_s=trips,
            down_loss=self._missing / total if total else math.nan,
            rssi=None if self._status is None else self._status.rssi,
            remote_rssi=None if self._status is None else self._status.remrssi,
        )

    def _ping(self) -> None:
        self._budget.charge(PING_BYTES)
        self._sent_s[self._number] = self._connection.clock()
        stamp_us = round(self._sent_s[self._number] * 1e6)
        self._connection.send(mavlink.MAVLink_ping_message(stamp_us, self._number, 0, 0))
        self._number += 1

    def _take(self, message: Message) -> None:
        kind = message.get_type()
        if kind == "RADIO_STATUS":
            self._status = message  # the radio's own: its sequence numbers are not the robot's
            return
        if self._sequence is not None:
            self._missing += (message.get_seq() - self._sequence - 1) % _SEQUENCE_WRAP
        self._sequence = message.get_seq()
        self._frames += 1
        if kind == "PING" and message.target_system != 0 and message.seq in self._sent_s:
            trip_s = self._connection.clock() - self._sent_s[message.seq]
            if trip_s <= ANSWER_TIMEOUT_S:
                self._trips_s.setdefault(message.seq, trip_s)


def watch_radio(robot: Robot, *, baud: int = RADIO_BAUD, period_s: float = 2.0) -> Iterator[RadioWindow]:
    """Yield a window every ``period_s`` (and the wait for its last answers), without end: for a walk out of range."""
    probe = RadioProbe(robot, baud)
    try:
        while True:
            yield probe.measure(period_s)
    finally:
        probe.close()


def check_radio(
    robot: Robot,
    *,
    duration_s: float = 10.0,
    baud: int = RADIO_BAUD,
    loss_limit: float = RADIO_LOSS_LIMIT,
    round_trip_limit_s: float = RADIO_ROUND_TRIP_LIMIT_S,
) -> Result:
    """Measure round trips and losses of the link that the robot is connected over."""
    probe = RadioProbe(robot, baud)
    try:
        window = probe.measure(duration_s)
    finally:
        probe.close()
    return judge_radio(window, loss_limit, round_trip_limit_s)


def judge_radio(window: RadioWindow, loss_limit: float, round_trip_limit_s: float) -> Result:
    """Judge a measurement."""
    findings = Findings("radio")
    findings.measured = {
        "sent": window.sent,
        "answered": window.answered,
        "loss": window.loss,
        "down_loss": window.down_loss,
        "round_trip_median_s": window.percentile_s(0.5),
        "round_trip_95_s": window.percentile_s(0.95),
        "rssi": window.rssi,
        "remote_rssi": window.remote_rssi,
    }
    lossy = (
        "move closer and away from metal, raise the antenna; both radios need the same baud rate, channel and PAN id; "
        "LINKn_BUDGET must be at most 60 % of the baud rate"
    )
    findings.judge(
        "loss",
        window.loss <= loss_limit,
        f"{100 * window.loss:.1f} % of {window.sent} round trips lost (limit {100 * loss_limit:g} %)",
        lossy,
    )
    findings.judge(
        "down link",
        window.down_loss <= loss_limit,
        f"{100 * window.down_loss:.1f} % of the robot's frames lost (limit {100 * loss_limit:g} %)",
        lossy,
    )
    if window.answered:
        slow = window.percentile_s(0.95)
        findings.judge(
            "round trip",
            slow <= round_trip_limit_s,
            f"median {1e3 * window.percentile_s(0.5):.0f} ms, 95 % within {1e3 * slow:.0f} ms "
            f"(limit {1e3 * round_trip_limit_s:.0f} ms)",
            "messages queue up in the link: lower SRn_STATE and LINKn_BUDGET of the radio's link, or raise the baud "
            "rate",
        )
    if window.rssi is not None:
        findings.good("signal", f"RSSI {window.rssi}, at the robot {window.remote_rssi}")
    return findings.result()
