# SPDX-License-Identifier: MIT
"""Logs by what they are: imported logs, CSV with a mapping, this project's run folders and telemetry logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from omni_schema import Robot
from omniwheel.dialect import Message
from omniwheel.errors import LogError
from omniwheel.frames import flip
from omniwheel.identification.sources import from_messages, read_part
from omniwheel.limits import LOG_KINDS
from omniwheel.logs.importer import import_log, read_truth
from omniwheel.logs.log import MIN_ROWS, Array, Truth, WheelLog, load_log
from omniwheel.logs.mapping import read_mapping
from omniwheel.logs.rosbag import is_bag
from omniwheel.logs.run_folder import DRIVE_TLOG, SUMMARY_FILE, load_run
from omniwheel.pose_jumps import geometry_of, jumps_of, steps_of, without_jumps
from omniwheel.tlog_reader import ENDINGS as TELEMETRY_ENDINGS


def open_log(
    path: Path, robot: Robot, mapping: Path | None = None, truth: Path | None = None, part: int | None = None
) -> WheelLog:
    """Read a log of any kind; ``robot`` says what our own formats leave out, ``part`` which one of a telemetry log.

    A ``truth`` file replaces the poses in the log. Raises LogError, SchemaError, DatasetError.
    """
    if (path / DRIVE_TLOG).is_file() and not (path / SUMMARY_FILE).is_file():
        path = path / DRIVE_TLOG
    if part is not None and path.exists() and path.suffix not in TELEMETRY_ENDINGS:
        raise LogError(f"{path} has no parts", hint="leave --part out: it chooses a part of a telemetry log (.tlog)")
    if not path.exists():
        raise LogError(f"{path} does not exist", hint=f"a log is {LOG_KINDS}")
    columns = None if mapping is None else read_mapping(mapping)
    log = _own_log(path, robot, part)
    if log is not None:
        return log if truth is None else replace(log, truth=read_truth(truth, columns)[0])
    if columns is None:
        kind = "a ROS bag" if is_bag(path) else "a CSV file"
        raise LogError(f"{path}: {kind} needs a column mapping", hint=f"give --mapping FILE; a log is {LOG_KINDS}")
    return import_log(path, columns, truth)[0]


def _own_log(path: Path, robot: Robot, part: int | None) -> WheelLog | None:
    """Read a log of one of this project's formats; None if it is of another."""
    if is_bag(path):
        return None
    if path.is_dir():
        return read_run(path)
    if path.suffix in TELEMETRY_ENDINGS:
        return read_tlog(path, robot, part)
    return load_log(path) if path.suffix == ".npz" else None


def read_run(folder: Path) -> WheelLog:
    """Read the record of a run in the simulated world: true wheel angles in counts, true poses as truth."""
    try:
        summary, samples = load_run(folder)
        parameters = summary["parameters"]
        wheels, counts_per_revolution = round(parameters["WHEELS"]), round(parameters["ENC_CPR"])
        time = np.asarray(samples["time_s"], dtype=np.float64)
        direction = _directions(parameters, wheels)
        supply = samples["supply_V"] / parameters["BAT_V_NOM"]
        duty = samples["duty"][:, :wheels] * direction * supply[:, None]
        speed = samples["wheel_rad_s"][:, :wheels]
        pose = samples["truth"]
    except (OSError, ValueError, KeyError, TypeError, IndexError, OverflowError) as error:
        hint = "give the folder of a run, as printed by omni run"
        raise LogError(f"{folder} is not a run: {error}", hint=hint) from error
    truth = Truth(time, np.array(pose[:, :2]), np.unwrap(pose[:, 2]), same_clock=True)
    return _from_speeds(folder.name, counts_per_revolution, time, speed, duty, truth)


def read_tlog(path: Path, robot: Robot, part: int | None = None) -> WheelLog:
    """Read a telemetry log: counts and voltages of OMNI_SAMPLE, else the speeds and duties of OMNI_WHEELS.

    Truth are the pose fixes with the robot's time, else the robot's own estimate (OMNI_TRACKING), which goes on from
    where it was if it jumps. Of a log with a
    restart in it this ``part`` is read, else the longest one, as the log's name then says. Raises LogError,
    DatasetError.
    """
    messages, note = read_part(path, part)
    name = f"{path.stem} ({note})" if note else path.stem
    truth = _fixes(messages) or _estimates(messages, robot)
    if any(message.get_type() == "OMNI_SAMPLE" for message in messages):
        return _from_samples(name, messages, robot, truth)
    wheels = {m.time_boot_ms: m for m in messages if m.get_type() == "OMNI_WHEELS"}
    if len(wheels) < MIN_ROWS:
        hint = "record with OMNI_SAMPLE (omni identify live --log) or OMNI_WHEELS (omni params set SR1_WHEELS=50)"
        raise LogError(f"{path} holds {len(wheels)} OMNI_WHEELS; at least {MIN_ROWS} are needed", hint=hint)
    rows = [wheels[time] for time in sorted(wheels)]
    values = robot.parameter_values()
    duty = np.array([row.duty for row in rows])[:, : robot.wheels] * _directions(values, robot.wheels)
    speed = np.array([row.speed for row in rows])[:, : robot.wheels]
    return _from_speeds(name, round(values["ENC_CPR"]), 1e-3 * np.array(sorted(wheels)), speed, duty, truth)


