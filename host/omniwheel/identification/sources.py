# SPDX-License-Identifier: MIT
"""Datasets from what Omniwheel itself records: telemetry over a link, .tlog files, and folders of simulated runs."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.metrics import STATE_ARMED
from hil_sim.summary import RECORD_FILE, load_run
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import DatasetError
from omniwheel.frames import flip
from omniwheel.identification.dataset import Dataset
from omniwheel.telemetry import Battery, Wheels, decode

Array = NDArray[np.float64]
STAMP_BYTES = 8


def read_source(path: Path, supply_V: float, wheels: int) -> Dataset:
    """Read a .tlog file or the folder of a simulated run; ``supply_V`` stands in where none was measured."""
    if path.is_dir():
        return read_run_folder(path, wheels)
    return from_messages(read_tlog(path), str(path), supply_V, wheels)


def read_tlog(path: Path) -> list[Message]:
    """Return the messages of a telemetry log in their order. Raises DatasetError."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror}", hint="give a .tlog file or the folder of a run") from error
    codec: Any = mavlink.MAVLink(None)
    codec.robust_parsing = True
    messages: list[Message] = []
    place = 0
    while place + STAMP_BYTES + 2 <= len(data):
        frame = place + STAMP_BYTES
        signed = data[frame] == mavlink.PROTOCOL_MARKER_V2 and data[frame + 2 : frame + 3] == b"\x01"
        length = 12 + data[frame + 1] + (13 if signed else 0)
        messages += codec.parse_buffer(data[frame : frame + length]) or []
        place = frame + length
    return messages


def from_messages(messages: Iterable[Message], name: str, supply_V: float, wheels: int) -> Dataset:
    """Make a dataset of telemetry: OMNI_WHEELS, SYS_STATUS, and pose fixes with the robot's time. Raises DatasetError.

    Telemetry samples a duty that changes at every tick: the mean of two samples stands for the time between them.
    """
    rows: list[Wheels] = []
    supply: list[float] = []
    fixes: list[tuple[float, ...]] = []
    latest_V = supply_V
    for message in messages:
        battery, row = decode(Battery, message), decode(Wheels, message)
        if battery is not None and math.isfinite(battery.voltage_V):
            latest_V = battery.voltage_V
        elif row is not None and (not rows or row.time_s > rows[-1].time_s):
            rows.append(row)
            supply.append(latest_V)
        elif message.get_type() == "VICON_POSITION_ESTIMATE" and message.usec > 0:
            if not fixes or message.usec * 1e-6 > fixes[-1][0]:
                fixes.append((message.usec * 1e-6, *flip(message.x, message.y, message.yaw)))
    if len(rows) < 2:
        hint = "record with `omni record`, OMNI_WHEELS at 50 Hz (`omni identify live` does so)"
        raise DatasetError(f"{name} has {len(rows)} OMNI_WHEELS messages; many are needed", hint=hint)
    poses = np.array(fixes).reshape(-1, 4)
    speed = np.array([row.speed_rad_s for row in rows])[:, :wheels]
    duty = np.array([row.duty for row in rows])[:, :wheels]
    return _dataset(name, np.array([row.time_s for row in rows]), speed, duty, np.array(supply), poses)


def read_run_folder(folder: Path, wheels: int) -> Dataset:
    """Read a folder that `omni sim` or `omni hil` left. Raises DatasetError."""
    try:
        _, samples = load_run(folder)
    except (OSError, ValueError, KeyError) as error:
        raise DatasetError(f"{folder} is no run: {error}", hint=f"a run's folder has {RECORD_FILE}") from error
    samples = samples[samples["state"] == STATE_ARMED]
    time_s = samples["time_s"]
    poses = np.column_stack((time_s, samples["truth"]))
    return _dataset(
        str(folder), time_s, samples["wheel_rad_s"][:, :wheels], samples["duty"][:, :wheels], samples["supply_V"], poses
    )


def _dataset(name: str, time_s: Array, speed: Array, duty: Array, supply: Array, poses: Array) -> Dataset:
    sampled = duty * supply[:, None]
    voltage = np.concatenate((0.5 * (sampled[:-1] + sampled[1:]), sampled[-1:]))
    return Dataset(name, time_s, speed, voltage, poses[:, 0], poses[:, 1:], supply_V=supply)
