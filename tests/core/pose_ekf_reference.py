# SPDX-License-Identifier: MIT
"""An extended Kalman filter of the pose in float64 that keeps everything and replays: what the core is held against.

It shares no code and no matrices with the core: the kinematics come from the contact points' velocities, and late fixes
from going back to when they were taken and predicting anew.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Noise:
    """Variances per step and of a fix."""

    q_xy: float = 2.25e-9
    q_theta: float = 1.6e-8
    q_slip: float = 4e-7
    r_xy: float = 25e-6
    r_theta: float = 25e-6


@dataclass
class Geometry:
    """Wheels of one robot."""

    radius_m: float
    distance_m: float
    bearings: Array

    @property
    def matrix(self) -> Array:
        """Return wheel contact speeds per body twist, n x 3."""
        return np.stack(
            [-np.sin(self.bearings), np.cos(self.bearings), np.full(len(self.bearings), self.distance_m)], axis=1
        )

    @cached_property
    def inverse(self) -> Array:
        """Return body motion per contact motion, 3 x n."""
        return np.asarray(np.linalg.pinv(self.matrix), np.float64)


def rotation(angle: float) -> Array:
    """Return the matrix that turns (x, y, theta) by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def move(geometry: Geometry, state: Array, turned: Array) -> Array:
    """Return the state after the wheels turned by some angles (mid-point rule)."""
    slip = state[3:] if len(state) > 3 else 0.0
    body = geometry.inverse @ (geometry.radius_m * turned * (1.0 - slip))
    after = state.copy()
    after[:3] += rotation(state[2] + body[2] / 2) @ body
    return after


def jacobian(geometry: Geometry, state: Array, turned: Array) -> Array:
    """Return d move / d state by complex step."""
    columns = []
    for i in range(len(state)):
        x = state.astype(complex)
        x[i] += 1e-30j
        slip = x[3:] if len(state) > 3 else 0.0
        body = geometry.inverse @ (geometry.radius_m * turned * (1.0 - slip))
        heading = x[2] + body[2] / 2
        c, s = np.cos(heading), np.sin(heading)
        x[:3] += np.array([c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]])
        columns.append(x.imag / 1e-30)
    return np.stack(columns, axis=1)


def wrap(angle: float) -> float:
    """Wrap into [-pi, pi)."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


@dataclass
class Filter:
    """Predict and update, nothing else."""

    geometry: Geometry
    noise: Noise
    x: Array
    p: Array
    nis: float = 0.0

    def predict(self, turned: Array) -> None:
        """One tick."""
        f = jacobian(self.geometry, self.x, turned)
        self.x = move(self.geometry, self.x, turned)
        q = [self.noise.q_xy, self.noise.q_xy, self.noise.q_theta, *(self.noise.q_slip * (turned != 0))]
        self.p = f @ self.p @ f.T + np.diag(q[: len(self.x)])

    def update(self, fix: Array) -> None:
        """Use a fix that is not late."""
        h = np.eye(3, len(self.x))
        r = np.diag([self.noise.r_xy, self.noise.r_xy, self.noise.r_theta])
        y = fix - self.x[:3]
        y[2] = wrap(y[2])
        s = h @ self.p @ h.T + r
        k = self.p @ h.T @ np.linalg.inv(s)
        self.nis = float(y @ np.linalg.solve(s, y))
        self.x = self.x + k @ y
        a = np.eye(len(self.x)) - k @ h
        self.p = a @ self.p @ a.T + k @ r @ k.T


@dataclass
class Replay:
    """Keeps the filter at the newest fix's time and all motion since."""

    past: Filter
    motion: list[Array] = field(default_factory=list)

    def predict(self, turned: Array) -> None:
        """One tick."""
        self.motion.append(turned)

    def update(self, fix: Array, age_ticks: int) -> float:
        """Use a fix at the time it was taken; return its NIS."""
        split = len(self.motion) - age_ticks
        for turned in self.motion[:split]:
            self.past.predict(turned)
        self.motion = self.motion[split:]
        self.past.update(fix)
        return self.past.nis

    def now(self) -> Filter:
        """Return the filter carried to now."""
        filter_now = copy.deepcopy(self.past)
        for turned in self.motion:
            filter_now.predict(turned)
        return filter_now
