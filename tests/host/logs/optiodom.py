# SPDX-License-Identifier: MIT
"""Runs of two real robots beside motion capture (R. B. Sousa and others, OptiOdom, 2022): what tests need of them.

Counts add up in all of them. Files and conventions: README.md of the data's folder.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omni_schema import Robot
from omniwheel.logs.log import Truth, WheelLog
from omniwheel.robots import read_robot

Array = NDArray[np.float64]

PULSES = 1024 * 12
"""Of a wheel of the three-wheel robot, gear included."""
PARTS = 100_000
"""Counts into which a revolution of a wheel of the four-wheel robot is cut: its log has fractions."""

ROBOT = """
[robot]
name = "{name}"
[geometry]
wheels = {wheels}
wheel_radius_m = {radius}
wheel_distance_m = {distance}
wheel_angle_deg = {bearings}
[encoder]
counts_per_revolution = {counts}
[wiring]
in1_channel = {in1}
in2_channel = {in2}
[parameters]
"""


@dataclass(frozen=True)
class Run:
    """One run: the log, and the truth in the log's clock, one row per row: ``pose`` (n, 3) [m, m, rad unwrapped]."""

    log: WheelLog
    pose: Array


def logs(folder: Path, robot: str) -> list[Path]:
    """Return the runs of ``omni3`` or ``omni4``, in the order of their names."""
    return sorted((folder / robot).glob("*/*/*_run-*.csv"))


def read_run(path: Path) -> Run:
    """Read one run; wheels in the robot file's order, positive counts drive the body counter-clockwise."""
    table = np.loadtxt(path, delimiter=",")
    time, truth, moved = table[:, 0], table[:, 1:4].copy(), -table[:, 4:]
    truth[:, 2] = np.unwrap(truth[:, 2])
    wheels = moved.shape[1]
    if wheels == 4:
        moved = np.diff(np.round(np.cumsum(moved, axis=0) * PARTS), axis=0, prepend=0.0)
    log = WheelLog(
        name=path.stem,
        period_s=float(np.median(np.diff(time))),
        counts_per_revolution=PULSES if wheels == 3 else PARTS,
        time_s=time,
        counts=moved,
        good=np.ones(moved.shape, dtype=bool),
        duty=np.zeros(moved.shape),
        heading_rad=np.full(len(time), np.nan),
        truth=Truth(time, truth[:, :2], truth[:, 2], same_clock=True),
    )
    return Run(log, truth)


def documented_robot(run: Path, folder: Path, **overrides: float) -> Robot:
    """Write the robot file of a run's documented geometry into ``folder`` and read it."""
    with next(run.parent.glob("*_metadata.csv")).open(encoding="utf-8") as file:
        rows = {row[0]: [float(cell) for cell in row[1:] if cell] for row in csv.reader(file) if row[0] in {"Li", "Di"}}
    radius = 0.5 * rows["Di"][0]
    if len(rows["Di"]) == 3:
        values = {"radius": radius, "distance": rows["Li"][0], "bearings": [300.0, 60.0, 180.0], "counts": PULSES}
        values |= {"name": "omni3", "wheels": 3, "in1": [0, 2, 4], "in2": [1, 3, 5]}
    else:
        # Mecanum wheels at the corners push like omni wheels at 45 degrees.
        values = {"radius": radius / np.sqrt(2.0), "distance": sum(rows["Li"]) / (2.0 * np.sqrt(2.0))}
        values |= {"bearings": [45.0, 315.0, 135.0, 225.0], "counts": PARTS, "name": "omni4", "wheels": 4}
        values |= {"in1": [0, 2, 4, 6], "in2": [1, 3, 5, 7]}
    text = ROBOT.format(**values) + "".join(f"{name} = {value}\n" for name, value in overrides.items())
    path = folder / f"{values['name']}.toml"
    path.write_text(text, encoding="utf-8")
    return read_robot(path)


def plain_sum(run: Run, robot: Robot, start: Array | None = None) -> Array:
    """Pose (n, 3) by every count as it is, with the middle heading of each row; from the true first pose by default."""
    begin = run.pose[0] if start is None else start
    values = robot.parameter_values()
    bearing = np.radians([float(value) for value in robot.geometry["wheel_angle_deg"]])
    rows = np.column_stack((-np.sin(bearing), np.cos(bearing), np.full(len(bearing), values["WHEEL_DIST"])))
    body = run.log.counts * run.log.rad_per_count * values["WHEEL_RADIUS"] @ np.linalg.pinv(rows).T
    theta = begin[2] + np.cumsum(body[:, 2])
    middle = theta - 0.5 * body[:, 2]
    x = np.cumsum(np.cos(middle) * body[:, 0] - np.sin(middle) * body[:, 1])
    y = np.cumsum(np.sin(middle) * body[:, 0] + np.cos(middle) * body[:, 1])
    return np.column_stack((begin[0] + x, begin[1] + y, theta))


def from_its_start(pose: Array) -> Array:
    """Poses (n, 3) seen from the first of them."""
    off = pose - pose[0]
    c, s = np.cos(pose[0, 2]), np.sin(pose[0, 2])
    return np.column_stack((c * off[:, 0] + s * off[:, 1], c * off[:, 1] - s * off[:, 0], off[:, 2]))
