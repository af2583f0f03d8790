# SPDX-License-Identifier: MIT
"""How long a drive to a pose takes: the core's reference generator, integrated in steps of some milliseconds.

Near the goal the reference's speed is APPROACH_RATE times the distance; further away it brakes with LIM_A. Distance and
turn end together. Wheel speeds are limited to TRJ_MARGIN of LIM_WHEEL in the heading of the moment
(``shared/core/src/reference/robot_reference.c``).
"""

from __future__ import annotations

import math

from omniwheel.capability.drive_model import DriveModel
from omniwheel.capability.speeds import TURNING, directions, motor_speed
from omniwheel.frames import Pose
from omniwheel.motion_profile import Profile

APPROACH_RATE = 3.0
"""Largest ratio of speed and distance to the goal [1/s]."""
ARRIVED_M = 0.005
ARRIVED_RAD = 0.02
ARRIVED_S = 0.2
"""A robot has arrived when estimate and reference have been so near to the goal for so long."""
LAG_S = 0.06
"""From the reference to the estimate, both as telemetry, and from the call to the first setpoint."""
SETPOINT_AGE_S = 0.036
"""Half of the period of setpoints, and the link's latency."""
_STEP_S, _LONGEST_STEP_S = 0.01, 0.2
_STEPS_PER_TIME = 50.0
"""Steps in the time that is still to go at the present speed, if those are longer."""
_LONGEST_S = 86_400.0
_DIRECTIONS = 36


def turn_acceleration(model: DriveModel) -> float:
    """Return the yaw acceleration limit [rad/s^2]: the rim accelerates like the centre."""
    lever_arm_m = max(abs(float(row[2])) for row in model.rows)
    return model.acceleration_limit_m_s2 / (lever_arm_m if lever_arm_m > 0.0 else 1.0)


def travel_time_s(model: DriveModel, here: Pose, there: Pose, share: float) -> float:
    """Return the time that a robot at rest takes until it has arrived at a pose [s].

    ``share`` of LIM_WHEEL is used at most (TRJ_MARGIN).
    """
    return reference_time_s(model, here, there, share) + ARRIVED_S + LAG_S


def reference_time_s(model: DriveModel, here: Pose, there: Pose, share: float) -> float:
    """Return the time until the reference is within ARRIVED_M and ARRIVED_RAD of a pose [s]."""
    limits = _Limits(model, share)
    x, y, theta = there.x - here.x, there.y - here.y, math.remainder(there.theta - here.theta, math.tau)
    heading = here.theta
    vx = vy = wz = time_s = 0.0
    while (distance := math.hypot(x, y)) > ARRIVED_M or abs(theta) > ARRIVED_RAD:
        rate = min(_approach_rate(distance, limits.acceleration), _approach_rate(abs(theta), limits.turn_acceleration))
        scale = limits.scale(rate * x, rate * y, rate * theta, heading)
        dx, dy, dw = scale * rate * x - vx, scale * rate * y - vy, scale * rate * theta - wz
        change = math.hypot(dx, dy)
        ramp_s = max(change / limits.acceleration, abs(dw) / limits.turn_acceleration)
        speed, turn_rate = math.hypot(vx, vy), abs(wz)
        left_s = max(distance / speed if speed else 0.0, abs(theta) / turn_rate if turn_rate else 0.0)
        step_s = _STEP_S if ramp_s > _STEP_S else min(max(_STEP_S, left_s / _STEPS_PER_TIME), _LONGEST_STEP_S)
        gain = min(1.0, limits.acceleration * step_s / change) if change else 0.0
        vx, vy = vx + gain * dx, vy + gain * dy
        wz += max(-limits.turn_acceleration * step_s, min(limits.turn_acceleration * step_s, dw))
        x, y, theta, heading = x - vx * step_s, y - vy * step_s, theta - wz * step_s, heading + wz * step_s
        time_s += step_s
        if time_s > _LONGEST_S:
            return math.inf
    return time_s


def profile_time_s(line: Profile) -> float:
    """Return the time that a robot takes until it has arrived at the end of a profile [s].

    A setpoint of a robot that brakes is SETPOINT_AGE_S old on average: its velocity is too high by so much, and the
    reference runs ahead. That error decays with APPROACH_RATE.
    """
    if line.ramp_s <= 0.0:  # it ends where it begins
        return line.duration_s + ARRIVED_S + LAG_S
    steady_s = line.duration_s - line.ramp_s
    ahead = SETPOINT_AGE_S * (1.0 - math.exp(-APPROACH_RATE * line.ramp_s)) / (APPROACH_RATE * steady_s * line.ramp_s)
    distance_m = math.hypot(line.goal.x - line.start.x, line.goal.y - line.start.y)
    error = ahead * max(distance_m / ARRIVED_M, abs(line.turn_rad) / ARRIVED_RAD)
    late_s = math.log(error) / APPROACH_RATE if error > 1.0 else 0.0
    near_s = line.duration_s + late_s if late_s else line.near_s(ARRIVED_M, ARRIVED_RAD)
    return max(line.duration_s, near_s + ARRIVED_S) + LAG_S


def _approach_rate(distance: float, acceleration: float) -> float:
    """Return the speed per distance that comes to rest at distance 0 with at most ``acceleration`` [1/s]."""
    proportional = acceleration / APPROACH_RATE**2
    further = max(distance, proportional)
    return math.sqrt(acceleration * (2.0 * further - proportional)) / further


class _Limits:
    """What limits the reference's velocity, with the slowest direction that the motors allow."""

    def __init__(self, model: DriveModel, share: float) -> None:
        self.acceleration = model.acceleration_limit_m_s2
        self.turn_acceleration = turn_acceleration(model)
        self._rows = [tuple(map(float, row)) for row in model.rows / model.radius_m[:, None]]
        self._wheel_rad_s = share * model.wheel_limit_rad_s
        motors_m_s = min(motor_speed(model, along) for along in directions(_DIRECTIONS))
        self._speed_m_s = min(model.speed_limit_m_s, motors_m_s)
        self._turn_rad_s = min(model.turn_limit_rad_s, motor_speed(model, TURNING))

    def scale(self, vx: float, vy: float, wz: float, heading: float) -> float:
        """Return the factor, 1 or less, of a world velocity at a heading that keeps all limits."""
        c, s = math.cos(heading), math.sin(heading)
        ahead, left = c * vx + s * vy, c * vy - s * vx
        wheel = max(abs(a * ahead + b * left + k * wz) for a, b, k in self._rows)
        speed, turn = math.hypot(vx, vy), abs(wz)
        return min(
            1.0,
            self._wheel_rad_s / wheel if wheel else 1.0,
            self._speed_m_s / speed if speed else 1.0,
            self._turn_rad_s / turn if turn else 1.0,
        )
