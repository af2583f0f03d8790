# SPDX-License-Identifier: MIT
"""Direct torque control on the slip-space plant: the loop that the report's figures 5 to 8 come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.world import NO_POSE_SENSOR, TICK_US, World, world_config
from omniwheel._core import ffi, lib
from omniwheel.robots import read_robot

Array = NDArray[np.float64]
Reference = Callable[[float, Any], None]
"""Writes the reference of a time [s] into an ``omni_reference_t *``."""

TICK_S = 1e-6 * TICK_US
LOST_M = 100.0


@dataclass(frozen=True)
class Law:
    """Gains [1/s^2, 1/s], the same on all axes; period of the law [s]; limits as in ``omni_direct_torque_config_t``.

    With a ``slip_limit_m_s``, wheels are watched every millisecond against the speed of the floor below them. That is
    the true one, or with ``floor`` "reference" the one there would be on the path.
    """

    kp: float
    kd: float
    period_s: float
    torque_limit_N_m: float = 0.0
    grip: float = 0.0
    slip_limit_m_s: float = 0.0
    floor: str = "true"


@dataclass(frozen=True)
class Case:
    """One run: key of the law, part of the experiment, friction, duration [s]; seed of the points."""

    law: str
    part: str
    friction_coefficient: float
    duration_s: float
    seed: int = 0


@dataclass(frozen=True)
class Trace:
    """A run, one entry per period of the law: time [s], pose and reference (n, 3), torques [N m] and slip speeds [m/s].

    Torques and slip speeds are, per wheel, those of largest magnitude within the period. ``lost``: the run ended early
    because the robot was LOST_M from its reference.
    """

    time_s: Array
    pose: Array
    reference: Array
    torque_N_m: Array
    slip_m_s: Array
    lost: bool

    @property
    def error(self) -> Array:
        """Pose minus reference (n, 3), heading wrapped."""
        error = self.pose - self.reference
        error[:, 2] = (error[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
        return error


class TorqueLoop:
    """A world of the plant slip and the controller of the core, for the robot of a specification."""

    def __init__(self, robot: Mapping[str, Any], law: Law, friction_coefficient: float | None = None) -> None:
        self.law = law
        self.world = _world(robot, friction_coefficient)
        self._k = _kinematics(robot)
        self._config = ffi.new("omni_direct_torque_config_t *")
        self._config.mass_kg = robot["mass_kg"]
        self._config.inertia_kg_m2 = robot["inertia_kg_m2"]
        self._config.wheel_inertia_kg_m2 = robot["wheel_inertia_kg_m2"]
        self._config.kp = [law.kp] * 3
        self._config.kd = [law.kd] * 3
        self._config.torque_limit_N_m = law.torque_limit_N_m
        self._config.grip = law.grip
        self._config.slip_limit_m_s = law.slip_limit_m_s
        self._config.step_s = TICK_S
        self._peaks = ffi.new("hil_torque_peaks_t *")

    def run(self, reference: Reference, duration_s: float) -> Trace:
        """Follow a reference from where the robot stands."""
        wanted = ffi.new("omni_reference_t *")
        ticks = round(self.law.period_s / TICK_S)
        rows: list[tuple[float, Array, list[float], Array, Array]] = []
        lost = False
        for n in range(round(duration_s / self.law.period_s)):
            time_s = n * self.law.period_s
            reference(time_s, wanted)
            pose = self.world.truth
            goal = [wanted.pose.x, wanted.pose.y, wanted.pose.theta]
            rows.append((time_s, pose, goal, *self._period(wanted, ticks)))
            lost = bool(np.hypot(pose[0] - goal[0], pose[1] - goal[1]) > LOST_M)
            if lost:
                break
        times, poses, goals, torques, slips = (np.array(column) for column in zip(*rows, strict=True))
        return Trace(times, poses, goals, torques, slips, lost)

    def _period(self, wanted: Any, ticks: int) -> tuple[Array, Array]:
        """Run one period of the law; return the largest torques and slip speeds in it."""
        floor = ffi.addressof(wanted, "rate") if self.law.floor == "reference" else ffi.NULL
        if (
            lib.hil_run_direct_torque(self.world.c, self._k, self._config, wanted, floor, ticks, self._peaks)
            != lib.HIL_OK
        ):
            raise ValueError("the law and the world do not fit together; the plant must take torques")
        wheels = self.world.wheels
        return np.array(list(self._peaks.torque_N_m)[:wheels]), np.array(list(self._peaks.slip_m_s)[:wheels])


def _world(robot: Mapping[str, Any], friction_coefficient: float | None) -> World:
    config = world_config(
        read_robot("four_wheel"),
        plant="slip",
        pose_sensor=NO_POSE_SENSOR,
        mass_kg=robot["mass_kg"],
        inertia_kg_m2=robot["inertia_kg_m2"],
        motor_inertia_kg_m2=robot["wheel_inertia_kg_m2"],
        friction_coefficient=friction_coefficient or robot["friction_coefficient"],
        slip_stiffness_N_s_m=robot["slip_stiffness_N_s_m"],
    )
    wheels = len(robot["wheel_angle_deg"])
    config.wheel_angle_rad = list(np.radians(robot["wheel_angle_deg"]))
    config.wheel_radius_m = [robot["wheel_radius_m"]] * wheels
    config.wheel_distance_m = [robot["wheel_distance_m"]] * wheels
    return World(config)


def _kinematics(robot: Mapping[str, Any]) -> Any:
    config = ffi.new("omni_kinematics_config_t *")
    config.wheels = len(robot["wheel_angle_deg"])
    config.angle_rad = list(np.radians(robot["wheel_angle_deg"]))
    config.radius_m = [robot["wheel_radius_m"]] * config.wheels
    config.distance_m = [robot["wheel_distance_m"]] * config.wheels
    k = ffi.new("omni_kinematics_t *")
    if lib.omni_kinematics_init(k, config) != lib.OMNI_OK:
        raise ValueError("the core refuses the robot's geometry")
    return k


def rose(robot: Mapping[str, Any], petals: int, size_m: float, period_s: float) -> Reference:
    """Return the bare rose of the core's trajectories, endlessly, heading 0; nothing slows it down to any limit."""
    config = ffi.new("omni_trajectory_config_t *")
    config.type = lib.OMNI_TRJ_TYPE_ROSE
    config.rotation = lib.OMNI_TRJ_ROT_FIXED
    config.petals, config.size_m, config.period_s = petals, size_m, period_s
    config.laps = config.margin = config.wheel_limit_rad_s = config.voltage_limit_V = 1.0
    plan = ffi.new("omni_trajectory_t *")
    if lib.omni_trajectory_plan(plan, config, _kinematics(robot), ffi.NULL, ffi.new("omni_pose_t *")) != lib.OMNI_OK:
        raise ValueError("the core refuses the rose")

    def write(time_s: float, wanted: Any) -> None:
        place = ffi.addressof(wanted, "pose")
        first, second = ffi.addressof(wanted, "rate"), ffi.addressof(wanted, "acceleration")
        lib.omni_path_evaluate(plan, time_s % period_s, place, first, second)

    return write


