# SPDX-License-Identifier: MIT
"""A log once more through the core's own estimators: wheel filters, then the pose EKF, tick by tick."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from omni_schema import Robot
from omniwheel._core import ffi, lib
from omniwheel.core_config import robot_config
from omniwheel.errors import CoreError, LogError
from omniwheel.logs.alignment import Alignment, covered, truth_at
from omniwheel.logs.calibration import Calibration
from omniwheel.logs.log import Array, WheelLog

NO_MEASUREMENT_SD = 1e3
"""Standard deviation [m, rad] of the part of a pose fix that was not measured."""
MOST_COUNTS = 1_000_000
"""Counts of a wheel in one period: more are no wheel's."""
_LARGEST_STEP = 2.0**31 - 1.0
_START_SD = 1e-3
_START_US = 1_000_000


@dataclass(frozen=True)
class Fixes:
    """Pose fixes in the robot's frame and clock: ``time_s`` (k,), ``xy`` (k, 2) [m], ``sd_m`` (0: the robot file's)."""

    time_s: Array
    xy: Array
    sd_m: float = 0.0


@dataclass(frozen=True)
class Replay:
    """What the core estimated, one row per row of the log.

    ``pose`` (n, 3) and its standard deviations ``pose_sd`` (n, 3) in m, m, rad from the pose zero. ``wheel_rad_s``
    (n, wheels).
    ``innovation`` (n, wheels) of the wheel filters and its predicted variance: NaN where nothing was measured or the
    filter is off. ``nis`` (k,) of the fixes that were looked at, with ``nis_degrees`` of freedom each.
    """

    time_s: Array
    pose: Array
    pose_sd: Array
    wheel_rad_s: Array
    innovation: Array
    innovation_variance: Array
    nis: Array
    nis_degrees: int
    accepted: int
    refused: int


@dataclass(frozen=True)
class DroppedCounts:
    """What dead reckoning made of counts that are no good, and put a filtered speed in the place of.

    ``share`` of the counts per wheel. How far the pose gets from that of every count as it was logged: ``moved_m`` and
    ``turned_rad`` at most over the run.
    """

    share: tuple[float, ...]
    moved_m: float
    turned_rad: float


def replay_config(robot: Robot, period_s: float) -> Any:
    """Return a new ``omni_robot_config_t`` for a log's period; noise densities stay what the robot file says.

    The pose filter's noise levels do not follow the fixes: a replay is to show how far both are apart.
    """
    try:
        config = robot_config(robot.parameter_values(), robot.table, 0)
    except CoreError as error:
        raise LogError(f"{robot.source}: {error}", hint="correct the robot file") from error
    ratio = period_s / float(config.step_s)
    kf, ekf = config.motor_kf, config.pose_ekf
    kf.step_s = ekf.step_s = config.step_s = period_s
    ekf.adapt_rate = ekf.dead_reckoning_noise = 0.0
    for field in ("q_speed", "q_current"):
        setattr(kf, field, getattr(kf, field) * ratio)
    for field in ("q_xy", "q_theta", "q_slip"):
        setattr(ekf, field, getattr(ekf, field) * ratio)
    motor, model = ffi.addressof(config, "motor"), ffi.addressof(kf, "model")
    if lib.omni_motor_discretise(motor, period_s, model) != lib.OMNI_OK:
        raise LogError(f"{robot.source}: the motor cannot be computed in steps of {period_s:g} s")
    return config


def check_log_fits(log: WheelLog, robot: Robot) -> None:
    """Raise LogError if the robot file is another robot's."""
    values = robot.parameter_values()
    if robot.wheels != log.wheels:
        raise LogError(f"{log.name} has {log.wheels} wheels, {robot.source} {robot.wheels}", hint="give its robot file")
    if round(values["ENC_CPR"]) != log.counts_per_revolution:
        raise LogError(
            f"{log.name} has {log.counts_per_revolution} counts per revolution, {robot.source} {values['ENC_CPR']:.0f}",
            hint="correct encoder.counts_per_revolution or the column mapping",
        )
    if not np.all(np.abs(np.where(log.good, log.counts_per_period, 0.0)) <= MOST_COUNTS):
        hint = "import it again; unwrap counters of other than 16 or 32 bits before"
        raise LogError(f"{log.name}: a wheel counts more than {MOST_COUNTS} in one period", hint=hint)


