# SPDX-License-Identifier: MIT
"""A run as one object: recorded since the connection, saved, and read back from any kind of log."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import omniwheel
from hil_sim.hil import run_hil
from hil_sim.scenario import load_scenario
from hil_sim.summary import save_run, summarize
from omniwheel import Run, sync
from omniwheel.errors import LogError, MissingPackageError, OutputPathError
from omniwheel.robot import connect
from omniwheel.run import COLUMNS
from tests.host.conftest import FakeRobot

KINDS = (".csv", ".npz", ".tlog")


@pytest.fixture(scope="module")
def run() -> Run:
    with sync.simulate() as robot:
        robot.arm()
        robot.drive(0.2, 0.0, 0.5, duration=1.0)
        return robot.run


def test_everything_since_the_connection_is_there(run: Run) -> None:
    assert np.all(np.diff(run.time_s) > 0.0)
    assert np.median(np.diff(run.time_s)) == pytest.approx(0.02, abs=0.005)
    assert run.pose[-1, 2] == pytest.approx(0.5, abs=0.05)
    assert np.abs(run.wheel_rad_s).max() > 1.0
    assert any("armed" in what for _, what in run.events)
    way_m = run.numbers["way_m"]
    assert way_m is not None
    assert way_m == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize("ending", KINDS)
def test_what_is_saved_is_read_back(run: Run, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"drive{ending}"
    run.save(path)
    again = omniwheel.load(path)
    assert again.name == "drive"
    before, after = run.to_numpy(), again.to_numpy()
    for name in COLUMNS:
        np.testing.assert_array_equal(before[name], after[name])


@pytest.mark.full
def test_a_picture_is_drawn_into_a_file(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "drive.png")
    run.plot(tmp_path / "drive.svg", title="a curve")
    assert (tmp_path / "drive.png").read_bytes().startswith(b"\x89PNG")
    assert "<svg" in (tmp_path / "drive.svg").read_text(encoding="utf-8")


def test_bad_endings_and_missing_logs_are_refused(run: Run, tmp_path: Path) -> None:
    for name in ("drive.bag", "drive"):
        with pytest.raises(OutputPathError):
            run.save(tmp_path / name)
    run.save(tmp_path / "drive.csv")
    with pytest.raises(LogError):
        omniwheel.load(tmp_path / "drive.csv").save(tmp_path / "drive.tlog")
    (tmp_path / "other.csv").write_text("a,b\n1,2\n", encoding="utf-8")
    (tmp_path / "other.npz").write_bytes(b"no archive")
    for path in (tmp_path / "none.csv", tmp_path / "other.csv", tmp_path / "other.npz", tmp_path):
        with pytest.raises(LogError):
            omniwheel.load(path)


def test_pandas_gives_the_same_table_or_is_asked_for(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingPackageError):
        run.to_pandas()


@pytest.mark.full
def test_the_folder_of_a_simulated_run_is_a_run(tmp_path: Path) -> None:
    scenario = load_scenario("demo").with_duration(1.0)
    folder = tmp_path / "demo"
    made = run_hil(scenario)
    folder.mkdir()
    save_run(made, summarize(made), folder)
    found = omniwheel.load(folder)
    assert found.name == "demo"
    assert found.time_s[-1] > 0.9
    assert len(found.wheel_rad_s) == len(found.time_s)


def test_a_connection_that_is_not_recorded_says_so() -> None:
    fake = FakeRobot()
    with connect(fake, clock=fake.clock) as robot, pytest.raises(LogError):
        _ = robot.run
