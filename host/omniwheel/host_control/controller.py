# SPDX-License-Identifier: MIT
"""The original four-wheel robot's controller: the core's modules, stepped on the host at 50 Hz, pose in and PWM out.

The robot has no encoders, so the pose EKF predicts with the wheel speeds that were commanded. This is the report's
assumption (section 3.2): PWM is wheel speed, in proportion and at once. What that gets wrong the fixes correct.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omni_schema import Robot
from omni_schema.toml_file import read_toml, take_table
from omniwheel._core import ffi, lib
from omniwheel.core_config import plan_trajectory, robot_config
from omniwheel.errors import CoreError, ParameterRangeError
from omniwheel.frames import Pose, Twist
from omniwheel.host_control.fix_checks import FixChecks
from omniwheel.host_control.pwm_line import FULL_PWM, MOTORS, STOP, PwmLine
from omniwheel.limits import HOST_CONTROL_DELAY_S
from omniwheel.mocap.source import MocapPose
from omniwheel.parameters import ParameterValue, checked_value
from omniwheel.robots import parameter_table

PERIOD_S = 0.02
PREDICTIONS = 4
"""Filter steps per control step, so that a slot of the filter's history is one control step."""
_START_US = 1_000_000
_DEFAULTS = Path(__file__).with_name("host_control.toml")


@dataclass(frozen=True)
class HostControlSettings:
    """The robot's electronics as the host has to assume them.

    ``full_speed_rad_s`` is a wheel's speed at PWM 255 (None: from the robot file's motor and supply). ``pwm_min`` is
    the PWM below which the wheels stand (0..254; 0: no compensation). ``delay_s`` is the time from sending a line until
    the wheels follow.
    """

    full_speed_rad_s: float | None = None
    pwm_min: int = 0
    delay_s: float = HOST_CONTROL_DELAY_S

    def __post_init__(self) -> None:
        speed = self.full_speed_rad_s
        if speed is not None and not (math.isfinite(speed) and speed > 0.0):
            raise ParameterRangeError(f"the full speed is {speed}; must be a number above 0 rad/s")
        if not 0 <= self.pwm_min < FULL_PWM:
            raise ParameterRangeError(f"the smallest PWM is {self.pwm_min}; must be 0 to {FULL_PWM - 1}")
        if not 0.0 <= self.delay_s <= 0.5:
            raise ParameterRangeError(f"the delay is {self.delay_s} s; must be 0 to 0.5 s")


def host_control_values(robot: Robot, changes: Mapping[str, ParameterValue] | None = None) -> dict[str, float]:
    """Return a complete parameter set: the robot file's, host_control.toml over it, ``changes`` over that."""
    table = parameter_table()
    ours = take_table(str(_DEFAULTS), "parameters", read_toml(_DEFAULTS).get("parameters"))
    values = robot.parameter_values()
    for name, value in {**ours, **(changes or {})}.items():
        values[name] = checked_value(table, name, value)
    return values


def pwm_of(share: float, pwm_min: int) -> int:
    """Return the PWM for a share -1..1 of the full wheel speed; from ``pwm_min`` on the wheels are taken to turn."""
    if abs(share) * FULL_PWM < 0.5:
        return 0
    size = round(pwm_min + (FULL_PWM - pwm_min) * min(abs(share), 1.0))
    return size if share > 0.0 else -size


def share_of(pwm: int, pwm_min: int) -> float:
    """Return the share of the full wheel speed that a PWM stands for, the inverse of :func:`pwm_of`."""
    size = max(0, abs(pwm) - pwm_min) / (FULL_PWM - pwm_min)
    return math.copysign(size, pwm) if size > 0.0 else 0.0


@dataclass(frozen=True)
class Command:
    """What one step decided.

    PWM per motor, wanted wheel speeds [rad/s], and the factor they were cut by (1: not at all). Then estimated pose,
    reference and pose error [m, m, rad].
    """

    pwm: PwmLine
    wheel_rad_s: tuple[float, float, float, float]
    scale: float
    estimate: Pose
    reference: Pose
    error: tuple[float, float, float]


@dataclass
class _Core:
    """The core's structs, alive as long as the controller."""

    config: Any
    ekf: Any = field(default_factory=lambda: ffi.new("omni_pose_ekf_state_t *"))
    control: Any = field(default_factory=lambda: ffi.new("omni_control_state_t *"))
    wheels: Any = field(default_factory=lambda: ffi.new("omni_real_t[]", MOTORS))
    delta: Any = field(default_factory=lambda: ffi.new("omni_real_t[]", MOTORS))
    way: Any = field(default_factory=lambda: ffi.new("omni_twist_t *"))