def replay(
    log: WheelLog,
    robot: Robot,
    calibration: Calibration | None = None,
    *,
    use_heading: bool = True,
    fixes: Fixes | None = None,
) -> Replay:
    """Run a log through the estimators of the robot file, from the pose zero.

    The heading, if there is one and it is wanted, comes in as a pose fix whose position was not measured. Without it,
    and in rows where the log's is unknown, a calibration's ``turn_scale`` says the heading first. The path follows on
    that. With fixes it is not used.

    With a calibration the voltages go through the motor's curve and the pose takes the filtered wheel speeds. Without
    one it takes the counts, and the filtered speed where a count is no good, as on the robot. Raises LogError.
    """
    check_log_fits(log, robot)
    engine = _Engine(log, robot, calibration)
    heading = log.heading_rad if use_heading else np.full(len(log.time_s), np.nan)
    ignores = engine.config.pose_ekf.mode == lib.OMNI_EKF_MODE_ODOMETRY
    turning = None if calibration is None or ignores or fixes is not None else calibration.for_turning()
    if turning is not None and not np.all(np.isfinite(heading)):
        heading = filled(heading, replay(log, robot, turning, use_heading=False).pose[:, 2])
    if ignores and (fixes is not None or np.any(np.isfinite(heading))):
        hint = "set EKF_MODE = 1 under [parameters], or leave the heading (--no-heading) and the fixes out"
        raise LogError(f"{robot.source}: EKF_MODE odometry uses no heading and no fixes", hint=hint)
    due = _rows_of_fixes(log, fixes)
    rows = len(log.time_s)
    pose, sd = np.zeros((rows, 3)), np.zeros((rows, 3))
    speed = np.zeros((rows, log.wheels))
    innovation, variance = np.full((2, rows, log.wheels), np.nan)
    nis = []
    for row in range(rows):
        speed[row] = engine.filter(row, innovation[row], variance[row])
        engine.move(row, speed[row])
        index = due.get(row)
        if fixes is not None and index is not None:
            nis.append(engine.correct(heading[row], fixes.xy[index], fixes.sd_m))
        elif np.isfinite(heading[row]):
            engine.correct(heading[row], None, 0.0)
        pose[row], sd[row] = engine.pose()
    pose[:, 2] = np.unwrap(pose[:, 2])
    return Replay(
        time_s=log.time_s,
        pose=pose,
        pose_sd=sd,
        wheel_rad_s=speed,
        innovation=innovation,
        innovation_variance=variance,
        nis=np.array(nis),
        nis_degrees=3 if use_heading and log.has_heading else 2,
        accepted=int(engine.ekf.accepted),
        refused=int(engine.ekf.refused),
    )


def dropped_counts(
    log: WheelLog, run: Replay, robot: Robot, calibration: Calibration | None = None, *, use_heading: bool = True
) -> DroppedCounts | None:
    """Compare the replay ``run`` of a log with one that uses every count. None if all are good. Raises LogError."""
    if log.good.all():
        return None
    whole = replace(log, good=np.ones_like(log.good))
    apart = np.abs(run.pose - replay(whole, robot, calibration, use_heading=use_heading).pose)
    share = tuple(float(value) for value in 1.0 - log.good.mean(axis=0))
    return DroppedCounts(share, float(np.max(np.hypot(apart[:, 0], apart[:, 1]))), float(np.max(apart[:, 2])))


def require_curve(log: WheelLog, calibration: Calibration | None) -> None:
    """Raise LogError unless wheel speeds can be had from the log's duties alone: they need the motors' curve."""
    if calibration is None:
        hint = "omni identify logs writes one beside the robot file; or give it with --calibration"
        raise LogError(f"{log.name}: without counts a calibration with the motors' curve is needed", hint=hint)
    if not np.any(log.duty):
        raise LogError(f"{log.name} has no duty columns", hint="map its columns ([duty] in the mapping)")


