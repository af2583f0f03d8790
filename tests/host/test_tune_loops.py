# SPDX-License-Identifier: MIT
"""``omni tune`` with the experiments that show a loop: gains show there, and all sets get the same signal."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import omniwheel.robot
from omni.cli import app
from omni.cli import tune as tune_command
from omni_schema.parameters import EXPERIMENTS
from omniwheel.errors import LimitError
from omniwheel.experiments import PositionPlan, WheelPlan
from omniwheel.experiments.repeated import Loop, Signal, common, experiments_for
from omniwheel.robots import parameter_table
from omniwheel.tuning_verdict import Kind, judge_figures
from tests.host.experiments.test_wheel import FLOOR, STAND, connected
from tests.host.stepped import robot as simulated

ALONE = ("--link", "simulated", "--revert", "--json")


def tune(folder: Path, *words: object, code: int = 0) -> Any:
    done = CliRunner().invoke(app, ["tune", *map(str, words), *ALONE, "--out", str(folder)])
    assert done.exit_code == code, done.output
    return json.loads(done.stdout) if done.stdout.startswith("{") else done.output


@pytest.fixture
def stand() -> Iterator[None]:
    with simulated(STAND, end_s=600.0):
        yield


@pytest.mark.full
def test_a_wheel_loops_gain_shows_with_a_verdict(stand: None, tmp_path: Path) -> None:
    """The step of a pose shows nothing of WS_P: it goes through the reference governor."""
    words = ("-e", "wheel-chirp", "-e", "wheel-step", "--wheels-up", "--rounds", 3)
    told = tune(tmp_path, "--set", "WS_P=0.5", "--set", "WS_I=5", *words)
    verdicts = {verdict["figure"]: verdict for verdict in told["candidates"][0]["verdicts"]}
    bandwidth, margin = verdicts["wheel-chirp.bandwidth_hz"], verdicts["wheel-chirp.phase_margin_rad"]
    assert bandwidth["shows"]
    assert "lower by" in bandwidth["text"]
    assert told["after"]["wheel-chirp.bandwidth_hz"] < 0.7 * told["before"]["wheel-chirp.bandwidth_hz"]
    assert margin["rounds"] == 3
    assert told["before"]["wheel-step.duty_noise"] > told["after"]["wheel-step.duty_noise"]
    assert not told["kept"]
    folder = Path(told["folder"])
    names = {path.name for path in folder.iterdir()}
    assert {"tune.json", "tune-wheel-chirp.png", "tune-wheel-step.png", "telemetry.tlog", "drive.json"} <= names
    assert json.loads((folder / "drive.json").read_text())["asked"].startswith("tune wheel-chirp, wheel-step: WS_P=0.5")


def test_each_parameter_names_an_experiment_that_tune_has() -> None:
    assert {kind.value for kind in tune_command.Kind} == set(EXPERIMENTS)
    chosen = experiments_for(["WS_P", "ISMC_LAM_XY", "WS_I", "LIM_V", "NOT_KNOWN"], parameter_table())
    assert chosen == ["wheel-step", "position-step", "step"]


@pytest.mark.full
def test_without_a_wish_the_changed_parameter_chooses_the_experiment(stand: None, tmp_path: Path) -> None:
    told = tune(tmp_path, "--set", "WS_P=6", "--wheels-up")
    assert json.loads((Path(told["folder"]) / "drive.json").read_text())["asked"] == "tune wheel-step: WS_P=6.0"


@pytest.mark.full
def test_a_position_gain_shows_and_nothing_is_overwritten(tmp_path: Path) -> None:
    with simulated(end_s=600.0):
        words = ("--set", "ISMC_LAM_XY=3", "-e", "position-step", "--size", "0.003", "--duration", "1.5")
        folders = []
        for _ in range(2):
            told = tune(tmp_path, *words)
            assert told["after"]["rise_s"] > 1.5 * told["before"]["rise_s"]
            folders.append(told["folder"])
    assert folders == [str(tmp_path / "tune"), str(tmp_path / "tune-2")]
    for folder in folders:
        assert (Path(folder) / "tune.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.full
def test_a_set_that_cannot_take_the_signal_is_refused_before_anything_moves(stand: None, tmp_path: Path) -> None:
    words = ("-e", "wheel-step", "--wheels-up", "--size", "0.5")
    tune(tmp_path / "fits", "--set", "WS_P=6", *words)
    told = tune(tmp_path / "not", "--set", "WS_P=6", "--candidate", "WS_P=60", *words, code=2)
    assert "LIM_DUTY" in told["error"]["message"]
    assert not list(tmp_path.glob("not/*/tune.json"))
    with omniwheel.robot.connect("simulated") as robot:
        assert not robot.status.armed


@pytest.mark.full
@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("-e", "wheel-step", "-e", "wheel-chirp", "--size", "1"), "belong to one experiment"),
        (("-e", "step", "--size", "0"), "not 0"),
        (("-e", "step", "--size", "4"), "from -3 to 3"),
        (("-e", "wheel-stop"), "wheel-stop"),
        (("-e", "wheel-step", "--only-wheel", "4"), "unknown wheel 4"),
        (("-e", "position-step", "--size", "0.3"), "0.25"),
    ],
)
def test_what_cannot_be_is_refused(stand: None, tmp_path: Path, words: tuple[str, ...], why: str) -> None:
    told = tune(tmp_path, "--set", "WS_P=6", *words, code=2)
    assert why in str(told)


def test_out_is_a_folder(tmp_path: Path) -> None:
    """Until the last release it was the picture: somebody's old command line must not make a folder of that name."""
    assert "--plot" in str(tune(tmp_path / "tune.png", "--set", "WS_P=6", code=2))
    assert not list(tmp_path.iterdir())


