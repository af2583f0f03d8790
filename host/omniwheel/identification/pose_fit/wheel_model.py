# SPDX-License-Identifier: MIT
"""Geometry parameters of an omni-wheel robot and its odometry matrix.

Wheel i at bearing a_i rolls with speed ``r_i w_i = -sin(a_i) vx + cos(a_i) vy + l_i wz``. (vx, vy, wz) is the twist of
the *tracked point*, along the axes of the *tracked body*: the markers, not the wheels' centre. With the tracked point
at (c_x, c_y) in the wheels' frame, and the tracked heading ahead of the wheels' heading by psi::

    a_i = bearing_i - psi + angle_i
    l_i = l - c_x cos(bearing_i) - c_y sin(bearing_i) + lever_i

``angle_i`` and ``lever_i`` are deviations of single wheels. With them the matrix C with the rows
(-sin a_i, cos a_i, l_i) / r_i is any n x 3 matrix. The odometry matrix is its pseudo-inverse, with a factor
(1 + direction_i) on forward and (1 - direction_i) on backward rolling.

A robot that translates may turn by less than one that turns on the spot, for the same rolling: with the share of
translation ``g = |v| / (|v| + l |wz|)``, between 0 (turns on the spot) and 1 (goes straight), its turn has the factor
(1 + turn_translating g).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omni_schema import Robot
from omniwheel.errors import LogError

Array = NDArray[np.float64]

PLANT = ("radius", "distance", "tracked_x", "tracked_y", "tracked_heading")
"""Kinds of parameters of the plain geometry."""
SHARE_WITHIN_S = 0.2
"""The share of translation is that of the motion within this time: a row alone has too few counts."""
MATRIX = (*PLANT, "angle", "lever")
TURN = "turn_translating"
DIRECTION = "direction"
UNITS = {
    "radius": "_m",
    "distance": "_m",
    "tracked_x": "_m",
    "tracked_y": "_m",
    "tracked_heading": "_rad",
    "angle": "_rad",
    "lever": "_m",
    "direction": "",
    "turn_translating": "",
}


@dataclass(frozen=True)
class Model:
    """Which kinds of parameters are free."""

    name: str
    kinds: tuple[str, ...]


MODELS = (
    Model("geometry", PLANT),
    Model("geometry, turn by translation", (*PLANT, TURN)),
    Model("geometry, radius by direction", (*PLANT, DIRECTION)),
    Model("geometry, turn by translation, radius by direction", (*PLANT, TURN, DIRECTION)),
    Model("full matrix", MATRIX),
    Model("full matrix, turn by translation", (*MATRIX, TURN)),
    Model("full matrix, radius by direction", (*MATRIX, DIRECTION)),
    Model("full matrix, turn by translation, radius by direction", (*MATRIX, TURN, DIRECTION)),
)
"""From the fewest parameters to the most."""


@dataclass(frozen=True)
class WheelModel:
    """Nominal layout: ``radius_m``, ``distance_m``, ``bearing_rad`` (n,); parameters are one vector in SI units.

    ``radius_scale``: radius of each wheel over ``radius_m``, as of an earlier calibration; empty: 1.
    """

    radius_m: float
    distance_m: float
    bearing_rad: Array
    radius_scale: tuple[float, ...] = ()

    @property
    def wheels(self) -> int:
        """Number of wheels."""
        return len(self.bearing_rad)

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kind of each parameter."""
        n = self.wheels
        single = ("distance", "tracked_x", "tracked_y", "tracked_heading")
        return ("radius",) * n + single + ("angle",) * n + ("lever",) * n + ("direction",) * n + (TURN,)

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each parameter, with its unit."""
        numbered = ("radius", "angle", "lever", "direction")
        number = dict.fromkeys(numbered, 0)
        names = []
        for kind in self.kinds:
            if kind in number:
                number[kind] += 1
                names.append(f"wheel_{number[kind]}_{kind}{UNITS[kind]}")
            else:
                names.append(f"{'wheel_distance' if kind == 'distance' else kind}{UNITS[kind]}")
        return tuple(names)

    @property
    def nominal(self) -> Array:
        """Parameters of the documented geometry."""
        n = self.wheels
        radii = [self.radius_m * scale for scale in self.radius_scale or (1.0,) * n]
        return np.array([*radii, self.distance_m] + [0.0] * (4 + 3 * n))

    @property
    def prior_sd(self) -> Array:
        """Standard deviation of each parameter around its nominal value before any data."""
        sd = {
            "radius": 0.1 * self.radius_m,
            "distance": 0.2 * self.distance_m,
            "tracked_x": 0.1,
            "tracked_y": 0.1,
            "tracked_heading": 0.1,
            "angle": 0.02,
            "lever": 0.03 * self.distance_m,
            "direction": 0.03,
            "turn_translating": 0.05,
        }
        return np.array([sd[kind] for kind in self.kinds])

    def free(self, model: Model, held: Sequence[str] = ()) -> NDArray[np.bool_]:
        """Mask of the parameters that a model fits, without those named in ``held``."""
        return np.array([k in model.kinds and n not in held for k, n in zip(self.kinds, self.names, strict=True)])

    def matrix(self, values: Array) -> Array:
        """Odometry matrix (..., 3, 3 n) [m, m, rad per rad]: forward rolling, backward rolling, rolling times g.

        Of parameters (..., p).
        """
        n = self.wheels
        radius = values[..., :n]
        distance, x, y, heading = (values[..., n + k, None] for k in range(4))
        angle, lever, direction = (values[..., n + 4 + k * n : n + 4 + (k + 1) * n] for k in range(3))
        bearing = self.bearing_rad
        driven = bearing - heading + angle
        arm = distance - x * np.cos(bearing) - y * np.sin(bearing) + lever
        inverse = np.stack((-np.sin(driven), np.cos(driven), arm), axis=-1) / radius[..., None]
        plain = np.linalg.pinv(inverse)
        turn = plain * np.array([[0.0], [0.0], [1.0]]) * values[..., -1, None, None]
        direction = direction[..., None, :]
        return np.concatenate((plain * (1.0 + direction), plain * (1.0 - direction), turn), axis=-1)

    def rolled(self, time_s: Array, angle_rad: Array) -> Array:
        """Return what the matrix acts on, summed up (m, 3 n), from wheel angles (m, n) at times (m,)."""
        step = np.diff(angle_rad, axis=0, prepend=angle_rad[:1])
        share = np.concatenate(([0.0], self.translating(time_s, angle_rad)))[:, None]
        return np.cumsum(np.hstack((np.maximum(step, 0.0), np.minimum(step, 0.0), share * step)), axis=0)

    def translating(self, time_s: Array, angle_rad: Array) -> Array:
        """Return the share of translation (m - 1,) between the rows, 0 to 1, by the documented geometry."""
        middle = 0.5 * (time_s[1:] + time_s[:-1])
        ends = [middle + half for half in (-0.5 * SHARE_WITHIN_S, 0.5 * SHARE_WITHIN_S)]
        moved = np.column_stack([np.diff([np.interp(end, time_s, c) for end in ends], axis=0)[0] for c in angle_rad.T])
        body = moved @ self.matrix(self.nominal)[:, : self.wheels].T
        speed, turn = np.hypot(body[:, 0], body[:, 1]), self.distance_m * np.abs(body[:, 2])
        return np.asarray(speed / np.maximum(speed + turn, 1e-12))

    def slope(self, values: Array) -> Array:
        """Derivative (9 n, p) of the flattened matrix by the parameters."""
        step = 1e-5 * self.prior_sd
        moved = np.diag(step)
        change = self.matrix(values + moved) - self.matrix(values - moved)
        return np.asarray((change.reshape(len(step), -1) / (2.0 * step[:, None])).T)


def wheel_model(robot: Robot) -> WheelModel:
    """Return the layout of a robot file. Raises LogError where its wheels do not span the plane."""
    values = robot.parameter_values()
    bearing = np.radians(np.array(robot.geometry["wheel_angle_deg"], dtype=np.float64))
    scale = tuple(values[f"W{wheel + 1}_RSCALE"] for wheel in range(robot.wheels))
    model = WheelModel(values["WHEEL_RADIUS"], values["WHEEL_DIST"], bearing, scale)
    rows = np.column_stack((-np.sin(bearing), np.cos(bearing), np.ones(len(bearing))))
    if np.linalg.matrix_rank(rows, tol=1e-3) < 3:
        raise LogError(
            "wheels at these bearings cannot move the robot along x, y and heading",
            hint="correct geometry.wheel_angle_deg in the robot file",
        )
    return model
