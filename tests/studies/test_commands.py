# SPDX-License-Identifier: MIT
"""omni montecarlo, sweep and optimize as a user types them."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from hil_sim.scenario import load_scenario
from hil_sim.studies.montecarlo import Plan, open_study, run_study
from hil_sim.studies.pools import LocalPool
from omni.cli import app
from omniwheel.presets import read_preset
from omniwheel.robots import parameter_table
from tests.waiting import wait_until

INTERRUPTED = 130


def omni(*arguments: object, code: int = 0) -> Any:
    """Run a command; return its result."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result


def omni_json(*arguments: object, code: int = 0) -> Any:
    return json.loads(omni(*arguments, "--json", code=code).stdout)


def montecarlo(quick_file: Path, out: Path, *more: object) -> list[object]:
    return ["montecarlo", quick_file, "--runs", 24, "--batch", 8, "--out", out, *more]


@pytest.mark.full
def test_montecarlo_leaves_numbers_picture_report_and_runs_to_repeat(quick_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "study"
    more = ("--set", "ISMC_LAM_XY=8", "--set", "world.slip_max=0.3", "--plant", "slip", "--duration", 0.4)
    told = omni_json(*montecarlo(quick_file, out, "--worst", 2, "--seed", 4, *more))
    assert told["seeds"] == [4, 27]
    assert told["figures"]["position_m"]["runs"] == 24
    assert (out / "spread.png").stat().st_size > 10_000
    worst = told["worst"][0]
    assert worst["file"] in (out / "montecarlo.md").read_text()
    again = omni_json("run", "--core-only", out / worst["file"], "--out", tmp_path / "again")
    assert again["seed"] == worst["seed"]
    assert again["world"]["plant"] == "slip"
    assert again["rmse"]["position_m"] == pytest.approx(worst["position_m"], rel=1e-9)
    definition = json.loads((out / "study.json").read_text())
    assert definition["parameters"]["ISMC_LAM_XY"] == 8.0
    assert definition["world"]["slip_max"] == 0.3
    assert definition["scenario"]["duration_s"] == 0.4
    refused = omni(*montecarlo(quick_file, out, "--seed", 4), code=2).output
    assert "parameters.ISMC_LAM_XY was 8.0, is 4.0" in refused
    assert "--fresh" in refused


@pytest.mark.full
def test_sweep_and_optimize_from_the_command_line(quick_file: Path, tmp_path: Path) -> None:
    common = (quick_file, "--runs", 8, "--batch", 8)
    told = omni_json("sweep", *common, "--param", "world.slip_max=0:0.2:2", "--out", tmp_path / "sweep")
    assert [point["values"]["world.slip_max"] for point in told["points"]] == [0.0, 0.2]
    assert (tmp_path / "sweep" / "world.slip_max" / "sweep.png").stat().st_size > 10_000
    search = ("--param", "ISMC_LAM_XY=1:30:log", "--trials", 3, "--constraint", "completed.mean>=0")
    text = omni("optimize", *common, *search, "--out", tmp_path / "optimize").stdout
    assert "fresh seeds 9 to 16" in text
    best = tmp_path / "optimize" / "best.toml"
    assert set(read_preset(best, parameter_table()).parameters) == {"ISMC_LAM_XY"}
    assert (tmp_path / "optimize" / "history.png").stat().st_size > 10_000


@pytest.mark.full
def test_a_study_without_a_path_says_so(tmp_path: Path) -> None:
    text = omni("montecarlo", "hands", "--duration", 1, "--runs", 8, "--out", tmp_path / "study").stdout
    assert "none of them drove on a path" in text
    assert "median" not in text
    assert "None of them drove on a path" in (tmp_path / "study" / "montecarlo.md").read_text()


def test_help_says_what_is_used_without_an_option() -> None:
    text = " ".join(omni("montecarlo", "--help").stdout.replace("│", " ").split())
    for default in ("all processors", "the scenario's", "runs/SCENARIO-COMMAND"):
        assert f"[default: {default}]" in text


def test_a_sweep_names_choices_and_units(quick_file: Path, tmp_path: Path) -> None:
    words = ("--runs", 8, "--batch", 8, "--param", "CTL_MODE=pid,ismc", "--param", "ISMC_LAM_XY=2:8:2")
    text = omni("sweep", quick_file, *words, "--out", tmp_path / "sweep").stdout
    assert all(word in text for word in (" pid ", " ismc ", "ISMC_LAM_XY [1/s]"))


@pytest.mark.full
def test_an_unreachable_cluster_costs_no_finished_batch(quick_file: Path, tmp_path: Path) -> None:
    omni(*montecarlo(quick_file, tmp_path / "study"))
    kept = (tmp_path / "study" / "batches.bin").read_bytes()
    omni(*montecarlo(quick_file, tmp_path / "study", "--fresh", "--cluster", "nonsense"), code=1)
    assert (tmp_path / "study" / "batches.bin").read_bytes() == kept
    omni(*montecarlo(quick_file, tmp_path / "other", "--cluster", "nonsense"), code=1)
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("word", ["ISMC_LAM_XY=", "=3", "ISMC_LAM_XY", "ISMC_LAM_XY=1:2", "ISMC_LAM_XY=nan", "NOPE=1"])
def test_a_bad_setting_is_told_as_it_was_typed(quick_file: Path, tmp_path: Path, word: str) -> None:
    told = omni_json(*montecarlo(quick_file, tmp_path / "study", "--set", word), code=2)
    text = f"{told['error']['message']} {told['error'].get('hint', '')}"
    assert not re.search(r"--param\b", text)
    assert "LOW:HIGH" not in text
    assert "file" not in text


BAD = [
    ("montecarlo", "nope"),
    ("montecarlo", "demo", "--runs", 0),
    ("montecarlo", "demo", "--batch", 12),
    ("montecarlo", "demo", "--worst-by", "positon_m"),
    ("montecarlo", "demo", "--worst-by", "completed"),
    ("montecarlo", "demo", "--set", "ISMC_LAM_XY=1e9"),
    ("montecarlo", "demo", "--set", "ISMC_LAM_XY=1:2"),
    ("montecarlo", "demo", "--set", "TRJ_LAPS=0"),
    ("montecarlo", "demo", "--preset", "nope"),
    ("montecarlo", "demo", "--workers", 0),
    ("montecarlo", "demo", "--workers", 2, "--cluster", "tcp://127.0.0.1:9"),
    ("sweep", "demo"),
    ("sweep", "demo", "--param", "ISMC_LAM_XY=9:2"),
    ("sweep", "demo", "--param", "ISMC_LAM_XY=1:2", "--runs", 0),
    ("sweep", "demo", "--param", "ISMC_LAM_XY=1:2", "--grid", "--sobol", 4),
    ("sweep", "demo", "--param", "ISMC_LAM_XY=1:2", "--show", "nothing"),
    ("optimize", "demo", "--param", "ISMC_LAM_XY=1:2", "--minimise", "nothing"),
    ("optimize", "demo", "--param", "ISMC_LAM_XY=1:2", "--constraint", "position_m"),
    ("optimize", "demo", "--param", "ISMC_LAM_XY=1:2", "--sampler", "luck"),
    ("optimize", "demo", "--param", "world.slip_max=0:0.1"),
]


@pytest.mark.parametrize("words", BAD, ids=lambda words: " ".join(map(str, words)))
def test_bad_input_is_refused_before_anything_is_written(words: tuple[object, ...], tmp_path: Path) -> None:
    omni(*words, "--out", tmp_path / "study", code=2)
    assert not (tmp_path / "study" / "batches.bin").exists() or (tmp_path / "study" / "batches.bin").stat().st_size == 0


def test_a_folder_that_cannot_be_made_is_named(quick_file: Path) -> None:
    told = omni_json(*montecarlo(quick_file, Path("/dev/null/study")), code=2)
    assert told["error"]["type"] == "StudyFolderError"
    assert "--out" in told["error"]["hint"]


@pytest.mark.full
def test_an_interrupted_process_loses_no_finished_batch(quick_file: Path, tmp_path: Path) -> None:
    out, whole = tmp_path / "study", tmp_path / "whole"
    command = [str(Path(sys.executable).with_name("omni")), "montecarlo", str(quick_file), "--runs", "100000"]
    command += ["--batch", "8", "--out", str(out), "--seed", "1"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        wait_for_batches(process, out)
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=120.0)[1]
    assert process.returncode == INTERRUPTED
    assert "repeat the command" in " ".join(told.split())
    kept = (out / "batches.bin").read_bytes()
    text = omni(*montecarlo(quick_file, out, "--seed", 1)).stdout
    assert "position RMSE [mm]" in text
    assert (out / "batches.bin").read_bytes()[: len(kept)] == kept
    plan = Plan(load_scenario(quick_file), 24, 1, 8)
    with open_study(plan, whole) as study:
        run_study(plan, study, LocalPool(1))
    for name in ("summary.json", "runs.npy"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()


def wait_for_batches(process: subprocess.Popen[str], out: Path) -> None:
    file = out / "batches.bin"

    def begun() -> bool:
        assert process.poll() is None
        return file.exists() and file.stat().st_size >= 10_000

    wait_until(begun, "no batches")