def points(goals: Array, every_s: float) -> Reference:
    """Return a reference that stands at each goal (n, 3) for a while."""

    def write(time_s: float, wanted: Any) -> None:
        goal = goals[min(int(time_s / every_s + 1e-9), len(goals) - 1)]
        wanted.pose.x, wanted.pose.y, wanted.pose.theta = goal

    return write


def law_of(spec: Mapping[str, Any], key: str) -> Law:
    """Return a law of the specification."""
    return Law(**{name: value for name, value in spec["law"][key].items() if name != "title"})


def goals_of(spec: Mapping[str, Any], part: str, seed: int) -> Array:
    """Return the random points (n, 3) of a seed: x, y [m], heading [rad]."""
    half = spec["points"][part]
    width = np.array([half["half_width_m"], half["half_width_m"], half["half_turn_rad"]])
    return np.random.default_rng(seed).uniform(-width, width, (spec["points"]["count"], 3))


def simulate(spec: Mapping[str, Any], case: Case) -> Trace:
    """Run one case."""
    loop = TorqueLoop(spec["robot"], law_of(spec, case.law), case.friction_coefficient)
    if case.part in spec["points"]:
        reference = points(goals_of(spec, case.part, case.seed), spec["points"]["every_s"])
    else:
        path = spec["rose"]
        reference = rose(spec["robot"], path["petals"], path["size_m"], path["period_s"])
    return loop.run(reference, case.duration_s)
