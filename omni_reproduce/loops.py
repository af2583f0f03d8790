# SPDX-License-Identifier: MIT
"""The loops of Tables 1 to 3 around the control core: path, position controller, wheel commands, a simulated world.

Axes are x [m], y [m], theta [rad], in this order. Controllers, kinematics and limits are the control core's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.world import NO_POSE_SENSOR, PoseSensor, World, world_config
from omni_reproduce.experiment import Row
from omni_schema import Robot
from omniwheel._core import ffi, lib
from omniwheel.errors import OmniError
from omniwheel.robots import read_robot

Array = NDArray[np.float64]

AXES = ("x", "y", "θ")
AXIS_UNITS = ("m", "m", "rad")
NO_LIMIT = 1e6
"""Limit of an integral that the report does not limit."""

_SWITCHES = {
    "sign": lib.OMNI_ISMC_SWITCH_SIGN,
    "boundary": lib.OMNI_ISMC_SWITCH_BOUNDARY,
    "super_twisting": lib.OMNI_ISMC_SWITCH_SUPER_TWISTING,
}
_MIDDLE_S = {"now": 0.0, "middle": 0.5}


class SettingError(OmniError):
    """A setting of an experiment cannot be used; the message says which and why."""


@cache
def _robot_file() -> Robot:
    return read_robot("four_wheel")


def make_world(
    robot: Mapping[str, Any],
    plant: str,
    seed: int,
    start_pose: Sequence[float] | Array,
    pose_sensor: PoseSensor = NO_POSE_SENSOR,
    **fields: Any,
) -> World:
    """Return a world with the four-wheel robot, its ``wheel_radius_m`` and ``wheel_distance_m`` [m] from ``robot``.

    ``robot`` also holds the motor's constants, by their names in ``hil_world_config_t``; ``fields`` are further ones.
    """
    own: dict[str, Any] = {name: value for name, value in robot.items() if name.startswith("motor_")}
    config = world_config(
        _robot_file(),
        plant=plant,
        seed=seed,
        pose_sensor=pose_sensor,
        start_pose=(start_pose[0], start_pose[1], start_pose[2]),
        **own,
        **fields,
    )
    for wheel in range(config.wheels):
        config.wheel_radius_m[wheel] = robot["wheel_radius_m"]
        config.wheel_distance_m[wheel] = robot["wheel_distance_m"]
    return World(config)


def make_kinematics(world: World) -> Any:
    """Return the ``omni_kinematics_t *`` of the world's robot."""
    config = world.c.config
    given = ffi.new("omni_kinematics_config_t *")
    given.wheels = config.wheels
    for wheel in range(config.wheels):
        given.radius_m[wheel] = config.wheel_radius_m[wheel]
        given.distance_m[wheel] = config.wheel_distance_m[wheel]
        given.angle_rad[wheel] = config.wheel_angle_rad[wheel]
    kinematics = ffi.new("omni_kinematics_t *")
    if lib.omni_kinematics_init(kinematics, given) != lib.OMNI_OK:
        raise SettingError("the wheels cannot produce every motion", hint="check wheel radius and distance")
    return kinematics


def one_step_limit(world: World, step_s: float, slip_m_s: float, slip_error: float) -> Array:
    """Return the RMS error per axis that the part of the slip missed by its estimate causes in one step.

    Slip (uniform to ``slip_m_s``) and relative error of its estimate (uniform to ``slip_error``) are independent:
    the variance of their product is a² ε² / 9.
    """
    kinematics = make_kinematics(world)
    rows = np.array([list(row)[: world.wheels] for row in kinematics.b_pinv])
    limit: Array = step_s * slip_m_s * slip_error / 3.0 * np.linalg.norm(rows, axis=1)
    return limit


