# SPDX-License-Identifier: MIT
"""Where a recorded pose estimate jumps: OMNI_SET_POSE, or pose fixes that come in elsewhere. That is not motion.

A robot moves no faster than its wheels turn. The distance between two rows of the estimate counts as driven only up to
what the wheels can have moved the robot meanwhile (:attr:`Steps.reach_m`). A pose fix corrects a good estimate by
millimetres, and one after a time without fixes by some centimetres. So a jump is a step that is longer by ``JUMP_M``
or ``JUMP_RAD`` and that pushing or lifting the robot cannot explain (``BY_HAND``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
JUMP_M, JUMP_RAD = 0.05, 0.1
"""A step that is longer than what can be motion by so much is a jump."""
BY_HAND = (1.0, 10.0)
"""Largest speed of a robot that is pushed or carried by hand [m/s, rad/s] while its wheels stand still."""
BODY_PER_RIM = 2.0
"""Body speed per speed of the fastest wheel's rim. It is at most the root of 2 with four wheels evenly placed, 4/3 with
three. The rest is for wheels placed unevenly, and for the speed between two rows."""
UNKNOWN_M_S, UNKNOWN_RAD_S = 10.0, 50.0
"""The fastest that a robot may be asked for (LIM_V, LIM_W), where its wheels' speeds were not recorded."""
NEAR_S = 0.25
"""Wheel speeds from so long before and after two poses tell how fast the robot was between them."""
SELDOM = 2.0
"""Where they were recorded less often, a robot is taken to be no faster than so many times the fastest of the log."""


@dataclass(frozen=True)
class Geometry:
    """What tells a robot's speed from its wheels': their radius and their distance from the robot's centre [m].

    The defaults are the limits of the parameters, for a robot that is not known: no robot is faster.
    """

    radius_m: float = 0.5
    distance_m: float = 0.02


@dataclass(frozen=True)
class PoseJump:
    """A jump of the estimate: when, between two rows [s], and by how much."""

    time_s: float
    distance_m: float
    turn_rad: float

    @property
    def text(self) -> str:
        """Say by how much it jumped."""
        turned = f" and {math.degrees(self.turn_rad):.0f}°" if abs(self.turn_rad) >= JUMP_RAD else ""
        return f"the pose estimate jumped by {self.distance_m:.2f} m{turned}"


@dataclass(frozen=True)
class Steps:
    """What lies between each row of an estimate and the next (n - 1,): time, distance, turn, and what the wheels allow.

    ``jumps`` says which of them are jumps.
    """

    time_s: Array
    distance_m: Array
    turn_rad: Array
    reach_m: Array
    jumps: NDArray[np.bool_]


def geometry_of(parameters: Mapping[str, float]) -> Geometry:
    """Return the geometry that a robot's parameters say, as far as they are known."""
    unknown = Geometry()
    return Geometry(parameters.get("WHEEL_RADIUS", unknown.radius_m), parameters.get("WHEEL_DIST", unknown.distance_m))


def steps_of(time_s: Array, pose: Array, wheel_time_s: Array, speed: Array, geometry: Geometry) -> Steps:
    """Return the steps of an estimate ``pose`` (n, 3) [m, m, rad] at ``time_s`` (n,), which rises.

    ``speed`` (k, wheels) [rad/s] at ``wheel_time_s`` (k,), which rises; there may be none.
    """
    lasts = np.diff(time_s)
    distance = np.hypot(*np.diff(pose[:, :2], axis=0).T) if len(lasts) else np.zeros(0)
    turn = np.diff(pose[:, 2])
    turn -= 2.0 * np.pi * np.round(turn / (2.0 * np.pi))
    scale, fastest = geometry.radius_m * BODY_PER_RIM, _fastest(time_s, wheel_time_s, speed)
    seldom = scale * SELDOM * float(np.max(np.abs(speed))) if speed.size else np.inf
    known = np.isfinite(fastest)
    speed_m_s = np.where(known, scale * fastest, np.clip(seldom, BY_HAND[0], UNKNOWN_M_S))
    turn_rad_s = np.where(known, scale * fastest, seldom) / geometry.distance_m
    turn_rad_s = np.where(known, turn_rad_s, np.minimum(turn_rad_s, UNKNOWN_RAD_S))
    too_far = distance > (speed_m_s + BY_HAND[0]) * lasts + JUMP_M
    too_much = np.abs(turn) > np.minimum((turn_rad_s + BY_HAND[1]) * lasts + JUMP_RAD, np.pi)
    return Steps(lasts, distance, turn, speed_m_s * lasts, too_far | too_much)


def jumps_of(time_s: Array, steps: Steps, joined: NDArray[np.bool_] | None = None) -> list[PoseJump]:
    """Return the jumps among steps, of those that are ``joined`` (n - 1,): not across a restart."""
    found = steps.jumps if joined is None else steps.jumps & joined
    return [
        PoseJump(float(0.5 * (time_s[row] + time_s[row + 1])), float(steps.distance_m[row]), float(steps.turn_rad[row]))
        for row in np.flatnonzero(found)
    ]


def without_jumps(pose: Array, rows: NDArray[np.int64]) -> Array:
    """Return a pose (n, 3) that goes on from where it was after each jump to one of these rows: turned and shifted."""
    found = pose.copy()
    for begin, end in zip(rows.tolist(), [*rows[1:].tolist(), len(pose)], strict=True):
        turn = found[begin - 1, 2] - pose[begin, 2]
        cosine, sine = math.cos(turn), math.sin(turn)
        away = pose[begin:end, :2] - pose[begin, :2]
        found[begin:end, :2] = found[begin - 1, :2] + away @ np.array([[cosine, sine], [-sine, cosine]])
        found[begin:end, 2] = pose[begin:end, 2] + turn
    return found


def _fastest(time_s: Array, wheel_time_s: Array, speed: Array) -> Array:
    """Return the speed of the fastest wheel in each step [rad/s], from the row before to the row after it.

    NaN where these are too far away.
    """
    if not len(wheel_time_s) or len(time_s) < 2:
        return np.full(max(len(time_s) - 1, 0), np.nan)
    count = len(wheel_time_s)
    first = np.maximum(np.searchsorted(wheel_time_s, time_s[:-1], side="right") - 1, 0)
    last = np.minimum(np.searchsorted(wheel_time_s, time_s[1:]), count - 1)
    known = (
        (first <= last) & (wheel_time_s[first] >= time_s[:-1] - NEAR_S) & (wheel_time_s[last] <= time_s[1:] + NEAR_S)
    )
    places = np.column_stack((np.where(known, first, 0), np.where(known, last, 0) + 1)).ravel()
    largest = np.append(np.max(np.abs(speed), axis=1), 0.0)  # so that the last place is one
    return np.asarray(np.where(known, np.maximum.reduceat(largest, places)[::2], np.nan))
