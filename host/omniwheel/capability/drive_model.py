# SPDX-License-Identifier: MIT
"""The numbers of a robot file that decide what the robot can do, as arrays.

Motor, seen at the wheel (gear included)::

    torque at the wheel = K (V - K w) / R - b w - T_c sign(w)            [N m]

K: motor constant [N m/A, V s/rad], R: resistance [ohm], b: viscous friction [N m s]. T_c: dry friction [N m],
V: voltage [V], w: wheel speed [rad/s]. This is design arithmetic for people; the robot itself does not run it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omni_schema import Robot

Array = NDArray[np.float64]

GRAVITY_M_S2 = 9.80665
WORLD_DEFAULTS = {"coulomb_friction_N_m": 0.0, "friction_coefficient": 0.6, "roller_friction_N_s_m": 0.0}
"""What is assumed where a robot file's [simulation] section is silent."""


@dataclass(frozen=True)
class DriveModel:
    """One robot. Arrays have one entry, or one row, per wheel.

    ``rows``: floor speed of a wheel's contact along its driving direction per body motion (vx, vy [m/s], wz [rad/s]).
    Its shape is (wheels, 3): -sin a, cos a, l. ``axle``: the same along the axle, where the rollers roll: cos a, sin a,
    0.
    """

    wheels: int
    rows: Array
    axle: Array
    radius_m: Array
    inertia_kg_m2: float
    viscous_N_m_s: float
    coulomb_N_m: float
    constant_N_m_A: float
    resistance_ohm: float
    supply_V: float
    duty_limit: float
    mass_kg: float
    body_inertia_kg_m2: float
    friction_coefficient: float
    roller_friction_N_s_m: float
    counts_per_revolution: float
    wheel_limit_rad_s: float
    speed_limit_m_s: float
    turn_limit_rad_s: float
    acceleration_limit_m_s2: float
    stall_V: float
    stall_s: float
    gyro: bool = False
    flow_axes: int = 0
    current_limit_A: float = 0.0
    continuous_A: float = 0.0
    heat_s: float = 10.0

    @property
    def blocked_s(self) -> float:
        """How long a blocked wheel gets ``stall_V`` at most until the robot stops.

        ``stall_s``, or longer with few counts: a wheel at a tenth of its speed must give one to be told from it.
        """
        volts_s = self.braking_N_m_s * self.resistance_ohm / self.constant_N_m_A
        count_s = 2.0 * np.pi / self.counts_per_revolution / (0.1 * self.stall_V / volts_s)
        return float(count_s * (np.floor(self.stall_s / count_s) + 1.0))

    @property
    def stall_torque_N_m(self) -> float:
        """Torque of a wheel that stands still at full duty, dry friction taken off; 0 or more."""
        torque = self.constant_N_m_A * self.supply_V * self.duty_limit / self.resistance_ohm
        return max(0.0, torque - self.coulomb_N_m)

    @property
    def stall_current_A(self) -> float:
        """Current of one motor that stands still at full duty."""
        return self.supply_V * self.duty_limit / self.resistance_ohm

    @property
    def limited_torque_N_m(self) -> float:
        """Torque of a wheel that stands still with the current that LIM_I leaves, dry friction taken off; 0 or more."""
        return max(0.0, self.constant_N_m_A * min(self.current_limit_A, self.stall_current_A) - self.coulomb_N_m)

    @property
    def hot_s(self) -> float:
        """How long a cold motor may stand still with the most current it can get, until SAFE_I stops it; or inf."""
        most_A = min(self.current_limit_A or np.inf, self.stall_current_A)
        if self.continuous_A == 0.0 or most_A <= self.continuous_A:
            return float("inf")
        return float(-self.heat_s * np.log1p(-((self.continuous_A / most_A) ** 2)))

    @property
    def braking_N_m_s(self) -> float:
        """What the torque falls by per rad/s: back EMF and viscous friction, K^2 / R + b."""
        return self.constant_N_m_A**2 / self.resistance_ohm + self.viscous_N_m_s

    @property
    def no_load_rad_s(self) -> float:
        """Speed of a lifted wheel at full duty."""
        return self.stall_torque_N_m / self.braking_N_m_s

    @property
    def load_N(self) -> float:
        """Weight on one wheel, shared evenly."""
        return self.mass_kg * GRAVITY_M_S2 / self.wheels

    @property
    def condition(self) -> float:
        """Condition of the kinematics: largest by smallest singular value of the rows, distances divided by their mean.

        1.2 to 1.5 for wheels spread evenly; infinite if the wheels cannot produce every motion.
        """
        scaled = self.rows / np.array([1.0, 1.0, float(np.mean(self.rows[:, 2]))])
        values = np.linalg.svd(scaled, compute_uv=False)
        return float(values[0] / values[-1]) if values[-1] > 1e-9 * values[0] else float("inf")

    def wheel_forces(self, force: Array) -> Array:
        """Return the driving force per wheel [N] for a force on the body (N, N, N m): the smallest that do it."""
        forces: Array = np.linalg.pinv(self.rows.T) @ force
        return forces


def drive_model(robot: Robot) -> DriveModel:
    """Return the model of a robot file."""
    return model_from_parameters(robot.parameter_values(), robot.simulation)


def model_from_parameters(values: Mapping[str, float], simulation: Mapping[str, float | list[float]]) -> DriveModel:
    """Return the model of a parameter set, with the world's numbers of a robot file (or none)."""
    world = {**WORLD_DEFAULTS, **{k: v for k, v in simulation.items() if isinstance(v, (int, float))}}
    wheels = int(values["WHEELS"])
    angle = np.radians([values[f"W{n}_ANGLE"] for n in range(1, wheels + 1)])
    distance = np.full(wheels, values["WHEEL_DIST"])
    scale = np.array([values[f"W{n}_RSCALE"] for n in range(1, wheels + 1)])
    return DriveModel(
        wheels=wheels,
        rows=np.column_stack((-np.sin(angle), np.cos(angle), distance)),
        axle=np.column_stack((np.cos(angle), np.sin(angle), np.zeros(wheels))),
        radius_m=values["WHEEL_RADIUS"] * scale,
        inertia_kg_m2=values["MOT_J"],
        viscous_N_m_s=values["MOT_B"],
        coulomb_N_m=float(world["coulomb_friction_N_m"]),
        constant_N_m_A=values["MOT_K"],
        resistance_ohm=values["MOT_R"],
        supply_V=values["BAT_V_NOM"],
        duty_limit=values["LIM_DUTY"],
        mass_kg=values["MASS"],
        body_inertia_kg_m2=values["INERTIA"],
        friction_coefficient=float(world["friction_coefficient"]),
        roller_friction_N_s_m=float(world["roller_friction_N_s_m"]),
        counts_per_revolution=values["ENC_CPR"],
        wheel_limit_rad_s=values["LIM_WHEEL"],
        speed_limit_m_s=values["LIM_V"],
        turn_limit_rad_s=values["LIM_W"],
        acceleration_limit_m_s2=values["LIM_A"],
        stall_V=values["SAFE_STALL_V"],
        stall_s=values["SAFE_STALL_T"],
        gyro=values["GYRO_AXIS"] != 0.0,
        flow_axes=(0, 2, 3)[int(values["FLOW_MODE"])],
        current_limit_A=values["LIM_I"],
        continuous_A=values["SAFE_I"],
        heat_s=values["SAFE_I_TC"],
    )
