# SPDX-License-Identifier: MIT
"""How good a link is while it is used: lost frames, round trips, and its bytes beside what the robot may send."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

from omniwheel.byte_budget import BITS_PER_BYTE
from omniwheel.dialect import Message
from omniwheel.drive_log import is_slow
from omniwheel.robot import Robot
from omniwheel.telemetry import Tracking
from omniwheel.timesync import TimeSync

OVER_S = 10.0
"""Losses are those of so many seconds."""
ASK_S, ASK_RADIO_S = 1.0, 4.0
"""From one question for the round trip to the next: each way 28 bytes, or 41 signed."""
_SILENT_ASKS = 4
_SEQUENCE_WRAP = 256
_RADIOS_OWN = "RADIO_STATUS"
_ASKING_S = 2.0
_COUNT_S = 1.0
_PACE_COUNTS = 4
"""Over less time the pace would be that of how frames arrive."""


class _Count(NamedTuple):
    """What had come by ``time_s`` on this computer's clock; ``robot_s`` is the robot's."""

    time_s: float
    frames: int
    missing: int
    robot_s: float


class LinkQuality:
    """Watches the link of a connected robot; :meth:`serve` is to be called several times per second.

    Frames that were lost on the way leave a gap in the robot's numbers. A gap of more than half of the numbers is no
    loss: the robot has restarted, or a frame came twice.
    """

    def __init__(self, robot: Robot) -> None:
        self.is_radio = is_slow(robot.url)
        self._parameters = robot.parameters
        self._clock = robot.connection.clock
        self._sync = TimeSync(robot.connection, period_s=ASK_RADIO_S if self.is_radio else ASK_S)
        self._windows: deque[_Count] = deque()
        self._frames = self._missing = 0
        self._robot_s = 0.0
        self._served_s = float("-inf")
        self._sequence: int | None = None
        robot.connection.add_listener(self._take)

    def serve(self) -> None:
        """Ask for the round trip if that is due, and forget what is old."""
        self._sync.serve()
        self._served_s = now_s = self._clock()
        if not self._windows or now_s - self._windows[-1].time_s >= _COUNT_S:
            self._windows.append(_Count(now_s, self._frames, self._missing, self._robot_s))
        while now_s - self._windows[0].time_s > OVER_S:
            self._windows.popleft()

    def state(self) -> dict[str, Any]:
        """Return ``lost``, a share of the robot's frames, and ``round_trip_ms``; None where nothing is known.

        ``asking`` is false while an experiment or a bring-up has the link: then the round trip is not measured.
        ``pace`` is how fast the robot's clock runs beside this computer's: below 1 for a simulation that is too slow.
        ``budget_B_s`` is what the robot may send: LINK1_BUDGET, or at a slow serial port what its radio's line takes.
        """
        trip_s = self._sync.round_trip_s(_SILENT_ASKS * self._sync.period_s)
        return {
            "lost": self._lost(),
            "round_trip_ms": None if trip_s is None else round(1e3 * trip_s, 1),
            "asking": self._clock() - self._served_s < _ASKING_S,
            "budget_B_s": self._budget(),
            "pace": self._pace(),
            "radio": self.is_radio,
        }

    def _lost(self) -> float | None:
        windows = tuple(self._windows)  # the robot's thread appends
        if not windows:
            return None
        frames, missing = self._frames - windows[0].frames, self._missing - windows[0].missing
        return None if not frames else round(missing / (frames + missing), 4)

    def _pace(self) -> float | None:
        windows = tuple(self._windows)
        if len(windows) < _PACE_COUNTS or windows[0].robot_s == 0.0 or windows[-1].robot_s < windows[0].robot_s:
            return None
        return round((windows[-1].robot_s - windows[0].robot_s) / (windows[-1].time_s - windows[0].time_s), 2)

    def _budget(self) -> float | None:
        known = self._parameters.known
        if not self.is_radio:
            return known.get("LINK1_BUDGET")
        if "LINK2_BUDGET" not in known or "LINK2_BAUD" not in known:
            return None
        return min(known["LINK2_BUDGET"], 0.5 * known["LINK2_BAUD"] / BITS_PER_BYTE)

    def _take(self, message: Message) -> None:
        if message.get_type() == _RADIOS_OWN:  # its numbers are not the robot's
            return
        if self._sequence is not None:
            gap = (message.get_seq() - self._sequence - 1) % _SEQUENCE_WRAP
            self._missing += gap if gap < _SEQUENCE_WRAP // 2 else 0
        self._sequence = message.get_seq()
        self._frames += 1
        if message.get_type() == Tracking.message:
            self._robot_s = message.time_boot_ms * 1e-3
