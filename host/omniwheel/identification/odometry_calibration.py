# SPDX-License-Identifier: MIT
"""Odometry of a robot from runs beside a ground truth whose clock, frame and scale are its own.

With the heading measured, the path is linear in the effective radius of each wheel and direction:
x(t) = sum_j r_j g_j(t). In it, g_j is the path that wheel j's turning in one direction would add at r_j = 1 m. Clock
offset, rotation and shift of each run are found by alignment, then the radii by least squares over all runs. This goes
on in turn until nothing changes (``path_fit``).

The radii by wheel and direction take in whatever is repeatable in the runs, a camera's perspective too. They are right
for the path on a measured heading. As a heading of their own they are not. How the wheels turn the body is therefore
fitted to the measured headings, which no camera touches. Without a measured heading, and while its sensor is frozen,
that says the heading, and the radii by direction the path on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from omni_schema import Robot
from omniwheel._core import lib
from omniwheel.errors import LogError
from omniwheel.identification.motor_curve import CurveFit, fit_motor_curve
from omniwheel.identification.path_fit import (
    LEAST_TURN_RAD,
    TURN_WINDOW_S,
    Rolled,
    Settings,
    choose_ridge,
    choose_turning,
    fit_radii,
    fit_turning,
    path_basis,
    turned,
)
from omniwheel.logs.alignment import Alignment, align
from omniwheel.logs.calibration import Calibration, MotorCurve
from omniwheel.logs.log import Array, WheelLog
from omniwheel.replay import Replay, check_log_fits, filled, filter_wheels, replay, replay_config

SCALE_LIMITS = (0.8, 1.2)
"""What a robot file allows as a wheel's scale; the rest goes to the calibration."""
ASSUMED_RESISTANCE_OHM = 2.0
ASSUMED_INDUCTANCE_H = 1e-3
NOISE_CANDIDATES = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Process noise of the wheel filter that is tried [rad/s^1.5]; the likelihood has one maximum."""


@dataclass(frozen=True)
class Odometry:
    """One identification: radii (wheels,) [m] by direction, wheel distance [m], the motors' curve, filter noise.

    ``robot`` and ``calibration`` hold the same for the core: together they are what a replay needs. ``plain_radius_m``
    is the one radius for all. ``settings`` were chosen among these runs alone.
    """

    forward_radius_m: Array
    reverse_radius_m: Array
    wheel_distance_m: float
    distance_seen: bool
    curve: CurveFit
    process_noise: float
    measurement_noise: float
    robot: Robot
    calibration: Calibration
    plain_radius_m: float
    settings: Settings


@dataclass(frozen=True)
class _Paths:
    """What one filter makes of all logs: speeds, angles, turning, and each run's path basis; the settings chosen."""

    speeds: list[Array]
    turning: Array | None
    bases: list[Array]
    mirrored: list[bool]
    settings: Settings
    error_m: float


def identify_odometry(runs: Sequence[WheelLog], robot: Robot, turns: Sequence[WheelLog] = ()) -> Odometry:
    """Identify from runs with truth and heading; ``turns`` are logs with heading only, for the wheel distance.

    ``robot`` gives the nominal geometry. Raises LogError that says what is missing.
    """
    if not runs:
        raise LogError("no run with ground truth", hint="give logs that were imported with --truth")
    for log in (*runs, *turns):
        check_log_fits(log, robot)
        log.require_heading()
    curve = fit_motor_curve(runs)
    filtered = _with_motor(robot, curve)
    unit = Calibration(np.ones(robot.wheels), np.ones(robot.wheels), curve.curve)
    process, measurement = _filter_noise(runs, filtered, unit, curve)
    inverse = body_from_wheels(robot)
    logs = (*runs, *turns)
    tried = {
        q: _paths(logs, len(runs), _with(filtered, KF_Q_W=q, KF_R_W=measurement), unit, inverse, q == process)
        for q in {process: None, NOISE_CANDIDATES[0]: None}
    }
    process = min(tried, key=lambda q: tried[q].error_m)
    paths = tried[process]
    filtered = _with(filtered, KF_Q_W=process, KF_R_W=measurement)
    start = np.full(2 * robot.wheels, robot.parameter_values()["WHEEL_RADIUS"])
    radii, plain = (
        fit_radii(runs, paths.bases, paths.mirrored, start, ridge) for ridge in (paths.settings.ridge, None)
    )
    distances = [_wheel_distance(logs, paths.speeds, inverse, each) for each in (radii, plain)]
    nominal_m = robot.parameter_values()["WHEEL_DIST"]
    known = [nominal_m if distance is None else distance for distance in distances]
    turning = plain / known[1] if paths.turning is None else paths.turning
    identified, calibration = _packed(filtered, radii, known[0], curve.curve, turning * known[0])
    return Odometry(
        forward_radius_m=radii[: robot.wheels],
        reverse_radius_m=radii[robot.wheels :],
        wheel_distance_m=known[0],
        distance_seen=distances[0] is not None,
        curve=curve,
        process_noise=process,
        measurement_noise=measurement,
        robot=identified,
        calibration=calibration,
        plain_radius_m=float(plain[0]),
        settings=paths.settings,
    )