class Path:
    """A trajectory of the core: as it is from time 0 on, or with its clock slowed to the wheels' limit.

    ``spec`` has the fields of ``omni_trajectory_config_t`` (type and rotation by name). With ``wheel_limit_rad_s`` the
    path starts and ends at rest and needs at most ``margin`` of that wheel speed.
    """

    def __init__(
        self, spec: Mapping[str, Any], kinematics: Any, wheel_limit_rad_s: float | None = None, margin: float = 1.0
    ) -> None:
        config = ffi.new("omni_trajectory_config_t *", {key: spec[key] for key in spec.keys() - {"type", "rotation"}})
        config.type = getattr(lib, f"OMNI_TRJ_TYPE_{spec['type'].upper()}")
        config.rotation = getattr(lib, f"OMNI_TRJ_ROT_{spec['rotation'].upper()}")
        self.clocked = config.scale = wheel_limit_rad_s is not None
        config.wheel_limit_rad_s = wheel_limit_rad_s or NO_LIMIT
        config.margin = margin
        config.voltage_limit_V = NO_LIMIT
        config.ff_speed_V_s = 1.0
        self._plan = ffi.new("omni_trajectory_t *")
        self._reference = ffi.new("omni_reference_t *")
        self._second = ffi.new("omni_twist_t *")
        origin = ffi.new("omni_pose_t *")
        for _ in range(2):  # the second time from the path's own start: no lead-in
            if lib.omni_trajectory_plan(self._plan, config, kinematics, ffi.NULL, origin) != lib.OMNI_OK:
                raise SettingError(
                    f"the path {dict(spec)} cannot be planned", hint="see omni/trajectory.h for the ranges"
                )
            origin[0] = self._plan.start

    @property
    def peak_wheel_rad_s(self) -> float:
        """Largest wheel speed the path needs as it is."""
        return float(self._plan.peak_wheel_rad_s)

    @property
    def scale(self) -> float:
        """By how much the clock is slowed."""
        return float(self._plan.scale) if self.clocked else 1.0

    @property
    def duration_s(self) -> float:
        """Time from start to end."""
        ramps = self._plan.config.ramp_s if self.clocked else 0.0
        return float(self._plan.duration_s) * self.scale + float(ramps)

    def at(self, time_s: float) -> tuple[Array, Array]:
        """Return pose and rate at a time; before the start the path stands still."""
        reference, start = self._reference, max(time_s, 0.0)
        if self.clocked:
            lib.omni_trajectory_evaluate(self._plan, round(1e6 * start), reference)
        else:
            rate = ffi.addressof(reference, "rate")
            lib.omni_path_evaluate(self._plan, start, ffi.addressof(reference, "pose"), rate, self._second)
        pose, rate = reference.pose, reference.rate
        moving = 0.0 if time_s < 0.0 else 1.0
        return np.array([pose.x, pose.y, pose.theta]), moving * np.array([rate.vx, rate.vy, rate.wz])

    def sampled(self, step_s: float, feed_forward: str) -> tuple[Array, Array]:
        """Return the references of a run: poses (steps, 3) and rates (steps, 3) as the controller gets them.

        ``feed_forward`` is "backward" (difference to the pose a step ago), "now" (the derivative), "middle" or
        "none". With "middle" it is the derivative half a step ahead, which is what a step needs.
        """
        times = step_s * np.arange(round(self.duration_s / step_s))
        poses = np.array([self.at(time)[0] for time in times])
        if feed_forward == "backward":
            rates = np.diff(poses, axis=0, prepend=poses[:1]) / step_s
        elif feed_forward in _MIDDLE_S:
            rates = np.array([self.at(time + _MIDDLE_S[feed_forward] * step_s)[1] for time in times])
        elif feed_forward == "none":
            rates = np.zeros_like(poses)
        else:
            raise SettingError(f"feed_forward is {feed_forward!r}", hint="use backward, now, middle or none")
        return poses, rates


@dataclass(frozen=True)
class Law:
    """Settings of the ISMC in a loop; fields as in ``omni_ismc_config_t``, and what surrounds it.

    ``heading`` is the heading that B takes: "now", or in the "middle" of the step. ``hold`` stops the integral while
    wheels are at their limit.
    """

    lambda_: tuple[float, float, float]
    k: tuple[float, float, float]
    switching: str = "sign"
    phi: tuple[float, float, float] = (1.0, 1.0, 1.0)
    feed_forward: str = "backward"
    heading: str = "now"
    hold: bool = False


def law_of(setting: Mapping[str, Any], robot: Mapping[str, Any]) -> Law:
    """Return the law of a setting of a file; ``k_without_r``, the k of eq. 42 as printed, times r is k."""
    values = {key: value for key, value in setting.items() if key not in ("title", "k_without_r")}
    if "k_without_r" in setting:
        values["k"] = [robot["wheel_radius_m"] * k for k in setting["k_without_r"]]
    return Law(**values)


@dataclass(frozen=True)
class Track:
    """What came of a run, a row per step: reference, error (truth - reference), and whether the wheels were limited."""

    reference: Array
    error: Array
    limited: NDArray[np.bool_]
    smallest_margin: float
    """Condition (44): smallest k - |B+ (v_s - v_s_hat)| of all steps and axes, as a share of k."""

    @property
    def rmse(self) -> Array:
        """RMS error per axis."""
        rms: Array = np.sqrt(np.mean(self.error**2, axis=0))
        return rms


Actuate = Callable[[World, Any, float], bool]
"""Drives a world through one step: wanted wheel speeds (float[4], rad/s), length [s]; returns whether they were cut."""


