# SPDX-License-Identifier: MIT
"""Real runs beside motion capture, one session left out at a time: better than documented. Skips without the data."""

from __future__ import annotations

from pathlib import Path

import pytest

from omniwheel.identification.pose_fit.scores import summary
from omniwheel.identification.pose_fit.study import identify_geometry
from omniwheel.identification.pose_fit.wheel_model import wheel_model
from omniwheel.identification.pose_fit.windows import run_of
from omniwheel.logs.importer import import_log
from omniwheel.logs.mapping import read_mapping
from omniwheel.robots import read_robot

ROOT = Path(__file__).resolve().parents[3]
DATA = ROOT.parent / "shared" / "data" / "optiodom"
ROBOTS = ROOT / "omni_reproduce" / "optiodom"


@pytest.mark.full
@pytest.mark.parametrize(
    ("data", "robot", "median_m", "largest_m"),
    [("omni3", "three_wheel", 0.09, 0.165), ("omni4", "four_wheel", 0.085, 0.14)],
)
def test_left_out_sessions_are_predicted_better_than_by_the_documented_geometry(
    data: str, robot: str, median_m: float, largest_m: float
) -> None:
    paths = sorted((DATA / data).glob("*/*/*run-*.csv"))
    if not paths:
        pytest.skip(f"no logs in {DATA / data}")
    mapping = read_mapping(ROBOTS / f"{robot}_mapping.toml")
    layout = wheel_model(read_robot(ROBOTS / f"{robot}.toml"))
    study = identify_geometry(
        [run_of(import_log(path, mapping)[0], path.parent.name, layout) for path in paths], layout
    )
    nominal = summary([run.nominal for run in study.held_out], lambda run: run.largest_m)
    found = summary([run.identified for run in study.held_out], lambda run: run.largest_m)
    assert found.median < min(median_m, 0.65 * nominal.median)
    assert found.largest < min(largest_m, 0.65 * nominal.largest)
    # Two wheels of the four-wheel robot roll nearly one way only in these runs.
    assert all(refusal.name.endswith("direction") for refusal in study.whole.refused)
