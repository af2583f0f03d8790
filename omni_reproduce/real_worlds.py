# SPDX-License-Identifier: MIT
"""Real logs beside both simulated worlds: how much of what logs show is explained by the rollers of real wheels.

The duties of each log are played to our world and to MuJoCo, open loop, with one robot file. Nothing is fitted to what
a world gives. What that robot would have logged is then compared with the log. Accelerometer, turn rate and wheel
speeds are told by their RMS, and in bands about the orders at which rollers pass. The last figure is how far dead
reckoning goes astray.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.scenario import Scenario, load_scenario
from omni_reproduce import real_logs, ripple
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.played_logs import MujocoRobot, OurRobot, Signals, logged, play
from omni_reproduce.real_measured import (
    ACCELEROMETER,
    HEADED,
    MUJOCO,
    NAME,
    ROBOT,
    UNITS,
    WHEELS_ONLY,
    Compared,
    Measured,
    measured,
    notes,
    rows,
)
from omniwheel.errors import LogError
from omniwheel.identification.log_study import LogStudy, identify_from_logs
from omniwheel.identification.motor_curve import fit_motor_curve, lagged
from omniwheel.identification.odometry_calibration import dead_reckon
from omniwheel.logs.calibration import MotorCurve
from omniwheel.logs.importer import read_columns
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import read_mapping
from omniwheel.robots import read_robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Job:
    """One world with one seed, and the logs whose duties it gets."""

    world: str
    seed: int
    logs: tuple[WheelLog, ...]
    curve: MotorCurve


def run(context: Context) -> Result:
    """Compare; without logs, or without MuJoCo, a row says what is missing."""
    spec, settings = read_spec(NAME), read_spec(real_logs.NAME)["experiment"]
    folder = real_logs.data_folder(read_spec(real_logs.NAME), context.data)
    paths = [path for path in sorted(folder.glob(settings["runs"])) if real_logs.truth_path(path).is_file()]
    if len(paths) < 2:
        missing = (
            f"Not run: {len(paths)} runs with truth in {folder}; two are needed. Set {settings['folder_variable']} to "
            f"the folder that holds {settings['runs']} and the truth*.csv of each."
        )
        return Result(
            (Row(NAME, "not run", f"{ACCELEROMETER}, ripple", UNITS[ACCELEROMETER], None, explanation=missing),)
        )
    head, robot = spec["experiment"], read_robot(real_logs.ROBOT_FOLDER / "robot.toml")
    paths = paths[: settings["quick_runs"]] if context.quick else paths
    runs, air_paths = real_logs.read_logs(paths), sorted(folder.glob(settings["lifted"]))
    study = identify_from_logs(runs, robot, real_logs.read_logs(sorted(folder.glob(settings["turns"]))))
    curve = study.whole.curve.curve
    real = of_logs(head, runs, paths, curve, drift_of_study(study))
    air = lifted(head, air_paths)
    wanted = [name for name in spec["world"] if name in head["quick_worlds"] or not context.quick]
    worlds = [name for name in wanted if not name.startswith(MUJOCO) or find_spec("mujoco")]
    seeds = head["quick_seeds" if context.quick else "seeds"]
    jobs = [Job(name, seed, tuple(runs), curve) for name in worlds for seed in seeds]
    answers = context.map(in_world, jobs)
    found = {name: [answer for job, answer in zip(jobs, answers, strict=True) if job.world == name] for name in worlds}
    compared = Compared(tuple(log.name for log in runs), real, air, found)
    return Result(rows(compared), (), notes(head, compared))


def in_world(job: Job) -> Measured:
    """Play every log to a world and measure what it would have logged."""
    spec = read_spec(NAME)
    head, scenario = spec["experiment"], scenario_of(spec, job.world, job.seed)
    kind = MujocoRobot if job.world.startswith(MUJOCO) else OurRobot
    constant = float(scenario.robot.motor["constant_N_m_A"])
    lead = round(head["lead_s"] / job.logs[0].period_s)
    signals, drift = [], []
    for log in job.logs:
        volts = constant * job.curve.speed(log.duty)
        all_ticks = play(kind(scenario), np.concatenate((np.zeros((lead, log.wheels)), volts)), log.period_s)
        played = all_ticks.after(lead * log.period_s)
        counted, shown = logged(played, log, head["heading_step_rad"])
        ticks = len(played.acceleration) // len(volts)
        speed = np.diff(played.angle[::ticks], axis=0) / log.period_s
        pieces = ripple.pieces_of(speed, log.period_s, head["piece_s"], head["least_rad_s"])
        signals.append(replace(shown, pieces=tuple(pieces)))
        drift.append(drift_of(counted))
    return measured(head, signals, {name: tuple(each[name] for each in drift) for name in (HEADED, WHEELS_ONLY)})


def scenario_of(spec: Mapping[str, Any], world: str, seed: int) -> Scenario:
    """Return a world of the experiment: a level floor without imposed slip."""
    base = load_scenario("no_slip", str(ROBOT)).with_world({"slip_max": 0.0, **spec["world"][world]})
    return replace(base, start_pose=(0.0, 0.0, 0.0)).with_seed(seed)


def drift_of(log: WheelLog) -> dict[str, float]:
    """Return how far dead reckoning of a world's log is from where that robot was [m, RMS], as for the real logs."""
    robot = read_robot(real_logs.ROBOT_FOLDER / "robot.toml")
    return {
        name: dead_reckon(log, robot, None, use_heading=headed)[1].rms_m
        for name, headed in ((HEADED, True), (WHEELS_ONLY, False))
    }


