# SPDX-License-Identifier: MIT
"""The experiment on two robots' geometry where there are no logs, and on simulated ones in their place."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni_reproduce import geometry_logs
from omni_reproduce.experiment import Context, read_spec
from omniwheel.errors import LogError
from omniwheel.identification.pose_fit.scores import summary
from omniwheel.identification.pose_fit.wheel_model import WheelModel
from omniwheel.identification.pose_fit.windows import run_of
from tests.host.pose_fit.files import table
from tests.host.pose_fit.robots import COUNTS, drive, true_values

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "optiodom"
PULSES = 12288
LAYOUT = WheelModel(0.051, 0.195, np.radians([300.0, 60.0, 180.0]))
"""The three-wheel robot of the data as documented."""


def test_without_logs_it_says_how_to_give_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_OPTIODOM", str(tmp_path))
    rows = geometry_logs.run(Context(tmp_path)).rows
    assert [row.ours for row in rows] == [None, None]
    assert all("OMNI_OPTIODOM" in row.explanation for row in rows)


def test_a_folder_that_is_none_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_OPTIODOM", str(tmp_path / "nowhere"))
    with pytest.raises(LogError, match="no folder"):
        geometry_logs.run(Context(tmp_path))


def test_the_folder_after_the_name_is_read_and_only_where_an_experiment_reads_logs(tmp_path: Path) -> None:
    out = ("--out", str(tmp_path / "out"))
    shown = CliRunner().invoke(app, ["reproduce", "optiodom", str(tmp_path), "--json", *out])
    assert shown.exit_code == 0, shown.output
    told = [row["explanation"] for row in json.loads(shown.stdout)["rows"]]
    assert len(told) == 2
    assert all(str(tmp_path) in text for text in told)
    for names in (["table2"], []):
        assert CliRunner().invoke(app, ["reproduce", *names, str(tmp_path), *out]).exit_code == 2


@pytest.mark.full
@pytest.mark.timeout(900)
@pytest.mark.parametrize("data", ["omni3", "omni4"])
def test_real_runs_that_were_left_out_come_out_better_than_documented(data: str) -> None:
    spec = read_spec(geometry_logs.NAME)
    settings = spec["robots"][data]
    paths = sorted((DATA / data).glob(spec["experiment"]["runs"]))
    if not paths:
        pytest.skip(f"no logs in {DATA / data}")
    runs = geometry_logs.read_runs(paths, settings["file"])
    found = geometry_logs.identified(runs, paths, settings, positions=False)
    documented = {score.name: score for score in found.splits[0].scores}
    for split in found.splits[1:]:
        for train, test in zip(split.trained_on, split.tested_on, strict=True):
            assert train
            assert test
            assert not train & test
        scored = [score.name for score in split.scores]
        assert sorted(scored) == sorted(name for test in split.tested_on for name in test)
        before = summary([documented[name] for name in scored], lambda run: run.largest_m)
        after = summary(split.scores, lambda run: run.largest_m)
        assert after.median < before.median
        assert after.largest < before.largest


@pytest.mark.full
def test_a_log_without_the_times_of_its_clocks_is_an_error(tmp_path: Path) -> None:
    run = run_of(drive(LAYOUT, true_values(LAYOUT, 5), 1, duration_s=5.0), "", LAYOUT)
    path = tmp_path / "s_run-01.csv"
    metadata = tmp_path / f"{tmp_path.name}_metadata.csv"
    with pytest.raises(LogError, match="metadata"):
        geometry_logs.at_true_period(run, path)
    metadata.write_text("gt_ti,1\ngt_tf,12\nodo_ti,0\nodo_tf,10\n", encoding="utf-8")
    np.testing.assert_allclose(geometry_logs.at_true_period(run, path).rolled_rad, 1.1 * run.rolled_rad)


@pytest.mark.full
def test_sessions_of_another_robot_are_scored_and_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    out.mkdir()
    truth = true_values(LAYOUT, 5)
    for seed in range(4):
        log = drive(LAYOUT, truth, seed, duration_s=16.0)
        # The robot's rows are 0.04 s apart: two of ours. Its positive counts turn it clockwise.
        turned = np.cumsum(log.counts, axis=0)[::2] * -PULSES / COUNTS
        counts = np.diff(np.round(turned), axis=0, prepend=np.zeros((1, 3)))
        rows = [line for number, line in enumerate(table(log, log.counts).splitlines()) if number % 2 == 0]
        text = "\n".join(
            ",".join([*row.split(",")[:4], *(f"{count:.0f}" for count in moved)])
            for row, moved in zip(rows, counts, strict=True)
        )
        folder = data / "omni3" / "joystick" / f"session{seed % 2}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"session{seed % 2}_run-{seed:02}.csv").write_text(text + "\n", encoding="utf-8")
    monkeypatch.setenv("OMNI_OPTIODOM", str(data))
    result = geometry_logs.run(Context(out))
    figures = {(row.setting, row.quantity): row.ours for row in result.rows}
    largest = f"{geometry_logs.LARGEST}, largest of all runs"
    before = figures[f"three wheels, {geometry_logs.DOCUMENTED}", largest]
    assert before is not None
    for setting in (geometry_logs.LEFT_OUT, geometry_logs.POSITIONS):
        after = figures[f"three wheels, {setting}", largest]
        assert after is not None
        assert after < 0.5 * before
    assert figures["three wheels, all runs", "wheel_distance_m"] == pytest.approx(truth[3], rel=0.01)
    assert figures["four wheels", geometry_logs.LARGEST] is None
    assert [path.name for path in result.pictures] == ["optiodom_three_wheel.png"]
    assert (out / "optiodom_three_wheel.png").read_bytes().startswith(b"\x89PNG")
