# SPDX-License-Identifier: MIT
"""`omni run --compare` as a user runs it: a fresh process, an empty folder, the real firmware."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

RUN_FILES = ("telemetry.tlog", "summary.json", "run.png")


ROOT = Path(__file__).parents[2]


def run_demo(folder: Path, *options: str) -> tuple[dict[str, Any], Path]:
    command = [
        str(Path(sys.executable).with_name("omni")),
        "run",
        *options,
        "--compare",
        "--out",
        str(folder),
        "--json",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, cwd=folder)
    assert done.returncode == 0, done.stderr
    (run,) = (path for path in folder.iterdir() if path.is_dir())
    return json.loads(done.stdout), run


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    return run_demo(tmp_path_factory.mktemp("demo"))


@pytest.fixture(scope="module")
def slow(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return run_demo(tmp_path_factory.mktemp("slow"), "demo")[0]


@pytest.mark.full
def test_a_fast_robot_tracks_the_rose_within_the_promised_bounds(demo: tuple[dict[str, Any], Path]) -> None:
    summary, _ = demo
    assert summary["robot"] == "fast_three_wheel"
    assert summary["rmse"]["position_m"] <= 5e-3
    assert summary["rmse"]["theta_rad"] <= 0.01
    assert 2e-3 < summary["comparison"]["fast_no_slip"]["rmse"]["position_m"] < 1e-2, "real wheels, no slip, no fixes"
    assert summary["comparison"]["fast_no_fixes"]["rmse"]["position_m"] > 10.0 * summary["rmse"]["position_m"]
    assert summary["faults"] == []
    assert summary["completed"]


@pytest.mark.full
def test_the_slow_robot_tracks_the_rose_within_the_promised_bounds(slow: dict[str, Any]) -> None:
    assert slow["robot"] == "three_wheel"
    assert slow["rmse"]["position_m"] <= 3e-3
    assert slow["rmse"]["theta_rad"] <= 0.01
    assert 2e-3 < slow["comparison"]["no_slip"]["rmse"]["position_m"] < 1e-2, "real wheels, no slip, no fixes"
    ours = slow["rmse"]["position_m"]
    same_sensors, theirs = (
        slow["comparison"][name]["rmse"]["position_m"] for name in ("original_law_fixes", "original_law")
    )
    assert ours < same_sensors < 5.0 * ours < theirs, "most of the difference is the sensors', not the law's"
    assert slow["faults"] == []
    assert slow["completed"]


@pytest.mark.full
def test_the_pages_tell_the_numbers_of_this_demo(demo: tuple[dict[str, Any], Path], slow: dict[str, Any]) -> None:
    summary, _ = demo
    readme = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    for run in (summary, slow):
        told = f"{run['rmse']['position_m'] * 1e3:.1f} mm and {run['rmse']['theta_rad'] * 1e3:.1f} mrad"
        assert told in readme, told
    change, others = summary["change"], summary["comparison"]
    columns = (
        change["rmse_before"],
        change["rmse_after"],
        summary["rmse"],
        others["fast_no_fixes"]["rmse"],
        others["fast_no_slip"]["rmse"],
    )
    page = (ROOT / "docs/start/screen.md").read_text(encoding="utf-8")
    for heading, key in (("position RMSE [mm]", "position_m"), ("heading RMSE [mrad]", "theta_rad")):
        (line,) = (line for line in page.splitlines() if heading in line)
        assert line.split("]")[1].split() == [f"{column[key] * 1e3:.2f}" for column in columns]


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
    assert (run / "run.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.full
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
    duration_s = demo[0]["duration_s"]
    assert positions > 9 * duration_s  # 10 a second, of which a few may fall on the edges
    assert parameters > 100
    assert heartbeats > 1.8 * duration_s  # one a second from either side
