# SPDX-License-Identifier: MIT
"""The commands that run things: tune and drive on a live robot, run, plot and bench on this computer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from hil_sim.world import PLANTS
from omni import checks
from omni.cli import app
from tests.host.stepped import connect


def omni(*arguments: object, code: int = 0) -> str:
    """Run a command and return its standard output."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.stdout


def omni_json(*arguments: object, code: int = 0) -> Any:
    """Run a command with --json; whatever else stood on standard output would break the parser."""
    return json.loads(omni(*arguments, "--json", code=code))


def parameter(url: str, name: str) -> float:
    with connect(url) as robot:
        return robot.parameters[name]


STEP = ("-e", "step", "--size", "0.05", "--duration", "1.5")


def test_tune_compares_and_goes_back(sitl: str, tmp_path: Path) -> None:
    before = parameter(sitl, "WS_P")
    picture = tmp_path / "tune.png"
    told = omni_json("tune", "--link", sitl, "--set", "WS_P=6", *STEP, "--revert", "--plot", picture, "--out", tmp_path)
    assert told["old"] == {"WS_P": before}
    assert told["new"] == {"WS_P": 6.0}
    for side in ("before", "after"):
        assert 0.0 < told[side]["rise_s"] < 1.5
        assert 0.0 < told[side]["position_m"] < 0.01
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert parameter(sitl, "WS_P") == before
    with connect(sitl) as robot:
        assert not robot.status.armed


def test_tune_keeps_what_it_is_told_to_keep(sitl: str, tmp_path: Path) -> None:
    told = omni_json("tune", "--link", sitl, "--set", "WS_P=5", *STEP, "--keep", "--out", tmp_path)
    assert told["kept"] is True
    assert parameter(sitl, "WS_P") == 5.0


@pytest.mark.nightly
def test_tune_tries_several_in_rounds_and_judges_each(sitl: str, tmp_path: Path) -> None:
    before = parameter(sitl, "ISMC_LAM_XY")
    words = ("--set", "ISMC_LAM_XY=4", "--candidate", f"ISMC_LAM_XY={before:g} WS_P=4", "--rounds", 3)
    told = omni_json("tune", "--link", sitl, *words, *STEP, "--out", tmp_path)
    assert told["rounds"] == 3
    assert [list(entry["new"]) for entry in told["candidates"]] == [["ISMC_LAM_XY"], ["ISMC_LAM_XY", "WS_P"]]
    assert told["kept"] is False
    for entry in told["candidates"]:
        for verdict in entry["verdicts"]:
            assert verdict["rounds"] <= 3
            assert ("within the noise" in verdict["text"]) is not verdict["shows"]
    assert parameter(sitl, "ISMC_LAM_XY") == before
    omni("tune", "--link", sitl, *words, *STEP, "--keep", "--out", tmp_path, code=2)


@pytest.mark.parametrize("setting", ["WS_P=nan", "WS_P=1e9", "WSP=4", "WS_P", "WHEELS=3.5"])
def test_tune_refuses_bad_values_before_anything_moves(sitl: str, tmp_path: Path, setting: str) -> None:
    omni("tune", "--link", sitl, "--set", setting, "--revert", "--out", tmp_path, code=2)
    with connect(sitl) as robot:
        assert not robot.status.armed
    assert not list(tmp_path.iterdir())


def test_duties_turn_the_robot_open_loop(sitl: str) -> None:
    told = omni_json("drive", "duty", "0.3", "0.3", "0.3", "--for", "1", "--link", sitl)
    assert 0.02 < told["pose"]["theta"] < 0.4  # 0.3 in a second of the robot's time; a busy computer gives it less
    with connect(sitl) as robot:
        assert not robot.status.armed
    assert omni_json("drive", "duty", "1.5", "0", "0", "--link", sitl, code=2)["error"]["type"] == "SetpointError"


def test_a_pose_is_driven_to(sitl: str) -> None:
    omni("drive", "pose", 0.05, 0.05, 0.1, "--for", 120, "--link", sitl)
    told = omni_json("monitor", "--once", "--link", sitl)
    pose = told["pose"] if "pose" in told else told["estimate"]
    x, y, theta = pose.values() if isinstance(pose, dict) else pose
    assert (x, y, theta) == pytest.approx((0.05, 0.05, 0.1), abs=0.01)


@pytest.mark.full
def test_run_leaves_a_run_that_plot_draws_again(tmp_path: Path) -> None:
    told = omni_json("run", "--core-only", "fault_pose_loss", "--seed", 4, "--out", tmp_path)
    assert told["seed"] == 4
    assert told["way"] == "in-process"
    (run,) = tmp_path.iterdir()
    (run / "run.png").unlink()
    omni("plot", run)
    assert (run / "run.png").stat().st_size > 10_000


