# SPDX-License-Identifier: MIT
"""The report's models beside each other: energy that is accounted for, agreement where it must be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from omni_reproduce import models
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.plant_runs import Case, simulate

SPEC = read_spec("models")
SPEC["drive"]["duration_s"] = 0.8
ROBOTS = SPEC["experiment"]["robots"]


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("plant", ["full", "slip", "linear"])
def test_the_ledger_closes(robot: str, plant: str) -> None:
    found = simulate(SPEC, Case(robot, plant, 1))
    assert found.taken_J > 1.0
    assert found.spent_J.sum() == pytest.approx(found.taken_J, rel=1e-3)
    assert (found.spent_J >= 0.0).all()


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("plant", ["slip", "linear", "kinematic+motors", "kinematic"])
def test_plants_agree_where_they_must_and_differ_where_they_leave_something_out(robot: str, plant: str) -> None:
    full, light = (simulate(SPEC, Case(robot, "full", 2, limit)) for limit in (False, True))
    other, other_light = (simulate(SPEC, Case(robot, plant, 2, limit)) for limit in (False, True))
    way = np.hypot(*np.diff(light.pose[:, :2], axis=0).T).sum()
    # Even a light body needs some microseconds where the kinematic plant needs none.
    assert np.hypot(*(other_light.pose - light.pose)[:, :2].T).max() < 3e-4 * way
    assert np.hypot(*(other.pose - full.pose)[:, :2].T).max() > 1e-3 * way


def test_every_hold_has_both_its_ends() -> None:
    found = simulate(SPEC, Case("three_wheel", "full", 1))
    repeated = np.flatnonzero(np.diff(found.time_s) == 0.0)
    assert len(repeated) == 1
    assert (found.pose[repeated] == found.pose[repeated + 1]).all()
    assert found.time_s[-1] == pytest.approx(0.8)


@pytest.mark.full
def test_rows_and_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(models, "read_spec", lambda name: SPEC)
    result = models.run(Context(tmp_path, seeds=2))
    (picture,) = result.pictures
    assert picture.stat().st_size > 20_000
    for robot in ROBOTS:
        missing = [row for row in result.rows if row.quantity == "energy: not accounted for" and robot in row.setting]
        assert [row.seeds for row in missing] == [2, 2, 2]
        assert max(abs(row.ours or 0.0) for row in missing) < 0.1
        limit = next(row for row in result.rows if row.setting == f"{robot}, light and held fast")
        assert limit.ours is not None
        assert limit.ours < 0.03
