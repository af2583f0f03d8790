# SPDX-License-Identifier: MIT
"""Counts that add up are kept: rows that come late, or uneven, are no spikes. What is dropped, replay tells."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni_schema import Robot
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog, save_log
from omniwheel.logs.mapping import SAMPLE_THRESHOLD, Spikes, read_mapping
from omniwheel.logs.spikes import reject_spikes
from omniwheel.replay import dropped_counts, replay
from tests.host.logs import optiodom, synthetic

KNOWN = synthetic.Known(
    forward_m=(0.03, 0.03, 0.03), reverse_m=(0.03, 0.03, 0.03), distance_m=0.1, noise_counts=0.0, spike_share=0.0
)
UNEVEN = synthetic.MAPPING.replace("[spikes]\nthreshold = 4.0\n", "")
HAMPEL = Spikes(threshold=SAMPLE_THRESHOLD)


@pytest.fixture(scope="module")
def even(tmp_path_factory: pytest.TempPathFactory) -> WheelLog:
    """A run without noise, each count in its own row."""
    folder = tmp_path_factory.mktemp("even")
    (folder / "mapping.toml").write_text(UNEVEN, encoding="utf-8")
    return import_log(synthetic.write(folder, "even", KNOWN, 1)[0], read_mapping(folder / "mapping.toml"))[0]


@pytest.fixture(scope="module")
def uneven(even: WheelLog) -> WheelLog:
    """The same run, read unevenly: every tenth row holds what it takes from the next."""
    counts = even.counts.copy()
    counts[10:-1:10] += counts[11::10][: len(counts[10:-1:10])]
    counts[11::10] = 0.0
    return replace(even, counts=counts)


def write_csv(log: WheelLog, folder: Path, extra: str = "") -> Path:
    """Write a log as increments with its mapping beside it; return the CSV file."""
    names = [f"w{wheel + 1}" for wheel in range(log.wheels)]
    text = f"""
[log]
name = "uneven"
period_s = {log.period_s:.6g}
[log.time]
column = "t"
[wheels]
columns = {json.dumps(names)}
quantity = "increment"
unit = "counts"
counts_per_revolution = {log.counts_per_revolution}
{extra}"""
    (folder / "mapping.toml").write_text(text, encoding="utf-8")
    table = np.column_stack((log.time_s, log.counts))
    path = folder / "uneven.csv"
    np.savetxt(path, table, delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.6f")
    return path


def test_no_count_that_adds_up_is_dropped_by_default(tmp_path: Path, even: WheelLog, uneven: WheelLog) -> None:
    path = write_csv(uneven, tmp_path)
    log, summary = import_log(path, read_mapping(tmp_path / "mapping.toml"))
    assert log.good.all()
    assert np.array_equal(log.counts.sum(axis=0), even.counts.sum(axis=0))
    assert max(summary.rejected_share) == 0.0
    assert min(summary.outlier_share) > 0.01, "that they are uneven is seen"


def test_a_mapping_may_still_reject_outliers(tmp_path: Path, uneven: WheelLog) -> None:
    path = write_csv(uneven, tmp_path, "[spikes]\nthreshold = 4.0\n")
    log, summary = import_log(path, read_mapping(tmp_path / "mapping.toml"))
    assert min(summary.rejected_share) > 0.01
    assert np.array_equal(log.good, reject_spikes(uneven, HAMPEL)[0])


def test_counts_of_samples_are_rejected_by_default(tmp_path: Path, even: WheelLog) -> None:
    (tmp_path / "mapping.toml").write_text(UNEVEN.replace("= 264", "= 264\nsample_s = 0.001"), encoding="utf-8")
    assert read_mapping(tmp_path / "mapping.toml").spikes == HAMPEL


def test_uneven_rows_do_not_bend_the_path(even: WheelLog, uneven: WheelLog, robot: Robot) -> None:
    kept = replace(uneven, good=reject_spikes(uneven, Spikes())[0])
    dropped = replace(uneven, good=reject_spikes(uneven, HAMPEL)[0])
    true, found, bent = (replay(log, robot, use_heading=False).pose for log in (even, kept, dropped))
    assert np.hypot(*(found - true)[-1, :2]) < 1e-3
    assert abs(found[-1, 2] - true[-1, 2]) < 1e-3
    assert np.abs(bent - true)[:, 2].max() > 0.05, "else this would show nothing"


def test_replay_tells_how_far_dropped_counts_bend_the_path(
    tmp_path: Path, uneven: WheelLog, robot: Robot, files: Path
) -> None:
    assert dropped_counts(uneven, replay(uneven, robot, use_heading=False), robot, use_heading=False) is None
    good = reject_spikes(uneven, HAMPEL)[0]
    log = replace(uneven, good=good)
    run = replay(log, robot, use_heading=False)
    whole, bent = replay(uneven, robot, use_heading=False).pose, run.pose
    told = dropped_counts(log, run, robot, use_heading=False)
    assert told is not None
    assert told.share == pytest.approx(1.0 - good.mean(axis=0))
    assert told.turned_rad == pytest.approx(np.abs(whole - bent)[:, 2].max())
    assert told.moved_m == pytest.approx(np.hypot(*(whole - bent)[:, :2].T).max())
    save_log(log, tmp_path / "log.npz")
    command = ["replay", str(tmp_path / "log.npz"), "--robot", str(files / "robot.toml"), "--no-heading", "--json"]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["dropped_counts"]["moved_m"] == pytest.approx(told.moved_m)


@pytest.mark.parametrize(
    ("name", "bent_m"), [("221220202235_run-08", 1.15), ("221220201934_run-07", 1.29), ("080920201205_run-02", 0.53)]
)
def test_real_counts_replay_to_their_plain_sum(tmp_path: Path, real_runs: Path, name: str, bent_m: float) -> None:
    """Dropped as outliers they bend these three runs, as docs/guides/logs.md says."""
    (path,) = real_runs.glob(f"*/*/*/{name}.csv")
    run, robot = optiodom.read_run(path), optiodom.documented_robot(path, tmp_path, EKF_MODE=1.0)
    log, _ = import_log(write_csv(run.log, tmp_path), read_mapping(tmp_path / "mapping.toml"))
    found = replay(log, robot).pose
    plain = optiodom.plain_sum(run, robot, start=np.zeros(3))
    assert np.hypot(*(found - plain)[:, :2].T).max() < 1e-3
    assert np.abs(found - plain)[:, 2].max() < 1e-3
    bent = replay(replace(log, good=reject_spikes(log, HAMPEL)[0]), robot).pose
    assert np.hypot(*(bent - plain)[:, :2].T).max() == pytest.approx(bent_m, rel=0.05)
