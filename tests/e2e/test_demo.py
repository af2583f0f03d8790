# SPDX-License-Identifier: MIT
"""`omni demo` as a user runs it: a fresh process, an empty folder, the real firmware."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

RUN_FILES = ("telemetry.tlog", "summary.json", "report.png")


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    folder = tmp_path_factory.mktemp("demo")
    command = [str(Path(sys.executable).with_name("omni")), "demo", "--out", str(folder), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, cwd=folder)
    assert done.returncode == 0, done.stderr
    (run,) = (path for path in folder.iterdir() if path.is_dir())
    return json.loads(done.stdout), run


def test_it_tracks_the_rose_within_the_promised_bounds(demo: tuple[dict[str, Any], Path]) -> None:
    summary, _ = demo
    assert summary["rmse"]["position_m"] <= 3e-3
    assert summary["rmse"]["theta_rad"] <= 0.01
    assert summary["comparison"]["no_slip"]["rmse"]["position_m"] <= 1e-3
    assert summary["comparison"]["original_law"]["rmse"]["position_m"] > summary["rmse"]["position_m"]
    assert summary["faults"] == []
    assert summary["completed"]


def test_the_gain_change_is_measured_before_and_after(demo: tuple[dict[str, Any], Path]) -> None:
    change = demo[0]["change"]
    assert {"rmse_before", "rmse_after", "time_s", "what"} <= set(change)
    assert change["rmse_before"] != change["rmse_after"]


def test_it_leaves_a_run_folder_with_everything(demo: tuple[dict[str, Any], Path]) -> None:
    summary, run = demo
    for name in RUN_FILES:
        assert (run / name).stat().st_size > 1000, name
    stored = json.loads((run / "summary.json").read_text())
    wanted = {
        "rmse",
        "robot",
        "controller",
        "trajectory",
        "seed",
        "ticks",
        "realtime_factor",
        "firmware_version",
        "faults",
    }
    assert wanted <= set(stored)
    assert {"x_m", "y_m", "theta_rad", "position_m"} <= set(stored["rmse"])
    assert stored["rmse"] == summary["rmse"]
    assert (run / "report.png").read_bytes().startswith(b"\x89PNG")


def test_plain_pymavlink_reads_the_log(demo: tuple[dict[str, Any], Path]) -> None:
    """No dialect of ours, no package of ours: the standard messages are simply there."""
    program = (
        "import sys; from pymavlink import mavutil; log = mavutil.mavlink_connection(sys.argv[1])\n"
        "seen = []\n"
        "while (message := log.recv_msg()) is not None: seen.append(message.get_type())\n"
        "print(seen.count('LOCAL_POSITION_NED'), seen.count('PARAM_VALUE'), seen.count('HEARTBEAT'))\n"
    )
    environment = {**os.environ, "MAVLINK20": "1"}
    command = [sys.executable, "-c", program, str(demo[1] / "telemetry.tlog")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120, env=environment)
    positions, parameters, heartbeats = map(int, done.stdout.split())
    assert positions > 500
    assert parameters > 100
    assert heartbeats > 100