def filter_wheels(log: WheelLog, robot: Robot, calibration: Calibration | None = None) -> tuple[Array, Array, Array]:
    """Run the wheel filters alone: speeds, innovations and their variances as in :class:`Replay`. Raises LogError."""
    check_log_fits(log, robot)
    engine = _Engine(log, robot, calibration)
    innovation, variance = np.full((2, *log.counts.shape), np.nan)
    speed = np.array([engine.filter(row, innovation[row], variance[row]) for row in range(len(log.time_s))])
    return speed, innovation, variance


def fixes_from_truth(log: WheelLog, alignment: Alignment, rate_Hz: float, sd_m: float = 0.0) -> Fixes:
    """Return the truth's positions in the robot's frame and clock, ``rate_Hz`` of them per second."""
    truth = log.require_truth()
    time = np.arange(log.time_s[0], log.time_s[-1], 1.0 / rate_Hz)
    time = time[covered(truth, time + alignment.offset_s)]
    return Fixes(time, alignment.to_robot(truth_at(truth, time + alignment.offset_s)), sd_m)


def _rows_of_fixes(log: WheelLog, fixes: Fixes | None) -> dict[int, int]:
    """First row at or after each fix -> index of the fix; the later one where two meet."""
    if fixes is None:
        return {}
    rows = np.searchsorted(log.time_s, fixes.time_s - 1e-9)
    return {int(row): index for index, row in enumerate(rows) if row < len(log.time_s)}


def filled(heading: Array, wheels: Array) -> Array:
    """Return a heading (n,) whose unknown rows go on, from the row before, as the ``wheels`` turn (n,)."""
    known = np.isfinite(heading)
    if not known.any():
        return wheels
    latest = np.maximum.accumulate(np.where(known, np.arange(len(heading)), -1))
    latest[latest < 0] = int(np.argmax(known))
    return np.asarray(np.where(known, heading, heading[latest] + wheels - wheels[latest]))