def test_run_says_why_it_cannot_start(tmp_path: Path) -> None:
    flat = tmp_path / "flat.toml"
    flat.write_text('[scenario]\nname = "flat"\nextends = "demo"\n[world]\nbattery_V = 5.0\n', encoding="utf-8")
    result = CliRunner().invoke(app, ["run", "--core-only", str(flat), "--out", str(tmp_path / "runs")])
    assert result.exit_code == 1
    assert "arming was rejected: battery" in result.stderr


@pytest.mark.parametrize(
    ("words", "names"),
    [
        (["--core-only", "--image", "firmware.elf"], ["--image"]),
        (["--core-only", "--board", "cortex-m7", "--link", "tcp:127.0.0.1:1"], ["--board", "--link"]),
        (["--core-only", "--world", "mujoco"], ["--world"]),
        (["--link", "tcp:127.0.0.1:1", "--board", "cortex-m7"], ["--board"]),
        (["--image", "firmware.elf", "--board", "cortex-m7"], ["--board"]),
        (["--board", "teensy"], ["--image", "make firmware"]),
        (["no_slip", "--compare"], ["compare"]),
    ],
)
def test_an_option_of_another_engine_is_refused(tmp_path: Path, words: list[str], names: list[str]) -> None:
    result = CliRunner().invoke(app, ["run", *words, "--out", str(tmp_path / "runs")], env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert [name for name in names if name not in result.stderr] == []
    assert not (tmp_path / "runs").exists()


def test_a_run_that_stops_early_fails(tmp_path: Path) -> None:
    stopped = tmp_path / "stopped.toml"
    event = '[[event]]\nat_s = 1.0\ncommand = "estop"\n'
    arm = '[[event]]\nat_s = 0.5\ncommand = "trajectory_start"\n[[event]]\nat_s = 0.5\ncommand = "arm"\n'
    stopped.write_text(f'[scenario]\nname = "stopped"\nextends = "no_slip"\n{arm}{event}', encoding="utf-8")
    words = ("run", "--core-only", stopped, "--out", tmp_path / "runs")
    assert omni_json(*words, code=1)["completed"] is False
    assert omni_json(*words, "--duration", 2)["completed"] is False


@pytest.mark.full
@pytest.mark.parametrize("plant", PLANTS)
def test_run_drives_every_plant_to_the_end(tmp_path: Path, plant: str) -> None:
    told = omni_json("run", "--core-only", "no_slip", "--plant", plant, "--out", tmp_path)
    assert told["completed"]
    assert told["world"]["plant"] == plant
    assert told["faults"] == []
    assert told["rmse"]["position_m"] < 0.01
    assert told["effort"]["chatter"] < 0.1


def test_an_unknown_plant_is_bad_input(tmp_path: Path) -> None:
    omni("run", "--core-only", "no_slip", "--plant", "slipp", "--out", tmp_path, code=2)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.full
def test_bench_measures_the_loops() -> None:
    done = CliRunner().invoke(checks.app, ["bench", "--seconds", "1", "--repeat", "1", "--json"])
    results = json.loads(done.stdout)["results"]
    ways = ("hil", "in_process", "monte_carlo", "monte_carlo_2")
    assert all(results[way]["realtime_factor"] > 0.0 for way in ways)


@pytest.mark.parametrize(
    "command",
    [
        ("run", "nope"),
        ("run", "nope", "--core-only"),
        ("plot", "nowhere"),
        ("sitl", "--robot", "nope"),
        ("run", "--seed", -1),
    ],
)
def test_what_is_not_there_is_bad_input(command: tuple[object, ...]) -> None:
    omni(*command, code=2)


@pytest.mark.full
def test_run_takes_another_robot_and_other_numbers(tmp_path: Path) -> None:
    words = (
        "run",
        "demo",
        "--core-only",
        "--robot",
        "fast_three_wheel",
        "--set",
        "TRJ_PETALS=4",
        "--set",
        "world.slip_max=0.02",
    )
    summary = omni_json(*words, "--out", tmp_path)
    assert summary["robot"] == "fast_three_wheel"
    assert summary["parameters"]["TRJ_PETALS"] == 4.0
    assert summary["world"]["slip_max"] == 0.02
    assert summary["effort"]["peak_wheel_rad_s"] > 4.0  # the scenario's own robot has a limit of 3 rad/s


@pytest.mark.parametrize("word", ["TRJ_PETALS", "NOPE=1", "TRJ_PETALS=100", "world.slip_max=2", "TRJ_PETALS=3:5"])
def test_a_setting_that_is_none_is_refused(tmp_path: Path, word: str) -> None:
    omni("run", "--core-only", "demo", "--set", word, "--out", tmp_path, code=2)
    assert list(tmp_path.iterdir()) == []


def test_a_run_says_which_controller_drove(tmp_path: Path) -> None:
    output = omni("run", "--core-only", "no_slip", "--set", "CTL_MODE=pd", "--duration", "2", "--out", tmp_path)
    assert "controller pd" in output
    (summary,) = tmp_path.glob("*/summary.json")
    assert json.loads(summary.read_text(encoding="utf-8"))["controller"] == "pd"
    assert "controller pd" in omni("runs", "--folder", tmp_path)
