# SPDX-License-Identifier: MIT
"""The bridge: motion-capture poses to a robot as pose fixes, in its own time and within what the radio can carry.

A fix says when it was taken, in the robot's clock, so its age on arrival doesn't matter. What cannot be sent is
dropped, never queued: the newest pose always goes first. The bridge sends no heartbeats, so it is no ground station. A
robot whose ground station falls silent stops although the bridge goes on.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

from omniwheel.byte_budget import ByteBudget, MeteredLink
from omniwheel.dialect import Message
from omniwheel.errors import LinkTimeoutError, OmniError, SetpointError
from omniwheel.first_contact import ANSWERS_APART_S
from omniwheel.frames import Pose
from omniwheel.hub.shared_link import open_shared
from omniwheel.limits import (
    DEFAULT_TIMEOUT_S,
    MOCAP_BUDGET_BYTES_S,
    MOCAP_MAX_AGE_S,
    MOCAP_MESSAGES,
    MOCAP_RATE_HZ,
)
from omniwheel.link import Link
from omniwheel.mocap.source import MocapPose, MocapSource, newest
from omniwheel.robot import Robot, connect
from omniwheel.setpoints import compact_fix_message, pose_fix_message
from omniwheel.telemetry import Control, decode
from omniwheel.timesync import TimeSync

MESSAGES: dict[str, Callable[[Pose, int, float, float], Message]] = dict(
    zip(MOCAP_MESSAGES, (compact_fix_message, pose_fix_message), strict=True)
)
FRAME_BYTES = {"compact": 22, "vicon": 48}
"""Largest frame of each kind without signature, of a fix that does not say how good it is [bytes]."""
FRAME_BYTES_SD = {"compact": 26, "vicon": 128}
"""The same of a fix that does."""
OVERHEAD_BYTES = 64
"""What may go out at once beside a fix: a TIMESYNC request and a command."""
MOST_LATENCY_S = 0.24
"""The robot corrects what was up to 0.25 s ago."""
MOST_REASONS = 10
REFUSED_BY_ROBOT = "pose fix refused"
"""How the robot begins to say that it does not use a fix."""
_POLL_S = 0.01
_ANSWER_S = 0.001


@dataclass(frozen=True)
class BridgeSettings:
    """How to send.

    ``message`` is "compact" or "vicon", and ``rate_Hz`` the most fixes sent per second. ``budget_bytes_s`` is what all
    bytes of the bridge together may take (default: half of a 9600-baud radio). ``max_age_s`` is the oldest pose sent.
    ``latency_s`` is how much older all poses are than they say, as :mod:`omniwheel.mocap.latency` measures it.
    """

    message: str = "compact"
    rate_Hz: float = MOCAP_RATE_HZ
    budget_bytes_s: float = MOCAP_BUDGET_BYTES_S
    max_age_s: float = MOCAP_MAX_AGE_S
    latency_s: float = 0.0

    def __post_init__(self) -> None:
        if self.message not in MESSAGES:
            raise SetpointError(f"the message is {self.message!r}; must be one of {', '.join(MESSAGES)}")
        for name in ("rate_Hz", "budget_bytes_s", "max_age_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise SetpointError(f"{name} is {value}; must be a number above 0")
        if not 0.0 <= self.latency_s <= MOST_LATENCY_S:
            raise SetpointError(f"latency_s is {self.latency_s}; must be a number from 0 to {MOST_LATENCY_S:g}")
        if self.latency_s >= self.max_age_s:
            raise SetpointError(f"latency_s is {self.latency_s}, but poses older than {self.max_age_s} s are not sent")

    @property
    def possible_rate_Hz(self) -> float:
        """The rate that the budget allows, for fixes that do not say how good they are."""
        return min(self.rate_Hz, self.budget_bytes_s / FRAME_BYTES[self.message])

    @property
    def possible_rate_sd_Hz(self) -> float:
        """The same for fixes that do, as those of a camera."""
        return min(self.rate_Hz, self.budget_bytes_s / self.frame_bytes(True))

    @property
    def has_sd(self) -> bool:
        """Whether how good a fix is goes out with it.

        On a small budget a long VICON_POSITION_ESTIMATE would slow the others down. Over a radio it would come so late
        that the robot no longer believes its time.
        """
        return self.message == "compact" or self.budget_bytes_s >= self.rate_Hz * FRAME_BYTES_SD[self.message]

    def frame_bytes(self, known: bool) -> int:
        """Return the largest frame of a fix, of which it is ``known`` how good it is, or not."""
        return (FRAME_BYTES_SD if known and self.has_sd else FRAME_BYTES)[self.message]


@dataclass
class BridgeCounts:
    """What became of the poses that came.

    ``sent``; ``overtaken`` by newer ones while rate or budget made them wait; ``stale`` when their turn came;
    ``refused``, because the message cannot express them. ``used`` by the robot's filter, of whatever source; None: not
    known. ``reasons``: why poses were refused, here or by the robot. Latencies are from the cameras to the radio.
    """

    received: int = 0
    sent: int = 0
    overtaken: int = 0
    stale: int = 0
    refused: int = 0
    used: int | None = None
    reasons: tuple[str, ...] = ()
    bytes_sent: int = 0
    duration_s: float = 0.0
    latency_mean_s: float = math.nan
    latency_max_s: float = 0.0
    offset_s: float = math.nan
    offset_error_s: float = math.nan
    round_trip_s: float = math.nan
    clock_restarts: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Return the numbers by name."""
        return asdict(self)

    @property
    def in_vain(self) -> bool:
        """Whether not one pose has reached the robot's filter, as far as is known."""
        return self.sent == 0 or self.used == 0


