# SPDX-License-Identifier: MIT
"""The same seed gives the same bytes, and the firmware does what the core does."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from hil_sim.hil import run_hil
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from omni.cli import app

WALL_TIME = ("wall_s", "realtime_factor", "tick_us")


def hil(folder: Path, seed: int) -> Path:
    result = CliRunner().invoke(
        app, ["run", "fault_encoder_stuck", "--seed", str(seed), "--out", str(folder), "--json"]
    )
    assert result.exit_code in (0, 1), result.output
    (run,) = folder.iterdir()
    return run


def test_two_runs_with_the_same_seed_leave_the_same_bytes(tmp_path: Path) -> None:
    first, second, other = hil(tmp_path / "a", 5), hil(tmp_path / "b", 5), hil(tmp_path / "c", 6)
    assert (first / "telemetry.tlog").read_bytes() == (second / "telemetry.tlog").read_bytes()
    assert (first / "telemetry.tlog").read_bytes() != (other / "telemetry.tlog").read_bytes()
    summaries = [json.loads((run / "summary.json").read_text()) for run in (first, second)]
    for summary in summaries:
        for key in WALL_TIME:
            summary.pop(key)
    assert summaries[0] == summaries[1]


def test_the_firmware_over_a_link_moves_the_robot_like_the_core_in_process() -> None:
    """The commands of a link take ticks to arrive, the rest is the same code: the path must agree to a millimetre."""
    scenario = load_scenario("fault_pose_loss")
    linked, direct = run_hil(scenario).record, run_in_process(scenario).record
    ticks = min(len(linked), len(direct))
    a, b = linked[:ticks], direct[:ticks]
    error_a, error_b = a["truth"] - a["reference"], b["truth"] - b["reference"]
    rms = [float(np.sqrt(np.mean(e[2000:4000, :2] ** 2))) for e in (error_a, error_b)]
    assert abs(rms[0] - rms[1]) < 5e-4