def _paths(
    logs: Sequence[WheelLog], runs: int, robot: Robot, unit: Calibration, inverse: Array, counts: bool
) -> _Paths:
    """Filter all logs, of which the first ``runs`` have a truth, and choose the settings for what comes out."""
    speeds = [filter_wheels(log, robot, unit)[0] for log in logs]
    rolled = [Rolled(log, _by_direction(log, speed)) for log, speed in zip(logs, speeds, strict=True)]
    turn_ridge = choose_turning(rolled[:runs], rolled[runs:], inverse)
    gains = fit_turning(rolled, inverse, turn_ridge)
    values = robot.parameter_values()
    usual = np.full(2 * robot.wheels, values["WHEEL_RADIUS"] / values["WHEEL_DIST"])
    turns = [turned(each, inverse, usual if gains is None else gains) for each in rolled[:runs]]
    headings = [filled(log.heading_rad, turn) for log, turn in zip(logs, turns, strict=False)]
    bases = [path_basis(each, inverse, heading) for each, heading in zip(rolled, headings, strict=False)]
    start = np.full(2 * robot.wheels, values["WHEEL_RADIUS"])
    mirrored = [
        align(log.time_s, basis @ start, log.require_truth(), mirrored=None).mirrored
        for log, basis in zip(logs, bases, strict=False)
    ]
    ridge, error_m = choose_ridge(logs[:runs], bases, mirrored, start)
    return _Paths(speeds, gains, bases, mirrored, Settings(ridge, turn_ridge, counts), error_m)


def dead_reckon(
    log: WheelLog, robot: Robot, calibration: Calibration | None, *, use_heading: bool = True
) -> tuple[Replay, Alignment]:
    """Replay a run without fixes and align its path with the truth."""
    run = replay(log, robot, calibration, use_heading=use_heading)
    return run, align(run.time_s, run.pose[:, :2], log.require_truth(), mirrored=None)


def nominal_replay(log: WheelLog, robot: Robot) -> tuple[Replay, Alignment]:
    """Dead-reckon with the nominal geometry and every count as it was logged, spikes included."""
    return dead_reckon(replace(log, good=np.ones_like(log.good)), robot, None)


def body_from_wheels(robot: Robot) -> Array:
    """B+ (3, wheels) of the robot's bearings at wheel distance 1 m, from the core."""
    config = replay_config(_with(robot, WHEEL_DIST=1.0), 1e-2)
    rows = config.kinematics.b_pinv
    return np.array([[rows[axis][wheel] for wheel in range(robot.wheels)] for axis in range(3)])


def _by_direction(log: WheelLog, speed: Array) -> Array:
    """Wheel angles since the row before (n, 2 wheels) [rad], forward turning first."""
    angle = speed * _span_s(log)
    return np.concatenate((np.maximum(angle, 0.0), np.minimum(angle, 0.0)), axis=1)


def _span_s(log: WheelLog) -> Array:
    """Time that each row stands for (n, 1) [s]: whole periods."""
    return (log.period_s * np.maximum(np.round(log.step_s / log.period_s), 1.0))[:, None]


def _with(robot: Robot, **values: float) -> Robot:
    return replace(robot, overrides={**robot.overrides, **values})


