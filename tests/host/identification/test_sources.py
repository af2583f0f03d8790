# SPDX-License-Identifier: MIT
"""Telemetry logs become datasets: wrapping sums, directions, what is missing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from omniwheel.dialect import mavlink
from omniwheel.errors import DatasetError
from omniwheel.identification.sources import read_dataset
from omniwheel.robots import read_robot
from omniwheel.tlog import TlogWriter

ROWS = 40
PERIOD_us = 20_000


def sample(row: int, counts: int, micro_volt_seconds: int) -> Any:
    def wrapped(value: int) -> int:
        return (value + 2**31) % 2**32 - 2**31

    four = [wrapped(counts)] * 4
    volts = [wrapped(micro_volt_seconds)] * 4
    return mavlink.MAVLink_omni_sample_message(row * PERIOD_us, four, volts, 11.5, [0.0, 0.0, 0.0], 0)


def write(path: Path, messages: list[Any]) -> Path:
    codec = mavlink.MAVLink(None, 1, 1)
    with TlogWriter(path, clock_us=lambda: 0) as writer:
        for message in messages:
            writer.write(bytes(message.pack(codec)))
    return path


@pytest.fixture
def parameters() -> dict[str, float]:
    return {**read_robot("three_wheel").parameter_values(), "W2_ENC_DIR": -1.0}


def test_sums_are_unwrapped_and_differenced(tmp_path: Path, parameters: dict[str, float]) -> None:
    start = 2**31 - 500
    messages = [sample(row, start + 100 * row, start + 120_000 * row) for row in range(ROWS)]
    fix = mavlink.MAVLink_vicon_position_estimate_message(5 * PERIOD_us, 1.0, -2.0, 0.0, 0.0, 0.0, -0.5, [0.0] * 21)
    data = read_dataset(write(tmp_path / "run.tlog", [*messages, fix]), parameters)
    assert data.wheels == 3
    np.testing.assert_allclose(data.time_s, np.arange(ROWS) * 0.02)
    np.testing.assert_allclose(data.voltage_V, 6.0, rtol=1e-9)
    per_row = 2.0 * np.pi * 100 / 10000
    assert data.wheel_angle_rad is not None
    np.testing.assert_allclose(
        np.diff(data.wheel_angle_rad, axis=0), per_row * np.array([1.0, -1.0, 1.0]) * np.ones((39, 3))
    )
    np.testing.assert_allclose(data.pose, [[1.0, 2.0, 0.5]])
    np.testing.assert_allclose(data.pose_time_s, [0.1])


def test_a_lost_message_costs_only_resolution(tmp_path: Path, parameters: dict[str, float]) -> None:
    messages = [sample(row, 100 * row, 120_000 * row) for row in range(ROWS) if row != 17]
    data = read_dataset(write(tmp_path / "run.tlog", messages), parameters)
    assert len(data.time_s) == ROWS - 1
    np.testing.assert_allclose(data.voltage_V, 6.0, rtol=1e-9)


def test_logs_that_will_not_do_are_refused(tmp_path: Path, parameters: dict[str, float]) -> None:
    heartbeat = mavlink.MAVLink_heartbeat_message(10, 0, 0, 0, 3, 3)
    other = write(tmp_path / "other.tlog", [heartbeat] * 5)
    with pytest.raises(DatasetError, match="0 OMNI_SAMPLE") as caught:
        read_dataset(other, parameters)
    assert "identify live" in caught.value.hint
    noise = tmp_path / "noise.tlog"
    noise.write_bytes(b"no log at all" * 20)
    with pytest.raises(DatasetError, match="not a telemetry log"):
        read_dataset(noise, parameters)
    with pytest.raises(DatasetError, match="No such file"):
        read_dataset(tmp_path / "absent.tlog", parameters)


def test_a_robot_with_more_wheels_than_the_log_is_noticed(tmp_path: Path) -> None:
    messages = []
    for row in range(ROWS):
        message = sample(row, 100 * row, 120_000 * row)
        message.counts[3] = 0
        messages.append(message)
    path = write(tmp_path / "run.tlog", messages)
    with pytest.raises(DatasetError, match="wheel 4 of 4 never turns"):
        read_dataset(path, read_robot("four_wheel").parameter_values())
