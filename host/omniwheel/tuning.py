# SPDX-License-Identifier: MIT
"""Experiments with a connected robot and the figures that gains are judged by.

A step experiment asks for a pose a little away, and then for the old one again. The robot moves its reference there as
fast as its limits allow. A trajectory experiment drives the on-board trajectory. Both look at OMNI_TRACKING: what the
robot believes, not what is true.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from omniwheel.dialect import Message
from omniwheel.errors import LinkTimeoutError, OmniError, StoppedError
from omniwheel.frames import Pose
from omniwheel.robot import SETPOINT_PERIOD_S, Robot
from omniwheel.telemetry import Tracking, decode

AXES = ("x", "y", "theta")
UNITS = {"x": "m", "y": "m", "theta": "rad"}
RATE_HZ = 50.0
SETTLE_BAND = 0.05
REST_S = 0.5
REACHED = 1e-3
START_TIMEOUT_S = 5.0
_RISE_FROM, _RISE_TO = 0.1, 0.9

FloatArray = NDArray[np.float64]
Say = Callable[[str], None]


class ExperimentError(OmniError):
    """An experiment was cut short; the robot is disarmed."""


@dataclass(frozen=True)
class Trace:
    """What an experiment saw: times from its start [s], wanted and estimated poses, shape (n, 3) [m, m, rad]."""

    time_s: FloatArray
    reference: FloatArray
    pose: FloatArray


@dataclass(frozen=True)
class Figures:
    """RMSE of the tracking error (position [m], heading [rad]) and, of a step, how it was answered.

    ``rise_s`` goes from 10 to 90 % of the step, ``overshoot`` is a share of the step. ``settling_s`` is the time
    after which the answer stays within 5 % of the step; NaN if that never happened or there was no step.
    """

    position_m: float
    theta_rad: float
    rise_s: float = math.nan
    overshoot: float = math.nan
    settling_s: float = math.nan

    def as_dict(self) -> dict[str, float]:
        """Return the figures by name."""
        return asdict(self)


def step_response(time_s: FloatArray, value: FloatArray, start: float, target: float) -> tuple[float, float, float]:
    """Return rise time [s], overshoot (share) and settling time [s] of the answer to a step at time 0."""
    answer = (value - start) / (target - start)
    above_low, above_high = np.flatnonzero(answer >= _RISE_FROM), np.flatnonzero(answer >= _RISE_TO)
    rise_s = float(time_s[above_high[0]] - time_s[above_low[0]]) if len(above_high) else math.nan
    overshoot = max(float(np.max(answer)) - 1.0, 0.0)
    outside = np.flatnonzero(np.abs(answer - 1.0) > SETTLE_BAND)
    if len(outside) == 0:
        return rise_s, overshoot, 0.0
    last = int(outside[-1])
    return rise_s, overshoot, float(time_s[last + 1]) if last + 1 < len(time_s) else math.nan


def tracking_figures(trace: Trace) -> Figures:
    """Return the RMSE of a trace."""
    error = trace.pose - trace.reference
    error[:, 2] = np.arctan2(np.sin(error[:, 2]), np.cos(error[:, 2]))
    mean_square = np.mean(error**2, axis=0)
    return Figures(float(np.sqrt(mean_square[0] + mean_square[1])), float(np.sqrt(mean_square[2])))


def step_figures(trace: Trace, axis: int, start: float, size: float) -> Figures:
    """Return the figures of the forward step in a trace that begins with the step."""
    rmse = tracking_figures(trace)
    value = np.unwrap(trace.pose[:, axis]) if axis == AXES.index("theta") else trace.pose[:, axis]
    return Figures(rmse.position_m, rmse.theta_rad, *step_response(trace.time_s, value, start, start + size))


class Experiment:
    """Runs experiments on one robot. The robot is disarmed whenever an experiment is over, whatever happened."""

    def __init__(self, robot: Robot, rate_hz: float = RATE_HZ) -> None:
        """``rate_hz``: how often the robot is to tell where it is; less on a slow radio."""
        self._robot, self._rate_hz = robot, rate_hz

    def step(self, axis: str, size: float, duration_s: float) -> tuple[Trace, Figures]:
        """Step along an axis of the world by ``size`` [m or rad], watch for ``duration_s``, and step back."""
        index = AXES.index(axis)
        here = self._tracking().pose
        there = list(here)
        there[index] += size
        try:
            self._hold(here, REST_S, arm=True)
            trace = _trace(self._hold(Pose(*there), duration_s))
            self._hold(here, duration_s)
        finally:
            self._robot.disarm()
        return trace, step_figures(trace, index, here[index], size)

    def trajectory(self, timeout_s: float) -> tuple[Trace, Figures]:
        """Drive the on-board trajectory once and watch its path; ExperimentError if that takes over ``timeout_s``."""
        seen: list[Tracking] = []
        self._tracking()
        try:
            self._robot.start_trajectory()
            self._robot.arm()
            end = self._robot.connection.clock() + timeout_s
            for tracking in self._robot.telemetry(Tracking, timeout_s=START_TIMEOUT_S):
                self._require_driving()
                if tracking.phase == "path":
                    seen.append(tracking)
                if tracking.phase == "done" and seen:
                    break
                if self._robot.connection.clock() > end:
                    hint = "set TRJ_LAPS, TRJ_PERIOD or TRJ_TYPE, or use a larger --duration"
                    raise ExperimentError(f"the trajectory did not end within {timeout_s:g} s", hint=hint)
        finally:
            self._robot.disarm()
        trace = _trace(seen)
        return trace, tracking_figures(trace)

    def _tracking(self) -> Tracking:
        self._robot.set_message_interval(Tracking.message, self._rate_hz)
        return self._robot.wait_for(Tracking, START_TIMEOUT_S)

    def _require_driving(self) -> None:
        try:
            self._robot.guard.check()
        except StoppedError as error:
            raise ExperimentError(str(error), hint=error.hint) from error

    def _hold(self, pose: Pose, duration_s: float, *, arm: bool = False) -> list[Tracking]:
        """Ask for a pose for some time of the robot's clock and return the tracking meanwhile."""
        seen: list[Tracking] = []

        def take(message: Message) -> None:
            tracking = decode(Tracking, message)
            if tracking is not None:
                seen.append(tracking)

        remove = self._robot.connection.add_listener(take)
        try:
            self._robot.set_pose(*pose)
            if arm:
                self._robot.arm()
            while not seen or seen[-1].time_s - seen[0].time_s < duration_s:
                known = len(seen)
                end = self._robot.connection.clock() + START_TIMEOUT_S
                while len(seen) == known:
                    self._robot.set_pose(*pose)
                    self._robot.pump(SETPOINT_PERIOD_S)
                    self._require_driving()
                    if self._robot.connection.clock() > end:
                        raise LinkTimeoutError(f"no {Tracking.message} from the robot for {START_TIMEOUT_S:g} s")
        finally:
            remove()
        if not seen or not np.allclose(seen[-1].reference, pose, atol=REACHED):
            hint = "the robot limits the rate of the pose setpoint: use a larger --duration or a smaller --size"
            raise ExperimentError(f"the robot did not reach the pose setpoint within {duration_s:g} s", hint=hint)
        return seen


def _trace(seen: list[Tracking]) -> Trace:
    time_s = np.array([t.time_s for t in seen])
    return Trace(time_s - time_s[0], np.array([t.reference for t in seen]), np.array([t.pose for t in seen]))