def test_all_sets_get_the_smallest_signal_that_any_chooses() -> None:
    chosen = common([WheelPlan(0, 9.0, 4.0, to_hz=50.0), WheelPlan(0, 8.0, -3.0, to_hz=90.0)])
    assert (chosen.speed_rad_s, chosen.amplitude_rad_s, chosen.to_hz) == (8.0, -3.0, 90.0)
    assert common([PositionPlan("y", 0.01), PositionPlan("y", 0.004)]).amplitude == 0.004


@pytest.mark.full
def test_the_signal_is_chosen_for_every_set_and_kept() -> None:
    sets = [{"WS_P": 2.0}, {"WS_P": 12.0}]
    with connected(FLOOR) as robot:
        loop = Loop("wheel-step", Signal(), 1.0, lambda _: None)
        loop.prepare(robot, sets, robot.parameters.set_many)
        sizes = []
        for values in sets:
            robot.parameters.set_many(values)
            outcome, figures = loop.run(robot)
            sizes.append(outcome.settings["amplitude_rad_s"])
            assert figures["rise_s"] > 0.0
        alone = Loop("wheel-step", Signal(), 1.0, lambda _: None)
        alone.prepare(robot, sets[:1], robot.parameters.set_many)
        free, _ = alone.run(robot)
        with pytest.raises(LimitError, match="unknown wheel 4"):
            Loop("disturbance", Signal(wheel=4), 1.0, lambda _: None).prepare(robot, sets, robot.parameters.set_many)
    assert sizes[0] == sizes[1] <= free.settings["amplitude_rad_s"]


@pytest.mark.parametrize(
    ("better", "word"), [(-1, "worse"), (1, "better"), (0, "higher")], ids=["smaller", "larger", "neither"]
)
def test_a_verdict_says_better_only_where_one_end_is_better(better: int, word: str) -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.01, (2, 6))
    kind = Kind("f", "figure", "Hz", 1.0, 2, better)
    before, after = ([{"f": level + value} for value in row] for level, row in enumerate(noise.tolist(), 1))
    (verdict,) = judge_figures(before, after, [kind], 1)
    assert verdict.word == word
    assert f"{word} by 1.0" in verdict.sentence()
    assert not judge_figures([{}], [{"f": 1.0}], [kind], 1)
    (once,) = judge_figures([{"f": 1.0}], [{"f": 2.0}], [kind], 1)
    assert once.word == ""