class HostController:
    """Pose fixes in, PWM out. Times are seconds on one clock; :meth:`step` is to be called every 20 ms.

    Raises CoreError if the robot does not have four wheels or the parameters cannot be used.
    """

    def __init__(
        self, robot: Robot, values: Mapping[str, float], settings: HostControlSettings = HostControlSettings()
    ) -> None:
        if robot.wheels != MOTORS:
            raise CoreError(
                f"{robot.name} has {robot.wheels} wheels; the original four-wheel robot takes PWM for {MOTORS}"
            )
        table = parameter_table()
        self.values = dict(values)
        self.settings = settings
        every = round(PERIOD_S / (lib.OMNI_TICK_US * 1e-6))
        self._core = _Core(robot_config({**values, "CTL_PERIOD": float(every)}, table, 0))
        self._check_controller(robot)
        self._retime()
        limits = self._core.config.limits
        no_load = limits.supply_nominal_V / lib.omni_motor_speed_gain(ffi.addressof(self._core.config, "motor"))
        self.full_speed_rad_s = settings.full_speed_rad_s or no_load
        self.wheel_limit_rad_s = min(float(limits.wheel_rad_s), self.full_speed_rad_s)
        self._core.config.trajectory.wheel_limit_rad_s = self.wheel_limit_rad_s
        self._core.config.trajectory.ff_speed_V_s = limits.supply_nominal_V / self.full_speed_rad_s
        self._sent: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=64)
        self._origin_s: float | None = None
        self._predicted_s = 0.0
        self._last_pose: Pose | None = None
        self._saturated = False
        self.last_fix_s = -math.inf
        self.refusal = ""
        """Why the latest pose was not used; "": it was."""
        self._checks = FixChecks()

    def _check_controller(self, robot: Robot) -> None:
        names = parameter_table()["CTL_MODE"].values or {}
        allowed = [name for name, mode in names.items() if lib.omni_controller_demand(mode) == lib.OMNI_DEMAND_TWIST]
        name = next((name for name, mode in names.items() if mode == self._core.config.controller), "?")
        if name not in allowed:
            raise ParameterRangeError(
                f"CTL_MODE = {name} cannot run on the host for {robot.name}: it needs encoders",
                hint=f"use one of {', '.join(allowed)}",
            )

    def _retime(self) -> None:
        """The core derives its configuration for 1 kHz; noise densities keep their meaning at the longer step."""
        config = self._core.config
        ratio = PERIOD_S / PREDICTIONS / config.step_s
        ekf = config.pose_ekf
        ekf.q_xy, ekf.q_theta, ekf.q_slip = ekf.q_xy * ratio, ekf.q_theta * ratio, ekf.q_slip * ratio
        ekf.step_s = PERIOD_S / PREDICTIONS
        ekf.r_null = 0.0  # commanded speeds are no measurement of slip

    # ---- poses in

    @property
    def located(self) -> bool:
        """Whether a first fix has come."""
        return self._origin_s is not None

    @property
    def pose(self) -> Pose:
        """Estimated pose."""
        pose = self._core.ekf.pose
        return Pose(pose.x, pose.y, pose.theta)

    def _time_us(self, time_s: float) -> int:
        assert self._origin_s is not None
        return _START_US + round((time_s - self._origin_s) * 1e6)

    def fix(self, measured: MocapPose) -> bool:
        """Take a measured pose, late or not; return whether the filter used it. If not, :attr:`refusal` says why."""
        config = ffi.addressof(self._core.config, "pose_ekf")
        if self._origin_s is not None:
            self._predict_until(measured.arrived_s)
        self.refusal = self._checks.refusal(measured, self.pose if self.located else None)
        if self.refusal:
            return False
        if self._origin_s is None:
            pose = ffi.new("omni_pose_t *", tuple(measured.pose))
            sd_xy = measured.sd_xy_m or self.values["EKF_R_XY"]
            sd_theta = measured.sd_theta_rad or self.values["EKF_R_TH"]
            lib.omni_pose_ekf_reset(self._core.ekf, config, pose, sd_xy, sd_theta)
            self._origin_s = self._predicted_s = measured.taken_s
            self._predict(measured.taken_s)
            self.last_fix_s = measured.taken_s
            return True
        fix = ffi.new("omni_pose_fix_t *", {"time_us": max(0, self._time_us(measured.taken_s))})
        fix.pose, fix.sd_xy, fix.sd_theta = tuple(measured.pose), measured.sd_xy_m, measured.sd_theta_rad
        kinematics = ffi.addressof(self._core.config, "kinematics")
        used = bool(lib.omni_pose_ekf_correct(self._core.ekf, config, kinematics, fix) == lib.OMNI_OK)
        if used:
            self.last_fix_s = measured.taken_s
        else:
            self.refusal = "it failed the outlier gate, or is too old"
        return used

    def _predict_until(self, now_s: float) -> None:
        step_s = PERIOD_S / PREDICTIONS
        while self._predicted_s + step_s <= now_s:
            self._predict(self._predicted_s + step_s)

    def _predict(self, time_s: float) -> None:
        speeds = self._speeds_at(0.5 * (self._predicted_s + time_s))
        for wheel, speed in enumerate(speeds):
            self._core.delta[wheel] = speed * (time_s - self._predicted_s)
        config = self._core.config
        self._checks.moved(self._distance())
        lib.omni_pose_ekf_predict(
            self._core.ekf,
            ffi.addressof(config, "pose_ekf"),
            ffi.addressof(config, "kinematics"),
            self._core.delta,
            self._time_us(time_s),
        )
        self._predicted_s = time_s

    def _distance(self) -> float:
        """Return how far [m or rad] ``delta`` moves the robot."""
        way = self._core.way
        lib.omni_kinematics_forward(ffi.addressof(self._core.config, "kinematics"), self._core.delta, ffi.NULL, way)
        return math.hypot(way.vx, way.vy) + abs(float(way.wz))

    def _speeds_at(self, time_s: float) -> Sequence[float]:
        """Wheel speeds [rad/s] that lines sent at least the delay before ``time_s`` ask for."""
        for sent_s, speeds in reversed(self._sent):
            if sent_s + self.settings.delay_s <= time_s:
                return speeds
        return (0.0,) * MOTORS

    def sent(self, pwm: Sequence[int], now_s: float) -> None:
        """Take note of a line that has gone out: the filter predicts with what the robot was told."""
        shares = [share_of(value, self.settings.pwm_min) for value in self._wheel(pwm)]
        self._sent.append((now_s, tuple(share * self.full_speed_rad_s for share in shares)))

    # ---- PWM out

    def plan(self) -> Any:
        """Return the plan of the TRJ_* path from the present pose (``omni_trajectory_t *``). Raises CoreError."""
        return plan_trajectory(self._core.config, ffi.addressof(self._core.ekf, "pose"))

    def step(self, now_s: float, reference: Pose, rate: Twist) -> Command:
        """Return the PWM that drives the pose to ``reference``, which moves with the world twist ``rate``.

        Not before the first fix (:attr:`located`).
        """
        self._predict_until(now_s)
        here = self.pose
        self._control(here, reference, rate)
        config, wheels, demand = self._core.config, self._core.wheels, self._core.control.demand
        body = ffi.addressof(demand, "twist")
        lib.omni_kinematics_inverse(ffi.addressof(config, "kinematics"), body, ffi.NULL, wheels)
        scale = float(lib.omni_saturate_direction(wheels, MOTORS, self.wheel_limit_rad_s))
        self._saturated = scale < 1.0
        self._last_pose = here
        speeds = (wheels[0], wheels[1], wheels[2], wheels[3])
        error = tuple(demand.terms.error)
        return Command(self._pwm(speeds), speeds, scale, here, reference, (error[0], error[1], error[2]))

    def rest(self) -> None:
        """Forget what only makes sense while driving: integrals and the last step's pose."""
        lib.omni_controllers_reset(self._core.control)
        self._last_pose = None
        self._saturated = False

    def _control(self, here: Pose, reference: Pose, rate: Twist) -> None:
        """Step the controller: what it asks for is in ``control.demand``."""
        core = self._core
        pose = ffi.new("omni_pose_t *", tuple(here))
        measured = ffi.new("omni_twist_t *", tuple(self._measured_rate(here)))
        goal = ffi.new("omni_reference_t *", {"pose": tuple(reference), "rate": tuple(rate)})
        lib.omni_controller_step(core.control, core.config, pose, measured, goal, self._saturated)

    def _measured_rate(self, here: Pose) -> Twist:
        """World twist by differencing the estimates of two steps, as the report's PD and PID did with the poses."""
        if self._last_pose is None:
            return Twist(0.0, 0.0, 0.0)
        x, y, theta = (new - old for new, old in zip(here, self._last_pose, strict=True))
        return Twist(x / PERIOD_S, y / PERIOD_S, math.remainder(theta, math.tau) / PERIOD_S)

    def _pwm(self, speeds: Sequence[float]) -> PwmLine:
        if not all(math.isfinite(speed) for speed in speeds):
            return STOP
        shares = [speed / self.full_speed_rad_s for speed in speeds]
        pwm = self._wheel([pwm_of(share, self.settings.pwm_min) for share in shares])
        return pwm[0], pwm[1], pwm[2], pwm[3]

    def _wheel(self, pwm: Sequence[int]) -> list[int]:
        """Turn the sign where a motor is wired so that positive PWM drives the body clockwise; its own inverse."""
        return [value * direction for value, direction in zip(pwm, self._core.config.motor_direction, strict=True)]
