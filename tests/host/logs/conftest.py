# SPDX-License-Identifier: MIT
"""Synthetic logs of a known robot, and where the real ones are."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from omni_schema import Robot
from omniwheel.logs.importer import import_log
from omniwheel.logs.log import WheelLog
from omniwheel.logs.mapping import Mapping, read_mapping
from omniwheel.robots import read_robot
from tests.host.logs import synthetic

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with mapping.toml, robot.toml, run1..3.csv and truth_run1..3.csv of the usual synthetic robot."""
    folder = tmp_path_factory.mktemp("synthetic")
    (folder / "mapping.toml").write_text(synthetic.MAPPING, encoding="utf-8")
    (folder / "robot.toml").write_text(synthetic.ROBOT, encoding="utf-8")
    for seed in (1, 2, 3):
        synthetic.write(folder, f"run{seed}", synthetic.Known(), seed)
    return folder


@pytest.fixture(scope="session")
def mapping(files: Path) -> Mapping:
    return read_mapping(files / "mapping.toml")


@pytest.fixture(scope="session")
def robot(files: Path) -> Robot:
    return read_robot(files / "robot.toml")


@pytest.fixture(scope="session")
def runs(files: Path, mapping: Mapping) -> list[WheelLog]:
    return [import_log(files / f"run{k}.csv", mapping, files / f"truth_run{k}.csv")[0] for k in (1, 2, 3)]


@pytest.fixture(scope="session")
def real_logs() -> Path:
    """The folder of the real robot's logs; skips where it is absent."""
    given = os.environ.get("OMNI_REAL_LOGS")
    folder = Path(given) if given else ROOT.parent / "shared" / "data" / "real_three_wheel"
    if not (folder / "run1.csv").is_file():
        pytest.skip(f"no real logs in {folder}; set OMNI_REAL_LOGS")
    return folder


@pytest.fixture(scope="session")
def real_runs() -> Path:
    """The folder of real runs with motion capture (see optiodom.py); skips where it is absent."""
    given = os.environ.get("OMNI_OPTIODOM")
    folder = Path(given) if given else ROOT.parent / "shared" / "data" / "optiodom"
    if not (folder / "omni3").is_dir():
        pytest.skip(f"no real runs in {folder}; set OMNI_OPTIODOM")
    return folder
