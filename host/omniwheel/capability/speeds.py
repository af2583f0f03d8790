# SPDX-License-Identifier: MIT
"""How fast a robot can go, and gain speed, in a direction, and what limits it there.

A direction is a body twist of length one: (cos, sin, 0) for driving, (0, 0, 1) for turning on the spot. Steady driving
has to bear back EMF, dry and viscous friction and the rollers' drag. Gaining speed has to push mass and wheels, and the
floor has to hold the wheels. See the derivation in docs/guides/robot-file.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.capability.drive_model import Array, DriveModel

MOTORS, GRIP = "motors", "grip"
_LEAST = 1e-12


@dataclass(frozen=True)
class Bound:
    """The largest value, and what limits it: a parameter's name, "motors" (torque and voltage) or "grip"."""

    value: float
    cause: str


def direction(angle_rad: float) -> Array:
    """Return the body direction of driving at an angle from forward, counter-clockwise."""
    return np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])


def directions(count: int) -> list[Array]:
    """Return ``count`` directions of driving, evenly spread, counter-clockwise from forward."""
    return [direction(2.0 * np.pi * k / count) for k in range(count)]


TURNING: Array = np.array([0.0, 0.0, 1.0])
"""Turning on the spot, counter-clockwise."""


def _smallest(bounds: Sequence[Bound]) -> Bound:
    return min(bounds, key=lambda bound: bound.value)


def _least_quotient(available: Array | float, needed: Array) -> float:
    """Return the smallest of available / |needed|; wheels that need nothing do not count."""
    size = np.abs(needed)
    shares = np.broadcast_to(np.asarray(available, dtype=float), size.shape)
    counted = size > _LEAST
    return float(max(0.0, np.min(shares[counted] / size[counted]))) if counted.any() else float("inf")


def motor_speed(model: DriveModel, along: Array) -> float:
    """Return the steady speed [m/s or rad/s] along a direction that the motors reach at full duty, without limits."""
    drag = model.roller_friction_N_s_m * (model.axle.T @ (model.axle @ along))
    per_speed = model.braking_N_m_s * (model.rows @ along) / model.radius_m
    per_speed = per_speed + model.radius_m * model.wheel_forces(drag)
    return _least_quotient(model.stall_torque_N_m, per_speed)


def limit_speed(model: DriveModel, along: Array) -> float:
    """Return the speed along a direction at which the fastest wheel turns at LIM_WHEEL."""
    return _least_quotient(model.wheel_limit_rad_s, (model.rows @ along) / model.radius_m)


def speed_bounds(model: DriveModel, along: Array) -> list[Bound]:
    """Return every bound of the speed along a direction."""
    turning = abs(along[2]) > 0.0
    own = Bound(model.turn_limit_rad_s, "LIM_W") if turning else Bound(model.speed_limit_m_s, "LIM_V")
    return [Bound(motor_speed(model, along), MOTORS), Bound(limit_speed(model, along), "LIM_WHEEL"), own]


def top_speed(model: DriveModel, angle_rad: float) -> Bound:
    """Return the top speed [m/s] at an angle from forward."""
    return _smallest(speed_bounds(model, direction(angle_rad)))


def top_turn_rate(model: DriveModel) -> Bound:
    """Return the top turn rate on the spot [rad/s]."""
    return _smallest(speed_bounds(model, TURNING))


def acceleration_bounds(model: DriveModel, along: Array, speed: float = 0.0) -> list[Bound]:
    """Return the bounds of the acceleration along a direction, from ``speed`` in that direction: motors and grip."""
    inertia = np.array([model.mass_kg, model.mass_kg, model.body_inertia_kg_m2])
    forces = model.wheel_forces(inertia * along)
    wheel = (model.rows @ along) / model.radius_m
    torque = model.radius_m * forces + model.inertia_kg_m2 * wheel
    left = model.stall_torque_N_m - model.braking_N_m_s * np.sign(torque) * wheel * speed
    grip_N = model.friction_coefficient * model.load_N
    return [Bound(_least_quotient(left, torque), MOTORS), Bound(_least_quotient(grip_N, forces), GRIP)]


def top_acceleration(model: DriveModel, along: Array, speed: float = 0.0) -> Bound:
    """Return the largest acceleration along a direction [m/s^2 or rad/s^2] that motors and floor allow."""
    return _smallest(acceleration_bounds(model, along, speed))