class Bridge:
    """Sends the poses of ``source`` to the robot on ``link``, which it owns from then on. A context manager.

    ``source`` and ``clock`` must tell the same time. Raises what :func:`omniwheel.robot.connect` raises, and
    LinkTimeoutError if the robot does not answer TIMESYNC. A fix has no target system: while another robot is on the
    line, sending one raises SeveralRobotsError.
    """

    def __init__(
        self,
        source: MocapSource,
        link: str | Link,
        settings: BridgeSettings = BridgeSettings(),
        *,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        system_id: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.settings = settings
        self.counts = BridgeCounts()
        self._source = source
        self._clock = clock
        self._budget = ByteBudget(settings.budget_bytes_s, settings.frame_bytes(True) + OVERHEAD_BYTES, clock)
        base = open_shared(link, timeout_s=timeout_s) if isinstance(link, str) else link
        self._link = MeteredLink(base, self._budget)
        self.robot: Robot = connect(self._link, timeout_s=timeout_s, system_id=system_id, heartbeat=False, clock=clock)
        self._sync = TimeSync(self.robot.connection)
        self._waiting: MocapPose | None = None
        self._latency_sum_s = 0.0
        self._used_before = self._fixes_used()
        try:
            self._sync.wait(timeout_s)
        except LinkTimeoutError:
            self.close()
            raise
        self.robot.connection.pump(ANSWERS_APART_S)  # other robots answer, too: a fix would reach them
        self._mark = self.robot.texts.mark()
        self._start_s = self._next_s = clock()

    def __enter__(self) -> Bridge:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the link; the source stays the caller's."""
        self.robot.close()

    def run(self, duration_s: float, progress: Callable[[BridgeCounts], None] | None = None) -> BridgeCounts:
        """Serve for ``duration_s`` or until the source ends; ``progress`` is called about once per second."""
        end_s = self._clock() + duration_s
        report_s = self._clock() + 1.0
        while (now_s := self._clock()) < end_s and not (self._source.ended and self._waiting is None):
            self.step(min(_POLL_S, end_s - now_s))
            if progress is not None and now_s >= report_s:
                report_s += 1.0
                progress(self.report())
        return self.report()

    def step(self, timeout_s: float) -> None:
        """Take what the source has within ``timeout_s``, send what may be sent, listen to the robot."""
        pose, overtaken = newest(self._source, min(timeout_s, _ANSWER_S) if self._sync.waiting else timeout_s)
        self.robot.connection.poll(0.0)
        self._sync.serve()
        if pose is not None:
            pose = replace(pose, taken_s=pose.taken_s - self.settings.latency_s)
            self.counts.received += 1 + overtaken
            self.counts.overtaken += overtaken + (self._waiting is not None)
            self._waiting = pose
        if self._waiting is not None:
            self._send_if_possible(self._waiting)

    def _send_if_possible(self, measured: MocapPose) -> None:
        now_s = self._clock()
        if now_s - measured.taken_s > self.settings.max_age_s:
            self.counts.stale += 1
            self._waiting = None
        elif now_s >= self._next_s and self._budget.admits(self.settings.frame_bytes(_is_known(measured))):
            self._waiting = None
            self._next_s = max(self._next_s + 1.0 / self.settings.rate_Hz, now_s)
            self._send(measured, now_s)

    def _send(self, measured: MocapPose, now_s: float) -> None:
        time_us = max(1, self._sync.robot_time_us(measured.taken_s))
        try:
            make = MESSAGES[self.settings.message]
            sds = (measured.sd_xy_m, measured.sd_theta_rad) if self.settings.has_sd else (0.0, 0.0)
            message = make(measured.pose, time_us, *sds)
        except SetpointError as error:
            self.counts.refused += 1
            self._add_reason(str(error))
            return
        self.robot.send(message)
        latency_s = now_s - measured.taken_s
        self.counts.sent += 1
        self._latency_sum_s += latency_s
        self.counts.latency_max_s = max(self.counts.latency_max_s, latency_s)

    @property
    def statistics(self) -> BridgeCounts:
        """Old name of ``counts``, for one more release."""
        text = "Bridge.statistics is now Bridge.counts; the old name goes away with the next release"
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return self.counts

    def _add_reason(self, reason: str) -> None:
        if reason not in self.counts.reasons:
            self.counts.reasons = (*self.counts.reasons, reason)[-MOST_REASONS:]

    def _fixes_used(self) -> int | None:
        with suppress(OmniError):
            control = decode(Control, self.robot.commands.request_message(Control.message, self.robot.timeout_s))
            return None if control is None else control.fixes_accepted
        return None

    def ask_used(self) -> None:
        """Ask the robot how many fixes it has used since the beginning: :attr:`BridgeCounts.used`."""
        before, now = self._used_before, self._fixes_used()
        if before is not None and now is not None:
            self.counts.used = now - before if now >= before else now  # fewer: its filter has started anew

    def report(self) -> BridgeCounts:
        """Return the statistics, brought up to date."""
        s, best = self.counts, self._sync.best
        for text in self.robot.texts.since(self._mark):
            if text.text.startswith(REFUSED_BY_ROBOT):
                self._add_reason(text.text)
        self._mark = self.robot.texts.mark()
        s.bytes_sent = self._link.bytes_written
        s.duration_s = self._clock() - self._start_s
        s.latency_mean_s = self._latency_sum_s / s.sent if s.sent else math.nan
        s.clock_restarts = self._sync.restarts
        if best is not None:
            s.offset_s, s.round_trip_s, s.offset_error_s = best.offset_s, best.round_trip_s, best.error_s(self._clock())
        return s


def _is_known(measured: MocapPose) -> bool:
    return measured.sd_xy_m > 0.0 or measured.sd_theta_rad > 0.0
