# SPDX-License-Identifier: MIT
"""The 50 Hz loop: poses from a stream to the controller, its PWM to the radio, and when to stop.

The original robot keeps the last PWM it was told until it is told another. So every way out of the loop (its end, an
error, Ctrl-C) sends zeros, several times. Without a fix for ``FIX_TIMEOUT`` the robot stands and the path's clock with
it. It goes on when the fixes come back, and the loop ends with HostControlStopError if they stay away.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omniwheel._core import ffi, lib
from omniwheel.errors import HostControlStopError, MocapError
from omniwheel.frames import Pose, Twist
from omniwheel.host_control.controller import PERIOD_S, Command, HostController
from omniwheel.host_control.pwm_line import STOP, PwmRadio
from omniwheel.mocap.source import MocapSource

SETTLE_S = 1.0
SAMPLE_COLUMNS = 14
STANDING = Twist(0.0, 0.0, 0.0)
_LATE_S = 2.0 * PERIOD_S


@dataclass(frozen=True)
class Goal:
    """Where to: a world ``pose`` to go to and hold, or with None the path of the TRJ_* parameters.

    The loop ends by itself once a path is done. It also ends once the pose has been within ``tolerance_m`` and
    ``tolerance_rad`` for a second (0: never).
    """

    pose: Pose | None = None
    tolerance_m: float = 0.01
    tolerance_rad: float = 0.05


@dataclass
class HostControlRun:
    """What came of a run.

    ``samples`` has a row for each step that drove: time since the start [s], estimate, reference, error, PWM (4). The
    three poses have 3 numbers each: m, m, rad. ``pauses`` counts the times that the fixes stayed away, ``late`` the
    steps that came too late.
    """

    done: bool = False
    fixes: int = 0
    refused: int = 0
    pauses: int = 0
    late: int = 0
    started_s: float = math.nan
    samples: list[tuple[float, ...]] = field(default_factory=list)

    def record(self) -> NDArray[np.float64]:
        """Return the samples as an array, 14 columns."""
        return np.array(self.samples, dtype=np.float64).reshape(-1, SAMPLE_COLUMNS)


class HostControlLoop:
    """One run of the original four-wheel robot. All time is the source's clock.

    ``lost_after_s`` without fixes end it.
    """

    def __init__(
        self,
        controller: HostController,
        source: MocapSource,
        radio: PwmRadio,
        goal: Goal,
        *,
        lost_after_s: float = 5.0,
    ) -> None:
        self.run_data = HostControlRun()
        self._controller = controller
        self._source = source
        self._radio = radio
        self._goal = goal
        self._lost_after_s = lost_after_s
        self._reference = ffi.new("omni_reference_t *")
        self._plan: Any = None
        self._path_us = 0
        self._good_s = 0.0
        self._closest_m = self._closest_rad = math.inf
        self._driving = False

    def run(self, duration_s: float, progress: Callable[[float, HostControlRun], None] | None = None) -> HostControlRun:
        """Drive for ``duration_s`` at most.

        Raises HostControlStopError, MocapError or LinkError, and the robot is stopped then.
        """
        clock = self._source.clock
        self._controller.last_fix_s = self.run_data.started_s = start_s = clock()
        next_s = start_s
        try:
            while not self.run_data.done and clock() - start_s < duration_s:
                next_s = self._wait_for(next_s)
                self._step(clock())
                if progress is not None:
                    progress(clock() - start_s, self.run_data)
        finally:
            self._radio.stop_for_good(lambda: self._pause(PERIOD_S))
        return self.run_data

    def _wait_for(self, next_s: float) -> float:
        """Take fixes until ``next_s``; return when the step after it is due."""
        while (left_s := next_s - self._source.clock()) > 0.0:
            self._take(left_s)
        self._take(0.0)
        late_s = self._source.clock() - next_s
        if late_s > _LATE_S:
            self.run_data.late += 1
            return self._source.clock() + PERIOD_S
        return next_s + PERIOD_S

    def _take(self, timeout_s: float) -> None:
        measured = self._source.read(timeout_s)
        if measured is not None:
            used = self._controller.fix(measured)
            self.run_data.fixes += used
            self.run_data.refused += not used

    def _step(self, now_s: float) -> None:
        age_s = now_s - self._controller.last_fix_s
        if age_s > self._lost_after_s:
            raise self._lost(age_s)
        if not self._controller.located or age_s > self._controller.values["FIX_TIMEOUT"]:
            self._stand()
            return
        self._drive(now_s)

    def _lost(self, age_s: float) -> HostControlStopError:
        hint = "check that the markers are visible and the object's name is right; `omni mocap record` shows the poses"
        what = "no pose was received" if not self._controller.located else "the stream of poses has stopped"
        if self._controller.refusal:
            what = f"no pose could be used ({self._controller.refusal})"
        return HostControlStopError(f"{what} for {age_s:.1f} s: the robot is stopped", hint=hint)

    def _stand(self) -> None:
        if self._driving:
            self._driving = False
            self.run_data.pauses += 1
            self._controller.rest()
            self._radio.stop()
            self._controller.sent(STOP, self._source.clock())
        self._offer(STOP)

    def _drive(self, now_s: float) -> None:
        self._driving = True
        pose, rate = self._wanted()
        command = self._controller.step(now_s, pose, rate)
        self._check(command)
        self._offer(command.pwm)
        numbers = (*command.estimate, *command.reference, *command.error, *command.pwm)
        self.run_data.samples.append((now_s - self.run_data.started_s, *numbers))
        self.run_data.done = self._finished(command)

    def _offer(self, pwm: tuple[int, int, int, int]) -> None:
        now_s = self._source.clock()
        if self._radio.offer(pwm):
            self._controller.sent(pwm, now_s)

    def _wanted(self) -> tuple[Pose, Twist]:
        if self._goal.pose is not None:
            return self._goal.pose, STANDING
        if self._plan is None:
            self._plan = self._controller.plan()
        lib.omni_trajectory_evaluate(self._plan, self._path_us, self._reference)
        self._path_us += round(PERIOD_S * 1e6)
        pose, rate = self._reference.pose, self._reference.rate
        return Pose(pose.x, pose.y, pose.theta), Twist(rate.vx, rate.vy, rate.wz)

    def _check(self, command: Command) -> None:
        values, here = self._controller.values, command.estimate
        if not all(math.isfinite(value) for value in here) or math.hypot(here.x, here.y) > values["LIM_POS"]:
            hint = "LIM_POS is the limit; check the origin of the cameras' frame"
            raise HostControlStopError(
                f"the robot is at x = {here.x:.2f} m, y = {here.y:.2f} m: out of range", hint=hint
            )
        away_m, turned_rad = math.hypot(command.error[0], command.error[1]), abs(command.error[2])
        if self._goal.pose is not None:  # it may be far away at first, and only comes closer
            self._closest_m, self._closest_rad = min(self._closest_m, away_m), min(self._closest_rad, turned_rad)
            away_m, turned_rad = away_m - self._closest_m, turned_rad - self._closest_rad
        if away_m > values["SAFE_ERR_XY"] or turned_rad > values["SAFE_ERR_TH"]:
            where = "off its path" if self._goal.pose is None else "farther from its goal than at the start"
            hint = "check the motors' order and W*_MOT_DIR; SAFE_ERR_* are the limits"
            raise HostControlStopError(f"the robot is {away_m:.2f} m and {turned_rad:.2f} rad {where}", hint=hint)

    def _finished(self, command: Command) -> bool:
        """A path's end, or a pose held within its tolerance, lasts for a second."""
        if self._goal.pose is None:
            good = self._reference.phase == lib.OMNI_PHASE_DONE
        else:
            away_m = math.hypot(command.error[0], command.error[1])
            good = away_m < self._goal.tolerance_m and abs(command.error[2]) < self._goal.tolerance_rad
        self._good_s = self._good_s + PERIOD_S if good else 0.0
        return self._good_s >= SETTLE_S

    def _pause(self, seconds: float) -> None:
        """Let time pass; the source's, so that a simulation goes on."""
        end_s = self._source.clock() + seconds
        try:
            while (left_s := end_s - self._source.clock()) > 0.0 and not self._source.ended:
                self._source.read(left_s)
        except (MocapError, OSError):
            time.sleep(seconds)