def real_signals(head: Mapping[str, Any], log: WheelLog, path: Path, curve: MotorCurve) -> Signals:
    """Return what a real log shows; in place of a wrong count stands what the motors' curve says. Raises LogError."""
    mapping = read_mapping(real_logs.ROBOT_FOLDER / "mapping.toml")
    columns = read_columns(path, mapping.delimiter)
    missing = [name for name in head["imu"] if name not in columns]
    if missing:
        raise LogError(f"{path} has no column {missing[0]!r}", hint="the accelerometer's two columns are needed")
    kept = np.searchsorted(np.maximum.accumulate(columns[mapping.time] * mapping.time_unit), log.time_s)
    model = curve_speed(log, curve)
    rate = np.concatenate(([0.0], np.diff(log.heading_rad))) / log.period_s
    pieces = ripple.pieces_of(model, log.period_s, head["piece_s"], head["least_rad_s"])
    return Signals(
        period_s=log.period_s,
        acceleration=np.stack([columns[name][kept] for name in head["imu"]], axis=1),
        turn_rate=np.nan_to_num(rate),
        wheel_rad_s=np.where(log.good, log.wheel_rad_s, model),
        pieces=tuple(whole(log, pieces)),
    )


def whole(log: WheelLog, pieces: Sequence[ripple.Piece]) -> list[ripple.Piece]:
    """Return the pieces without missing rows and without rows in which the IMU was frozen."""
    bad = log.step_s > 1.5 * log.period_s
    if log.has_heading:
        bad = bad | ~np.isfinite(log.heading_rad)
    return [piece for piece in pieces if not bad[piece.rows].any()]


def curve_speed(log: WheelLog, curve: MotorCurve) -> Array:
    """Return the wheel speeds (n, wheels) [rad/s] that the duties say."""
    steady = curve.speed(log.duty)
    lags = [lagged(steady[:, w], float(curve.time_constant_s[w]), log.period_s) for w in range(log.wheels)]
    return np.stack(lags, axis=1)


def of_logs(
    head: Mapping[str, Any],
    logs: Sequence[WheelLog],
    paths: Sequence[Path],
    curve: MotorCurve,
    drift_m: Mapping[str, tuple[float, ...]] | None = None,
) -> Measured:
    """Return the figures of real logs, whose files are needed for the accelerometer."""
    signals = [real_signals(head, log, path, curve) for log, path in zip(logs, paths, strict=True)]
    return measured(head, signals, drift_m)


def lifted(head: Mapping[str, Any], paths: Sequence[Path]) -> Measured | None:
    """Return what the logs with the wheels in the air show; None if there are none."""
    logs = real_logs.read_logs(paths)
    return of_logs(head, logs, paths, fit_motor_curve(logs).curve) if logs else None


def drift_of_study(study: LogStudy) -> dict[str, tuple[float, ...]]:
    """Return how far dead reckoning of each real run is off, with what the other runs say [m, RMS]."""
    return {
        HEADED: tuple(run.held_out.alignment.rms_m for run in study.scored),
        WHEELS_ONLY: tuple(run.held_out_wheels_only.alignment.rms_m for run in study.scored),
    }
