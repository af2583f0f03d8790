# SPDX-License-Identifier: MIT
"""A motion that a program waits for: whether the robot is there, stuck, stopped or gone."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from omniwheel.capability.travel import ARRIVED_M, ARRIVED_RAD, ARRIVED_S
from omniwheel.connection import Connection
from omniwheel.driven import Driven, DrivenPath, Progress, driven, driven_path
from omniwheel.errors import LinkTimeoutError, NotArrivedError, StoppedError
from omniwheel.frames import Pose
from omniwheel.robot_base import SETPOINT_PERIOD_S, RobotBase
from omniwheel.telemetry import Tracking, decode

_BACK_S = 0.5
"""Path time that goes back by more is that of another path, even if the text that says so was lost."""
_REST_M_S, _REST_RAD_S = 1e-3, 5e-3
_REST_TIMEOUT_S = 5.0
_MOVED_S = 2.0
"""How far the robot moved in the last so many seconds is said of one that did not arrive."""
STUCK_S = 4.0
"""A robot that stands for so long while its reference is elsewhere does not arrive any more."""
_STANDS_M, _STANDS_RAD = 2e-3, 0.01
SILENT_S = 5.0
"""A robot that sends nothing for so long is gone: it sends a heartbeat each second on every link."""


def latest_tracking(robot: RobotBase) -> Tracking:
    """Return what the robot said last of its pose; wait for the first."""
    return robot.status.tracking or robot.wait_for(Tracking)


def ended_by(call: str) -> StoppedError:
    """Return the error of a motion that a call of the same program has ended."""
    return StoppedError(f"ended by {call} of another thread or a callback of this program")


class Motion:
    """A motion under way: what the robot says meanwhile, and whether it still drives.

    ``replaced_by`` says what has taken the place of the motion of a number in this program; "" if nothing has.
    """

    def __init__(
        self,
        robot: RobotBase,
        number: int,
        replaced_by: Callable[[int], str],
        goal: Pose | None,
        progress: Progress | None,
    ) -> None:
        self.number = number
        self._robot, self._replaced_by, self._goal, self._progress = robot, replaced_by, goal, progress
        self._connection: Connection = robot.connection
        self._start_s = self._connection.clock()
        self._rows: list[Tracking] = []
        self._shown = 0
        self._silent_s = 0.0
        self.quiet = False
        """Whether errors of callbacks are left to the next motion: this one stops the robot."""
        self.holds_goal = False
        """Whether the robot is to hold the goal at the end, which its reference has reached."""
        self._duration_s = math.nan
        self._remove = self._connection.add_listener(self._take)

    def _take(self, message: Any) -> None:
        self._silent_s = 0.0
        tracking = decode(Tracking, message)
        if tracking is not None:
            self._rows.append(tracking)

    @property
    def time_s(self) -> float:
        """Time since its beginning."""
        return self._connection.clock() - self._start_s

    def finish(self) -> None:
        """Take note of the time it took."""
        self._duration_s = self.time_s

    @property
    def driven(self) -> Driven:
        """What was driven with a velocity; once it has ended."""
        return driven(self._rows, self._duration_s)

    @property
    def driven_path(self) -> DrivenPath:
        """What was driven to a pose or along a path; once it has ended."""
        return driven_path(self._rows, self._duration_s, self._goal)

    def close(self) -> None:
        """Stop listening."""
        self._remove()

    def check(self) -> None:
        """Raise StoppedError if the robot stopped, or another motion has begun."""
        if call := self._replaced_by(self.number):
            raise ended_by(call)
        self._robot.guard.check()

    def wait(self, at_most_s: float = SETPOINT_PERIOD_S) -> None:
        """Serve the link for a moment, then :meth:`check`. Raises LinkTimeoutError after SILENT_S without a message."""
        pump = self._connection.pump_quietly if self.quiet else self._robot.pump
        moment_s = min(SETPOINT_PERIOD_S, at_most_s)
        self._silent_s += max(0.0, moment_s)  # only while the link is served: a suspended program has heard nothing
        pump(moment_s)
        self.check()
        if self._silent_s > SILENT_S:
            raise LinkTimeoutError(
                f"the robot has sent nothing for {SILENT_S:g} s",
                hint="check its power and the link; without setpoints and heartbeats it stops by itself",
            )
        self._show()

    def _show(self) -> None:
        while self._progress is not None and self._shown < len(self._rows):
            self._shown += 1
            self._progress(self._rows[self._shown - 1])

    def is_at_goal(self) -> bool:
        """Whether reference and estimate have been at the goal for ARRIVED_S: they do not only pass it."""
        if not self._rows:
            return False
        last_s = self._rows[-1].time_s
        for row in reversed(self._rows):
            if not all(_is_near(at, self._goal_pose, ARRIVED_M, ARRIVED_RAD) for at in (row.pose, row.reference)):
                return False
            if last_s - row.time_s >= ARRIVED_S:
                return True
        return False

    def is_stuck(self) -> bool:
        """Whether the robot has stood for STUCK_S while its reference was elsewhere all the time."""
        for row in reversed(self._rows):
            last = self._rows[-1]
            stands = _is_near(row.pose, last.pose, _STANDS_M, _STANDS_RAD)
            if not stands or _is_near(row.pose, row.reference, ARRIVED_M, ARRIVED_RAD):
                return False
            if last.time_s - row.time_s >= STUCK_S:
                return True
        return False

    @property
    def _goal_pose(self) -> Pose:
        assert self._goal is not None
        return self._goal

    def not_arrived(self) -> NotArrivedError:
        """Return the error of a robot that is not at its goal in time, or stuck."""
        here, goal = latest_tracking(self._robot).pose, self._goal_pose
        distance_m, turn = _apart(here, goal)
        lately = [row.pose for row in self._rows if row.time_s > self._rows[-1].time_s - _MOVED_S]
        moved = math.hypot(here.x - lately[0].x, here.y - lately[0].y) if lately else 0.0
        return NotArrivedError(
            f"still {distance_m * 1e3:.0f} mm and {turn:.3f} rad away after {self.time_s:.3g} s; "
            f"it moved {moved * 1e3:.0f} mm in the last {_MOVED_S:g} s",
            goal,
            here,
            hint="is it blocked?" if self.is_stuck() else "is it blocked? else give it more time: timeout_s",
        )

    def until_at_rest(self) -> None:
        """Wait until the robot's reference is at rest; velocity zero has been asked for. Raises StoppedError."""
        end_s = self._connection.clock() + _REST_TIMEOUT_S
        first = len(self._rows) + 1  # the next may still be of before
        while not any(map(_is_at_rest, self._rows[first:])):
            if self._connection.clock() > end_s:
                return  # the robot says nothing of it: it has had the time
            self.wait()

    def until_path_done(self, timeout_s: float) -> None:
        """Wait for the end of the path that the robot follows. Raises StoppedError if another one has begun."""
        started, path_s, row = False, 0.0, 0
        while True:
            while row < len(self._rows):
                tracking, row = self._rows[row], row + 1
                started = started or tracking.phase in ("lead-in", "path")
                if started and tracking.phase == "done":
                    self._show()
                    return
                if started and (tracking.phase == "none" or tracking.path_time_s < path_s - _BACK_S):
                    self.check()
                    raise self._robot.guard.held()
                path_s = max(path_s, tracking.path_time_s)
            if self.time_s > timeout_s:
                here = latest_tracking(self._robot)
                raise NotArrivedError(f"the path is not done after {timeout_s:g} s", here.reference, here.pose)
            self._robot.wait_for(Tracking)
            self.wait(0.0)


def _apart(one: Pose, other: Pose) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] between two poses."""
    turn = abs(math.remainder(one.theta - other.theta, math.tau))
    return math.hypot(one.x - other.x, one.y - other.y), turn


def _is_near(one: Pose, other: Pose, most_m: float, most_rad: float) -> bool:
    distance_m, turn = _apart(one, other)
    return distance_m <= most_m and turn <= most_rad


def _is_at_rest(tracking: Tracking) -> bool:
    vx, vy, wz = tracking.reference_rate
    return math.hypot(vx, vy) < _REST_M_S and abs(wz) < _REST_RAD_S