def _with_motor(robot: Robot, fit: CurveFit) -> Robot:
    """Robot whose motor has the curve's mean slope and lag. R and L are assumed: only K (b = 0) and R J show."""
    curve = fit.curve
    slope = float(np.mean((curve.forward_duty_per_rad_s, curve.reverse_duty_per_rad_s)))
    constant = slope * robot.parameter_values()["BAT_V_NOM"]
    inertia = float(np.mean(curve.time_constant_s)) * constant**2 / ASSUMED_RESISTANCE_OHM
    return _with(
        robot,
        MOT_J=inertia,
        MOT_B=0.0,
        MOT_K=constant,
        MOT_R=ASSUMED_RESISTANCE_OHM,
        MOT_L=ASSUMED_INDUCTANCE_H,
        KF_MODE=float(lib.OMNI_KF_MODE_SPEED),
        KF_Q_I=0.0,
        KF_R_W=float(np.sqrt(np.mean(fit.noise_rad_s**2))),
    )


def _filter_noise(
    runs: Sequence[WheelLog], robot: Robot, calibration: Calibration, fit: CurveFit
) -> tuple[float, float]:
    """Process and measurement noise of the wheel filter with the largest likelihood of the innovations.

    The measurement's is what the logs say of a count, else what the motors' curves leave unexplained.
    """
    said = np.array([log.noise_rad_s for log in runs])
    measurement = float(np.sqrt(np.mean((said if np.all(said > 0.0) else fit.noise_rad_s) ** 2)))
    best, best_cost = NOISE_CANDIDATES[0], np.inf
    for candidate in NOISE_CANDIDATES:
        cost = 0.0
        for log in runs:
            tried = _with(robot, KF_Q_W=candidate, KF_R_W=measurement)
            _, innovation, variance = filter_wheels(log, tried, calibration)
            cost += float(np.nansum(np.log(variance) + innovation**2 / variance))
        if cost >= best_cost:
            break
        best, best_cost = candidate, cost
    return best, measurement


def _wheel_distance(logs: Sequence[WheelLog], filtered: Sequence[Array], inverse: Array, radii: Array) -> float | None:
    """Distance [m] at which the wheels' common turning is the measured heading's; None if the robot hardly turned.

    Raises LogError if the two contradict each other.

    From the counts (the filtered speeds where a count is no good). In turns the load is another one than in the runs
    that the filter's motor model comes from. It is a ratio of sums over the windows in which the robot did turn. So
    the noise of the counts averages out instead of shrinking the slope.
    """
    wheels, heading = 0.0, 0.0
    for log, speed in zip(logs, filtered, strict=True):
        rows = max(2, round(TURN_WINDOW_S / log.period_s))
        counted = np.where(log.good, log.wheel_rad_s, speed) * _span_s(log)
        radius = np.where(speed >= 0.0, radii[: log.wheels], radii[log.wheels :])
        rolled = np.cumsum((radius * counted) @ inverse[2])
        starts = np.arange(0, len(log.time_s) - rows, rows)
        turn = log.heading_rad[starts + rows] - log.heading_rad[starts]
        roll = rolled[starts + rows] - rolled[starts]
        sure = np.abs(turn) >= LEAST_TURN_RAD
        wheels += float(np.sum(np.sign(turn[sure]) * roll[sure]))
        heading += float(np.sum(np.abs(turn[sure])))
    if heading < 2.0 * LEAST_TURN_RAD:
        return None
    if wheels <= 0.0:
        raise LogError(
            "the wheels turn against the measured heading",
            hint="correct the sign of the heading or of the wheels in the column mapping",
        )
    return wheels / heading


def _packed(
    robot: Robot, radii: Array, distance_m: float, curve: MotorCurve, turning_m: Array
) -> tuple[Robot, Calibration]:
    """Put the radii (forward, then reverse) into robot (per wheel) and calibration (what is left, by direction).

    ``turning_m`` (2 wheels,) are the radii that turn the robot right with this ``distance_m``.
    """
    wheels = robot.wheels
    forward, reverse = radii[:wheels], radii[wheels:]
    radius = float(np.mean(radii))
    scale = np.clip(0.5 * (forward + reverse) / radius, *SCALE_LIMITS)
    values = {f"W{wheel + 1}_RSCALE": float(value) for wheel, value in enumerate(scale)}
    packed = _with(robot, WHEEL_RADIUS=radius, WHEEL_DIST=distance_m, **values)
    file_m = radius * scale
    turns = turning_m[:wheels] / file_m, turning_m[wheels:] / file_m
    return packed, Calibration(forward / file_m, reverse / file_m, curve, *turns)