def _directions(values: Mapping[str, float], wheels: int) -> Array:
    return np.array([values[f"W{wheel + 1}_MOT_DIR"] for wheel in range(wheels)])


def _from_samples(name: str, messages: Sequence[Message], robot: Robot, truth: Truth | None) -> WheelLog:
    values = robot.parameter_values()
    data = from_messages(messages, name, values)
    angle = data.wheel_angle_rad if data.wheel_angle_rad is not None else np.zeros_like(data.voltage_V)
    counts = np.round(angle * values["ENC_CPR"] / (2.0 * np.pi))
    return WheelLog(
        name=name,
        period_s=data.period_s,
        counts_per_revolution=round(values["ENC_CPR"]),
        time_s=data.time_s,
        counts=np.diff(counts, axis=0, prepend=counts[:1]),
        good=np.ones(counts.shape, dtype=bool),
        duty=data.voltage_V / values["BAT_V_NOM"],
        heading_rad=np.full(len(data.time_s), np.nan),
        truth=truth,
    )


def _fixes(messages: Sequence[Message]) -> Truth | None:
    """Pose fixes that carry the robot's time."""
    fixes = {
        m.usec: flip(m.x, m.y, m.yaw) for m in messages if m.get_type() == "VICON_POSITION_ESTIMATE" and m.usec > 0
    }
    return _truth({1e-6 * time: list(pose) for time, pose in fixes.items()})


def _estimates(messages: Sequence[Message], robot: Robot) -> Truth | None:
    """Return the robot's own estimate without its jumps: only what it moved can be compared with the wheels' motion."""
    truth = _truth({1e-3 * m.time_boot_ms: list(m.pose) for m in messages if m.get_type() == "OMNI_TRACKING"})
    if truth is None:
        return None
    wheels = {1e-3 * m.time_boot_ms: list(m.speed) for m in messages if m.get_type() == "OMNI_WHEELS"}
    wheel_time_s = np.array(sorted(wheels))
    speed = np.array([wheels[time] for time in sorted(wheels)])
    pose = np.column_stack((truth.xy, truth.theta))
    steps = steps_of(truth.time_s, pose, wheel_time_s, speed, geometry_of(robot.parameter_values()))
    if not steps.jumps.any():
        return truth
    pose = without_jumps(pose, np.flatnonzero(steps.jumps) + 1)
    return replace(truth, xy=pose[:, :2], theta=pose[:, 2], jumps=tuple(jumps_of(truth.time_s, steps)))


def _truth(poses: Mapping[float, list[float]]) -> Truth | None:
    if len(poses) < MIN_ROWS:
        return None
    times = sorted(poses)
    table = np.array([poses[time] for time in times])
    return Truth(np.array(times), table[:, :2], np.unwrap(table[:, 2]), same_clock=True)


def _from_speeds(
    name: str, counts_per_revolution: int, time: Array, speed: Array, duty: Array, truth: Truth | None
) -> WheelLog:
    """Make counts of speeds that were logged without them: the angle by the trapezoidal rule, in whole counts."""
    rises = np.concatenate(([True], np.diff(np.maximum.accumulate(time)) > 0.0))
    time, speed, duty = time[rises], speed[rises], duty[rises]
    if len(time) < MIN_ROWS:
        raise LogError(f"{name}: {len(time)} rows; at least {MIN_ROWS} are needed")
    step = np.diff(time)[:, None]
    angle = np.concatenate((np.zeros((1, speed.shape[1])), np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step, axis=0)))
    whole = np.round(angle * counts_per_revolution / (2.0 * np.pi))
    return WheelLog(
        name=name,
        period_s=float(np.median(step)),
        counts_per_revolution=counts_per_revolution,
        time_s=time,
        counts=np.diff(whole, axis=0, prepend=whole[:1]),
        good=np.ones(speed.shape, dtype=bool),
        duty=np.asarray(duty, dtype=np.float64),
        heading_rad=np.full(len(time), np.nan),
        truth=truth,
    )
