# SPDX-License-Identifier: MIT
"""Robots that exist only in the simulated world, whose true parameters are known: the judge of an identification."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.world import GRAVITY_M_S2, IDEAL_WHEELS, PoseSensor, World, world_config
from omni_schema import Robot
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.excitation import PERIOD_S

Array = NDArray[np.float64]

SUPPLY_SD_V = 0.02
"""Noise of a measured supply voltage."""
SPREAD = 0.2
"""Share by which a random robot's motor and body differ from the file's, either way."""
GEOMETRY_SPREAD = 0.01
MOTION_CAPTURE = PoseSensor(rate_Hz=50.0, sd_xy_m=0.001, sd_theta_rad=0.002, delay_s=0.0)
FREE_WHEEL_FRICTION = 1e-9
SUPPLY_TICKS = 2
"""The supply is averaged over samples this far apart."""
_SPREAD_FIELDS = (
    "motor_inertia_kg_m2",
    "motor_viscous_N_m_s",
    "motor_constant_N_m_A",
    "motor_resistance_ohm",
    "motor_coulomb_N_m",
    "mass_kg",
    "inertia_kg_m2",
)


@dataclass(frozen=True)
class SimulatedRobot:
    """A robot file's robot with true parameters of its own (fields of ``hil_world_config_t`` by name)."""

    robot: Robot
    seed: int
    changes: dict[str, float] = field(default_factory=dict)
    radius_scale: tuple[float, ...] = ()
    distance_scale: float = 1.0

    @staticmethod
    def random(robot: Robot, seed: int) -> SimulatedRobot:
        """Return the robot whose parameters differ from the file's by chance, a function of the seed only."""
        draw = np.random.default_rng(seed)
        nominal = world_config(robot)
        changes = {name: getattr(nominal, name) * (1 + SPREAD * draw.uniform(-1, 1)) for name in _SPREAD_FIELDS}
        scales = 1.0 + GEOMETRY_SPREAD * draw.uniform(-1, 1, robot.wheels)
        return SimulatedRobot(robot, seed, changes, tuple(scales), 1.0 + GEOMETRY_SPREAD * float(draw.uniform(-1, 1)))

    def on_ideal_wheels(self) -> SimulatedRobot:
        """Return the same robot on round wheels without dry drag: those that identification's model knows."""
        return replace(self, changes={**self.changes, **IDEAL_WHEELS})

    def config(self, sensor: PoseSensor, seed: int, **overrides: float) -> Any:
        """Return the world's configuration, ``hil_world_config_t *``."""
        config = world_config(self.robot, seed=seed, pose_sensor=sensor)
        for name, value in {**self.changes, **overrides}.items():
            setattr(config, name, type(getattr(config, name))(value))
        for wheel in range(self.robot.wheels):
            config.wheel_radius_m[wheel] *= self.radius_scale[wheel] if self.radius_scale else 1.0
            config.wheel_distance_m[wheel] *= self.distance_scale
        return config

    def true_values(self) -> dict[str, float]:
        """Return what an identification should find: the parameters of ``model`` and the robot's own, by name.

        Radii and distance are effective ones. The viscous drag of the rollers makes translating wheels creep by
        rho / C. In the mean a wheel stands a third of the dip lower. Dry drag of the rollers is not in it: what it
        costs depends on the speed.
        """
        c = self.config(MOTION_CAPTURE, 0)
        n = self.robot.wheels
        radius = float(np.mean(list(c.wheel_radius_m)[:n]))
        ohm_per_constant = c.motor_resistance_ohm / c.motor_constant_N_m_A
        winding = c.motor_inductance_H * c.motor_viscous_N_m_s / c.motor_constant_N_m_A
        grip = c.slip_stiffness_N_s_m / (c.slip_stiffness_N_s_m + c.roller_friction_N_s_m)
        arm = radius / c.wheel_distance_m[0]
        dip_m = c.roller_dip_m / 3.0 if c.rollers_per_row > 0 else 0.0
        return {
            "speed_gain_V_s": c.motor_constant_N_m_A + ohm_per_constant * c.motor_viscous_N_m_s,
            "coulomb_V": ohm_per_constant * c.motor_coulomb_N_m,
            "inertia_V_s2": ohm_per_constant * c.motor_inertia_kg_m2 + winding,
            "inertia_xy_V_s2": ohm_per_constant * (c.motor_inertia_kg_m2 + 2 * c.mass_kg * radius**2 / n) + winding,
            "inertia_theta_V_s2": ohm_per_constant * (c.motor_inertia_kg_m2 + c.inertia_kg_m2 * arm**2 / n) + winding,
            "drag_xy_V_s": ohm_per_constant * c.roller_friction_N_s_m * radius**2,
            "dry_drag_V": ohm_per_constant * radius * c.roller_bushing_friction * c.mass_kg * GRAVITY_M_S2 / n,
            "motor_constant_N_m_A": c.motor_constant_N_m_A,
            "motor_viscous_N_m_s": c.motor_viscous_N_m_s,
            "motor_coulomb_N_m": c.motor_coulomb_N_m,
            "motor_inertia_kg_m2": c.motor_inertia_kg_m2,
            "inertia_kg_m2": c.inertia_kg_m2,
            "mass_kg": c.mass_kg,
            "motor_resistance_ohm": c.motor_resistance_ohm,
            "wheel_radius_m": grip * (radius - dip_m),
            "wheel_distance_m": grip * c.wheel_distance_m[0],
            **{f"wheel_{i + 1}_radius_m": grip * (c.wheel_radius_m[i] - dip_m) for i in range(n)},
        }

    def run(
        self, name: str, duty: Array, *, run: int = 0, on_stand: bool = False, sensor: PoseSensor = MOTION_CAPTURE
    ) -> Dataset:
        """Drive the robot open loop with a table of duties and return what its sensors saw.

        ``run`` numbers the runs of one robot, so that each has noise of its own. A robot on a stand turns its wheels in
        the air. Logged every PERIOD_S: encoder counts, duty times the supply averaged over the row, motion-capture
        poses.
        """
        seed = self.seed * 64 + run
        free = {"friction_coefficient": FREE_WHEEL_FRICTION} if on_stand else {}
        sensor = replace(sensor, rate_Hz=0.0) if on_stand else sensor
        world = World(self.config(sensor, seed, **free))
        supply_noise = SUPPLY_SD_V * np.random.default_rng([seed, 1]).standard_normal(len(duty) + 1)
        counts, supply, poses = _drive(world, duty)
        direction = np.array([world.c.config.encoder_direction[i] for i in range(world.wheels)])
        angle = counts * direction * (2.0 * math.pi / world.c.config.counts_per_revolution)
        supply = supply + supply_noise
        applied = np.round(np.vstack((duty, duty[-1:])) * 4096) / 4096
        times = np.arange(len(duty) + 1, dtype=np.float64) * PERIOD_S
        return Dataset(
            name,
            times,
            np.gradient(angle, times, axis=0),
            applied * supply[:, None],
            np.array([row[0] for row in poses]),
            np.array([row[1:] for row in poses]),
            wheel_angle_rad=angle,
            supply_V=supply,
        )


def _drive(world: World, duty: Array) -> tuple[Array, Array, list[tuple[float, ...]]]:
    """Return counts (rows + 1, wheels), mean supply during each row (rows + 1,) [V], pose fixes (time, x, y, theta)."""
    ticks = round(PERIOD_S * 1000)
    counts, supply, poses = [], [], []
    direction = np.array([world.c.config.motor_direction[i] for i in range(world.wheels)])
    for row in [*duty, np.zeros(world.wheels)]:
        sensors = world.sense()
        counts.append(list(sensors.counts)[: world.wheels])
        if sensors.has_fix:
            poses.append((sensors.fix.taken_us * 1e-6, *sensors.fix.pose))
        world.set_duty((direction * row).tolist())
        total = 0.0
        for _ in range(ticks // SUPPLY_TICKS):
            world.step(SUPPLY_TICKS)
            total += world.c.supply_V
        supply.append(total * SUPPLY_TICKS / ticks)
    return np.array(counts, dtype=np.float64), np.array(supply), poses
