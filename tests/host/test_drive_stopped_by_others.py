# SPDX-License-Identifier: MIT
"""``omni drive`` ends at once if another station ends its drive."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from omniwheel.tlog_reader import TlogReader
from tests.firmware.client import Client, connect, firmware, mav

ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM
HEARTBEAT_ARMED = mav.MAV_MODE_FLAG_SAFETY_ARMED
STOPS = {"disarm": (ARM, 0.0), "hold": (mav.MAV_CMD_OMNI_TRAJECTORY_STOP,), "e-stop": (mav.MAV_CMD_OMNI_ESTOP, 1.0)}


@pytest.mark.parametrize("name", STOPS)
def test_a_drive_ends_with_exit_code_1_if_another_station_stops_the_robot(tmp_path: Path, name: str) -> None:
    with firmware(links=("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")) as robot:
        other = connect(robot, 1)
        other.heartbeat()
        words = ("drive", "velocity", "0", "0", "0", "--duration", "60", "--link", robot.links[0], "--out", tmp_path)
        drive = subprocess.Popen(
            [sys.executable, "-m", "omni", *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        other.wait_for(is_armed, "the robot is not armed")
        await_streaming(other)
        assert other.command(*STOPS[name]) == mav.MAV_RESULT_ACCEPTED
        said, _ = drive.communicate(timeout=20.0)
        assert drive.returncode == 1, said
        (log,) = tmp_path.glob("*/drive.json")
        assert json.loads(log.read_text())["end"] != "done"


@pytest.mark.parametrize(("station", "exit_code"), [("254", 0), ("256", 1)])
def test_a_command_speaks_as_the_station_that_its_computer_was_given(
    tmp_path: Path, station: str, exit_code: int
) -> None:
    with firmware() as robot:
        words = ("drive", "velocity", "0", "0", "0", "--duration", "1", "--link", robot.links[0], "--out", tmp_path)
        done = subprocess.run(
            [sys.executable, "-m", "omni", *map(str, words)],
            env={**os.environ, "OMNI_STATION": station},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=30.0,
            check=False,
        )
    assert done.returncode == exit_code, done.stdout
    beats = [
        message.get_srcSystem()
        for log in tmp_path.glob("*/*.tlog")
        for message in TlogReader(log)
        if message.get_type() == "HEARTBEAT" and message.type == mav.MAV_TYPE_GCS
    ]
    assert set(beats) == ({254} if exit_code == 0 else set())


def is_armed(message: object) -> bool:
    return bool(getattr(message, "base_mode", 0) & HEARTBEAT_ARMED)


def await_streaming(other: Client) -> None:
    other.wait_for(lambda m: m.get_type() == "HEARTBEAT" and m.custom_mode not in (0,), "no setpoints")
