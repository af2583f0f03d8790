# SPDX-License-Identifier: MIT
"""``omni identify geometry`` as a user types it: logs without a header line, poses in the log or beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.logs.importer import import_log
from omniwheel.logs.mapping import read_mapping
from omniwheel.robots import read_robot
from tests.host.pose_fit.files import MAPPING, ROBOT, table
from tests.host.pose_fit.robots import COUNTS, THREE, drive, true_values


def omni(*arguments: object, code: int = 0) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return result.output if code else result.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("geometry")
    (folder / "robot.toml").write_text(ROBOT, encoding="utf-8")
    for unit in ("counts", "turns"):
        (folder / f"{unit}.toml").write_text(MAPPING.replace("UNIT", unit), encoding="utf-8")
    for seed in range(4):
        log = drive(THREE, true_values(THREE, 5), seed)
        day = folder / f"day{seed % 2}"
        day.mkdir(exist_ok=True)
        (day / f"run{seed}.csv").write_text(table(log, log.counts), encoding="utf-8")
    return folder


@pytest.mark.full
def test_counts_and_poses_suffice(folder: Path, tmp_path: Path) -> None:
    logs = sorted(folder.glob("day*/*.csv"))
    out = tmp_path / "found.toml"
    told = json.loads(
        omni("identify", "geometry", *logs, "--mapping", folder / "counts.toml", "--robot", folder / "robot.toml",
             "--out", out, "--json")
    )  # fmt: skip
    truth = dict(zip(THREE.names, true_values(THREE, 5), strict=True))
    for name in ("wheel_1_radius_m", "wheel_distance_m", "tracked_x_m"):
        entry = told["geometry"][name]
        assert entry["value"] == pytest.approx(truth[name], rel=0.05)
        assert 0.0 < entry["half_width_95"] < 0.1 * abs(entry["value"])
    assert sorted(len(names) for names in told["left_out_together"].values()) == [2, 2]
    nominal, held_out = told["held_out"]["nominal"], told["held_out"]["held_out"]
    for measure in ("largest_m", "rms_m", "final_m", "heading_rad", "per_metre"):
        assert held_out[measure]["largest"] < 0.5 * nominal[measure]["largest"]
    found = read_robot(out).parameter_values()
    assert found["WHEEL_RADIUS"] * found["W1_RSCALE"] == pytest.approx(truth["wheel_1_radius_m"], rel=5e-3)
    assert found["WHEEL_DIST"] == pytest.approx(truth["wheel_distance_m"], rel=5e-3)


@pytest.mark.full
def test_the_text_names_before_and_after_and_the_split(folder: Path) -> None:
    logs = sorted(folder.glob("day0/*.csv"))
    text = omni("identify", "geometry", *logs, "--mapping", folder / "counts.toml", "--robot", folder / "robot.toml")
    for part in ("wheel_distance_m", "left out", "median", "documented"):
        assert part in text


def test_wrong_options_are_refused_before_anything_is_fitted(folder: Path, tmp_path: Path) -> None:
    logs = sorted(folder.glob("day0/*.csv"))
    used = ("--mapping", folder / "counts.toml", "--robot", folder / "robot.toml")
    omni("identify", "geometry", *logs, *used, "--truth", logs[0], code=2)
    omni("identify", "geometry", *logs, *used, "--out", tmp_path / "missing" / "out.toml", code=2)
    plain = tmp_path / "plain.toml"
    plain.write_text(
        (folder / "counts.toml").read_text(encoding="utf-8").replace("in_log = true", ""), encoding="utf-8"
    )
    text = omni("identify", "geometry", *logs, "--mapping", plain, "--robot", folder / "robot.toml", code=2)
    assert "truth" in text


def test_turns_of_a_wheel_are_counts_per_revolution(folder: Path, tmp_path: Path) -> None:
    log = drive(THREE, true_values(THREE, 5), 1)
    path = tmp_path / "turns.csv"
    path.write_text(table(log, log.counts / COUNTS), encoding="utf-8")
    read, _ = import_log(path, read_mapping(folder / "turns.toml"))
    np.testing.assert_allclose(read.counts, log.counts, atol=1e-4)
    assert read.require_truth().same_clock