class _Engine:
    """The estimator states of one replay and what they are fed with."""

    def __init__(self, log: WheelLog, robot: Robot, calibration: Calibration | None) -> None:
        self.config = replay_config(robot, log.period_s)
        self.calibration = calibration
        self.log = log
        self.filters = [ffi.new("omni_motor_kf_state_t *") for _ in range(log.wheels)]
        for state in self.filters:
            lib.omni_motor_kf_reset(state, ffi.addressof(self.config, "motor_kf"))
        self.ekf = ffi.new("omni_pose_ekf_state_t *")
        start = ffi.new("omni_pose_t *")
        lib.omni_pose_ekf_reset(self.ekf, ffi.addressof(self.config, "pose_ekf"), start, _START_SD, _START_SD)
        self.fix = ffi.new("omni_pose_fix_t *")
        self.turned = ffi.new("omni_real_t[]", lib.OMNI_MAX_WHEELS)
        self.sampled = log.sample_s > 0.0
        self._measurement(robot)
        self.missed = np.zeros(log.wheels)
        self.counted = log.counts_per_period
        self.steps = np.maximum(np.round(log.step_s / log.period_s), 1.0)
        self.voltage = self._voltages(robot.parameter_values()["BAT_V_NOM"])
        self.time_us = _START_US + np.round(1e6 * (log.time_s - log.time_s[0])).astype(np.int64)

    def _measurement(self, robot: Robot) -> None:
        """Tell the wheel filters what a count of this log is, and its noise where the log says it."""
        kf = ffi.addressof(self.config, "motor_kf")
        if self.sampled:
            if kf.mode == lib.OMNI_KF_MODE_ANGLE:
                problem = (
                    f"{robot.source}: KF_MODE angle needs counts that add up to an angle, unlike those of "
                    f"{self.log.name}"
                )
                raise LogError(problem, hint="set KF_MODE = 1 (speed) under [parameters]: each count is a speed")
            # One count in a sample is the speed of so many in a period.
            kf.rad_per_count *= self.log.period_s / self.log.sample_s
        if self.log.noise_rad_s > 0.0:
            kf.r_speed = self.log.noise_rad_s**2

    def _voltages(self, supply_V: float) -> Array:
        """Voltage since the row before (n, wheels) [V]; calibrated: of a linear motor as fast as the real one."""
        if self.calibration is None:
            voltage = self.log.duty * supply_V
        else:
            gain = lib.omni_motor_speed_gain(ffi.addressof(self.config, "motor"))
            voltage = gain * self.calibration.curve.speed(self.log.duty)
        return np.concatenate((np.zeros((1, self.log.wheels)), voltage[:-1]))

    def filter(self, row: int, innovation: Array, variance: Array) -> Array:
        """Wheel filters of one row; fills their innovations and returns the wheel speeds [rad/s]."""
        kf = ffi.addressof(self.config, "motor_kf")
        steps, counts, good = self.steps[row], self.log.counts[row], self.log.good[row]
        per_step = counts if self.sampled else counts / steps
        speeds = np.zeros(self.log.wheels)
        for wheel, state in enumerate(self.filters):
            voltage = float(self.voltage[row, wheel])
            for _ in range(int(steps) - 1):
                lib.omni_motor_kf_step(state, kf, voltage, 0, False)
            self.missed[wheel] += steps - 1.0
            # Rows whose count was no good are taken to have turned like this one.
            delta = float(per_step[wheel] * (self.missed[wheel] + 1.0))
            delta = max(-_LARGEST_STEP, min(_LARGEST_STEP, delta))  # a count that is no good may be any
            speeds[wheel] = lib.omni_motor_kf_step(state, kf, voltage, round(delta), bool(good[wheel]))
            self.missed[wheel] = 0.0 if good[wheel] else self.missed[wheel] + 1.0
            if good[wheel] and kf.mode != lib.OMNI_KF_MODE_OFF:
                innovation[wheel], variance[wheel] = state.innovation, state.innovation_variance
        return speeds

    def move(self, row: int, speeds: Array) -> None:
        """Pose EKF of one row of motion."""
        turned = speeds * self.log.period_s * self.steps[row]
        if self.calibration is None:
            counted = self.counted[row] * self.log.rad_per_count * self.steps[row]
            turned = np.where(self.log.good[row], counted, turned)
        else:
            turned = self.calibration.rolled(turned)
        self.turned[0 : self.log.wheels] = list(turned)
        lib.omni_pose_ekf_predict(
            self.ekf,
            ffi.addressof(self.config, "pose_ekf"),
            ffi.addressof(self.config, "kinematics"),
            self.turned,
            int(self.time_us[row]),
        )

    def correct(self, heading: float, xy: Array | None, sd_m: float) -> float:
        """Use a measured heading (NaN: none) and position (None: none) taken now; return the NIS."""
        fix, known = self.fix, np.isfinite(heading)
        fix.time_us = self.ekf.time_us
        fix.pose = self.ekf.pose
        fix.sd_xy = NO_MEASUREMENT_SD
        if xy is not None:
            fix.pose.x, fix.pose.y = float(xy[0]), float(xy[1])
            fix.sd_xy = sd_m
        fix.sd_theta = 0.0 if known else NO_MEASUREMENT_SD
        if known:
            fix.pose.theta = float(np.arctan2(np.sin(heading), np.cos(heading)))
        lib.omni_pose_ekf_correct(
            self.ekf, ffi.addressof(self.config, "pose_ekf"), ffi.addressof(self.config, "kinematics"), fix
        )
        return float(self.ekf.nis)

    def pose(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return pose and standard deviations now."""
        lib.omni_pose_ekf_propagate_covariance(
            self.ekf, ffi.addressof(self.config, "pose_ekf"), ffi.addressof(self.config, "kinematics")
        )
        pose, p = self.ekf.pose, self.ekf.p
        return (pose.x, pose.y, pose.theta), (p[0][0] ** 0.5, p[1][1] ** 0.5, p[2][2] ** 0.5)
