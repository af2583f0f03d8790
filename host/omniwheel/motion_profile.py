# SPDX-License-Identifier: MIT
"""A straight line from one pose to another with a given speed: where a robot should be at each time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from omniwheel.frames import Pose, Twist


@dataclass(frozen=True)
class Profile:
    """A line from ``start`` to ``goal``: at rest at both ends, ``ramp_s`` of acceleration and of braking, then steady.

    x, y and theta share one progress, so that the path is straight while the robot turns evenly. The turn is the
    shorter one.
    """

    start: Pose
    goal: Pose
    duration_s: float
    ramp_s: float

    @property
    def turn_rad(self) -> float:
        """How far it turns, counter-clockwise [rad]."""
        return math.remainder(self.goal.theta - self.start.theta, math.tau)

    def at(self, time_s: float) -> tuple[Pose, Twist]:
        """Return the pose and the world twist ``time_s`` after the beginning; those of the end from then on."""
        share, rate = self._progress(time_s)
        dx, dy, turn = self.goal.x - self.start.x, self.goal.y - self.start.y, self.turn_rad
        pose = Pose(self.start.x + share * dx, self.start.y + share * dy, self.start.theta + share * turn)
        return (self.goal if share >= 1.0 else pose), Twist(rate * dx, rate * dy, rate * turn)

    @property
    def cruise(self) -> Twist:
        """The steady world twist."""
        return self.at(0.5 * self.duration_s)[1]

    def near_s(self, near_m: float, near_rad: float) -> float:
        """Return the time from which on the remaining distance and turn are at most ``near_m`` and ``near_rad``."""
        distance_m = math.hypot(self.goal.x - self.start.x, self.goal.y - self.start.y)
        turn = abs(self.turn_rad)
        share = min(1.0, near_m / distance_m if distance_m else 1.0, near_rad / turn if turn else 1.0)
        steady_s = self.duration_s - self.ramp_s
        left_s = math.sqrt(2.0 * share * self.ramp_s * steady_s)
        if left_s > self.ramp_s:
            left_s = share * steady_s + 0.5 * self.ramp_s
        return self.duration_s - min(left_s, self.duration_s)

    def _progress(self, time_s: float) -> tuple[float, float]:
        """Return the share 0..1 of the line, and its rate [1/s]."""
        if time_s >= self.duration_s:
            return 1.0, 0.0
        top = 1.0 / (self.duration_s - self.ramp_s)
        left_s = self.duration_s - time_s
        if time_s < self.ramp_s:
            return 0.5 * top * time_s * time_s / self.ramp_s, top * time_s / self.ramp_s
        if left_s < self.ramp_s:
            return 1.0 - 0.5 * top * left_s * left_s / self.ramp_s, top * left_s / self.ramp_s
        return top * (time_s - 0.5 * self.ramp_s), top


def profile(
    start: Pose,
    goal: Pose,
    speed_m_s: float,
    turn_rad_s: float,
    acceleration_m_s2: float,
    turn_acceleration_rad_s2: float,
) -> Profile:
    """Return the line at this speed, or slower where ``turn_rad_s`` would be exceeded. All four are more than 0."""
    distance_m = math.hypot(goal.x - start.x, goal.y - start.y)
    turn = abs(math.remainder(goal.theta - start.theta, math.tau))
    steady_s = max(distance_m / speed_m_s, turn / turn_rad_s, 1e-3)
    ramp_s = max(distance_m / acceleration_m_s2, turn / turn_acceleration_rad_s2) / steady_s
    if ramp_s > steady_s:  # never as fast as that: half of the distance is acceleration
        ramp_s = math.sqrt(ramp_s * steady_s)
        return Profile(start, goal, 2.0 * ramp_s, ramp_s)
    return Profile(start, goal, steady_s + ramp_s, ramp_s)
