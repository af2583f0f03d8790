# SPDX-License-Identifier: MIT
"""The velocity-level model of a robot on the floor, or of its wheels on a stand, as voltages.

Motor (24)-(27) with the winding at rest, n wheels that roll without slip, and the body (14), divided by K/R::

    on a stand, per wheel:   a w' = V - e w - u_c sgn(w)
    on the floor, per axis:  a_k q_k' = (1/g_k) sum_i (c_ik (V_i - u_c sgn(w_i)) - o_ik u_d sgn(o_i q)) - e_k q_k,
                             w = C q

The body's velocity in wheel units is q = (vx / r, vy / r, l wz / r) [rad/s]. The wheel's row is
c_i = (-sin alpha_i, cos alpha_i, 1). Along its axle it is o_i = (cos alpha_i, sin alpha_i, 0). g = (n/2, n/2, n).
What (V, w) alone can show, and what it is made of
(derivation: docs/concepts/derivations/identification.md)::

    e       = K + R b / K                           speed gain         [V s/rad]
    u_c     = R T_c / K                             Coulomb voltage    [V]
    a_stand = (R J + L b) / K                       inertia, no floor  [V s^2/rad]
    a_xy    = (R (J + 2 m r^2 / n) + L b) / K       translation        [V s^2/rad]
    a_theta = (R (J + I r^2 / (n l^2)) + L b) / K   rotation           [V s^2/rad]
    e_drag  = R rho r^2 / K                         drag across the rollers, translation only [V s/rad]
    u_d     = R r mu m g / (n K)                    dry drag across the rollers [V]; mu: force over a wheel's load
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omni_schema import Robot
from omniwheel.errors import IdentificationError

Array = NDArray[np.float64]

FLOOR = ("speed_gain_V_s", "coulomb_V", "inertia_xy_V_s2", "inertia_theta_V_s2", "drag_xy_V_s", "dry_drag_V")
STAND = ("speed_gain_V_s", "coulomb_V", "inertia_V_s2")
COULOMB_WIDTH_rad_s = 0.01
"""sgn(w) is w / sqrt(w^2 + width^2), as friction is in the simulated world."""
_SYMMETRY = 1e-6
_STEP = 0.8
"""Largest rate times substep: second-order accurate and stable where a wheel sticks."""
_MAX_SUBSTEPS = 64


@dataclass(frozen=True)
class Layout:
    """Where the wheels are: radius r [m], distance l [m], bearings alpha (n,) [rad]. Raises IdentificationError."""

    radius_m: float
    distance_m: float
    angle_rad: Array

    def __post_init__(self) -> None:
        """Refuse wheels that are not spread evenly: their axes would not part."""
        gram = self.rows.T @ self.rows
        n = len(self.angle_rad)
        if not np.allclose(gram, np.diag([n / 2, n / 2, n]), atol=_SYMMETRY):
            raise IdentificationError(
                "the model needs wheels spaced evenly around the robot; these are not",
                hint="correct geometry.wheel_angle_deg in the robot file",
            )

    @property
    def rows(self) -> Array:
        """C (n, 3): wheel speeds are C q."""
        return np.column_stack((-np.sin(self.angle_rad), np.cos(self.angle_rad), np.ones(len(self.angle_rad))))

    @property
    def across(self) -> Array:
        """O (n, 3): speeds across the driven directions are O q, in wheel units."""
        return np.column_stack((np.cos(self.angle_rad), np.sin(self.angle_rad), np.zeros(len(self.angle_rad))))


def layout_of(robot: Robot) -> Layout:
    """Return the nominal layout of a robot file."""
    geometry = robot.geometry
    angles = np.radians(np.array(geometry["wheel_angle_deg"], dtype=np.float64))
    return Layout(float(geometry["wheel_radius_m"]), float(geometry["wheel_distance_m"]), angles)


@dataclass(frozen=True)
class Model:
    """Axes of motion: C (wheels, axes), g (axes,), the parameters' names, and which of a run's wheels it describes."""

    names: tuple[str, ...]
    rows: Array
    gram: Array
    columns: tuple[int, ...]
    across: Array | None = None
    """On the floor: o (wheels, axes), the wheels' directions across the driven one."""

    @staticmethod
    def floor(layout: Layout, *, dry_drag: bool = True) -> Model:
        """Return the model of a robot that drives.

        Without ``dry_drag`` the rollers drag by speed only. Short drives cannot tell dry drag from dry friction.
        """
        n = len(layout.angle_rad)
        names, across = (FLOOR, layout.across) if dry_drag else (FLOOR[:-1], None)
        return Model(names, layout.rows, np.array([n / 2, n / 2, n]), tuple(range(n)), across)

    @staticmethod
    def stand(columns: tuple[int, ...]) -> Model:
        """Return the model of wheels that turn freely and are all alike; ``columns`` says which ones."""
        return Model(STAND, np.eye(len(columns)), np.ones(len(columns)), columns)

    def gains(self, values: Array) -> tuple[Array, Array, Array]:
        """Return e_k (lanes, axes), a_k (lanes, axes) and u_c (lanes, 1) of parameter sets (lanes, p)."""
        gain, coulomb = values[:, :1], values[:, 1:2]
        if self.names == STAND:
            return gain, values[:, 2:3], coulomb
        drag = values[:, 4:5]
        inertia = values[:, [2, 2, 3]]
        return np.concatenate((gain + drag, gain + drag, gain), axis=1), inertia, coulomb

    def simulate(self, values: Array, dt_s: Array, voltage_V: Array, start_rad_s: Array) -> tuple[Array, Array]:
        """Return mean wheel speeds during each row and wheel speeds at each row's end, (lanes, segments, rows, wheels).

        ``values`` (lanes, p) parameter sets, ``dt_s`` (segments, rows), ``voltage_V`` (segments, rows, wheels) constant
        during a row, ``start_rad_s`` (segments, axes) velocities q at the start. Exponential midpoint rule.
        """
        damping, inertia, coulomb = (x[:, None, :] for x in self.gains(values))
        lanes, (segments, rows) = len(values), dt_s.shape
        q = np.broadcast_to(start_rad_s, (lanes, *start_rad_s.shape)).copy()
        mean = np.empty((lanes, segments, rows, self.rows.shape[0]))
        end = np.empty_like(mean)
        steps = self._substeps(values, float(np.max(dt_s)))
        push = self.rows / self.gram
        frictions = [(coulomb, self.rows, push)]
        if self.across is not None:
            frictions.append((values[:, None, 5:6], self.across, self.across / self.gram))
        for row in range(rows):
            h = dt_s[:, row, None] / steps
            decay = np.exp(-h * damping / inertia)
            slope = (1.0 - decay) * inertia / damping
            drive = voltage_V[:, row] @ push
            turned = np.zeros_like(q)
            for _ in range(steps):
                first = (drive - _friction(q, frictions)) / damping
                middle = 0.5 * (q + first + (q - first) * decay)
                rest = (drive - _friction(middle, frictions)) / damping
                turned += h * rest + (q - rest) * slope
                q = rest + (q - rest) * decay
            mean[:, :, row] = (turned / dt_s[:, row, None]) @ self.rows.T
            end[:, :, row] = q @ self.rows.T
        return mean, end

    def _substeps(self, values: Array, dt_s: float) -> int:
        damping, inertia, coulomb = self.gains(values)
        rate = np.max(np.maximum(damping, coulomb / COULOMB_WIDTH_rad_s) / inertia)
        return int(np.clip(np.ceil(rate * dt_s / _STEP), 1, _MAX_SUBSTEPS))


def _friction(q: Array, frictions: Sequence[tuple[Array, Array, Array]]) -> Array:
    """Return the voltages that dry friction takes per axis: of the motors, and of the rollers if they are looked at."""
    lost = np.zeros_like(q)
    for volts, lines, push in frictions:
        lost = lost + volts * (_sign(q @ lines.T) @ push)
    return lost


def _sign(speed: Array) -> Array:
    signs: Array = speed / np.sqrt(speed * speed + COULOMB_WIDTH_rad_s**2)
    return signs