class SlipController:
    """ISMC and kinematics of eq. 39 to 43, from a pose and the estimated slip speeds to wheel speeds."""

    def __init__(self, law: Law, kinematics: Any, step_s: float) -> None:
        self._kinematics = kinematics
        self._lead_s = _MIDDLE_S[law.heading] * step_s
        self._hold = law.hold
        self._state = ffi.new("omni_ismc_state_t *")
        self._config = ffi.new(
            "omni_ismc_config_t *",
            {
                "lambda": law.lambda_,
                "k": law.k,
                "phi": law.phi,
                "integral_limit": [NO_LIMIT] * 3,
                "switching": _SWITCHES[law.switching],
                "step_s": step_s,
            },
        )
        self._pose, self._reference = ffi.new("omni_pose_t *"), ffi.new("omni_pose_t *")
        self._rate, self._wanted = ffi.new("omni_twist_t *"), ffi.new("omni_twist_t *")
        self._body = ffi.new("omni_twist_t *")
        self._terms = ffi.new("omni_control_terms_t *")
        self._slip = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._wheels = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._still = ffi.new("float[]", lib.OMNI_MAX_WHEELS)
        self._margin = ffi.new("float[]", lib.OMNI_AXES)
        lib.omni_ismc_reset(self._state)

    def step(self, pose: Array, reference: Array, rate: Array, slip: Array, cut: bool) -> Any:
        """Return the wanted wheel speeds, a ``float[4]`` [rad/s] that the next call overwrites."""
        self._pose[0], self._reference[0], self._rate[0] = tuple(pose), tuple(reference), tuple(rate)
        self._slip[0 : len(slip)] = list(slip)
        self._wanted[0] = lib.omni_ismc_step(
            self._state, self._config, self._pose, self._reference, self._rate, self._hold and cut, self._terms
        )
        heading = self._pose.theta + self._lead_s * self._wanted.wz
        self._body[0] = lib.omni_twist_to_body(self._wanted, heading)
        lib.omni_kinematics_inverse(self._kinematics, self._body, self._slip, self._wheels)
        return self._wheels

    def gain_margin(self, slip_error: Array) -> float:
        """Return the smallest 1 - |B+ (v_s - v_s_hat)| / k of the axes, condition (44), for the last pose."""
        self._slip[0 : len(slip_error)] = list(slip_error)
        lib.omni_kinematics_forward(self._kinematics, self._still, self._slip, self._body)
        self._wanted[0] = lib.omni_twist_to_world(self._body, self._pose.theta)
        lib.omni_ismc_gain_margin(self._config, self._wanted, self._margin)
        return float(min(margin / k for margin, k in zip(self._margin, self._config.k, strict=True)))


def track(
    world: World, law: Law, references: tuple[Array, Array], step_s: float, slip_error: float, seed: int, act: Actuate
) -> Track:
    """Drive along sampled references; the slip estimate is off by up to ``slip_error`` (a share) of the true slip."""
    controller = SlipController(law, make_kinematics(world), step_s)
    poses, rates = references
    wrong = np.random.default_rng((seed, 1)).uniform(-slip_error, slip_error, (len(poses), world.wheels))
    errors = np.empty_like(poses)
    limited = np.zeros(len(poses), dtype=bool)
    margin = math.inf
    for step, (reference, rate) in enumerate(zip(poses, rates, strict=True)):
        truth, slip = world.truth, world.slip_speed
        errors[step] = truth - reference
        estimate = slip * (1.0 + wrong[step])
        wheels = controller.step(truth, reference, rate, estimate, bool(step and limited[step - 1]))
        limited[step] = act(world, wheels, step_s)
        margin = min(margin, controller.gain_margin(slip - estimate))
    return Track(poses, errors, limited, margin)


def spread(values: Array) -> float | None:
    """Return the standard deviation over seeds, None for a single one."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else None


def rmse_rows(
    name: str,
    setting: str,
    rmse: Array,
    published: Sequence[float] | None,
    limit: Sequence[float | None] | Array,
    why: str,
) -> list[Row]:
    """Return a row per axis from the RMSE of each seed (seeds, 3), with what was published and the limit per axis."""
    return [
        Row(
            name, setting, f"{axis} RMSE", unit, float(rmse[:, i].mean()), spread(rmse[:, i]), len(rmse),
            published=published[i] if published else None, limit=limit[i], explanation=why,
        )
        for i, (axis, unit) in enumerate(zip(AXES, AXIS_UNITS, strict=True))
    ]  # fmt: skip


def share_row(name: str, setting: str, quantity: str, shares: Sequence[float], why: str = "") -> Row:
    """Return the row of a share, in per cent, from its values of each seed."""
    percent = 100.0 * np.array(shares)
    return Row(name, setting, quantity, "%", float(percent.mean()), spread(percent), len(percent), explanation=why)
