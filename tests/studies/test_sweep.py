# SPDX-License-Identifier: MIT
"""Sweeps: the same seeds at every point, the same bytes from every pool."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import pytest

from hil_sim.scenario import Scenario
from hil_sim.studies.figures import parse_number
from hil_sim.studies.pools import LocalPool, Pool
from hil_sim.studies.space import grid, parse_axes
from hil_sim.studies.sweep import Plan, PointResult, open_study, run_study


def make(quick: Scenario, *words: str, runs: int = 8) -> Plan:
    axes = parse_axes(words, quick.robot.table)
    return Plan(quick, axes, grid(axes, quick), runs, 3, 8, parse_number("position_m.mean"))


def do(plan: Plan, folder: Path, pool: Pool) -> list[PointResult]:
    with open_study(plan, folder) as study:
        return run_study(plan, study, pool)


def test_points_differ_by_their_settings_alone(quick: Scenario, tmp_path: Path) -> None:
    plan = make(quick, "world.slip_max=0:0.4:2", "ISMC_LAM_XY=4,8")
    results = do(plan, tmp_path / "a", LocalPool(2))
    (alone,) = do(make(quick, "world.slip_max=0.4", "ISMC_LAM_XY=8"), tmp_path / "b", LocalPool(1))
    assert results[3].summary == alone.summary
    assert len({result.shown for result in results}) == 4
    with (plan.results_folder(tmp_path / "a") / "points.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [float(line["position_m.mean"]) for line in table] == [result.shown for result in results]
    assert [float(line["world.slip_max"]) for line in table] == [0.0, 0.0, 0.4, 0.4]


def test_interrupted_and_longer_sweeps_end_alike(
    quick: Scenario, tmp_path: Path, interrupted_after: Callable[[int], Pool]
) -> None:
    plan = make(quick, "ISMC_LAM_XY=2:20:3")
    with pytest.raises(KeyboardInterrupt):
        do(plan, tmp_path / "cut", interrupted_after(1))
    do(plan, tmp_path / "cut", LocalPool(2))
    do(plan, tmp_path / "whole", LocalPool(1))
    for name in ("points.csv", "summary.json"):
        cut, whole = (plan.results_folder(tmp_path / study) / name for study in ("cut", "whole"))
        assert cut.read_bytes() == whole.read_bytes()


def test_another_sweep_in_the_same_study_leaves_the_first_ones_results(quick: Scenario, tmp_path: Path) -> None:
    first, second = make(quick, "ISMC_LAM_XY=2:20:2"), make(quick, "WS_P=1,2")
    do(first, tmp_path / "study", LocalPool(1))
    kept = (first.results_folder(tmp_path / "study") / "points.csv").read_bytes()
    do(second, tmp_path / "study", LocalPool(1))
    assert (first.results_folder(tmp_path / "study") / "points.csv").read_bytes() == kept
    assert b"WS_P" in (second.results_folder(tmp_path / "study") / "points.csv").read_bytes()


def test_a_point_that_the_core_refuses_is_marked(quick: Scenario, tmp_path: Path) -> None:
    plan = make(quick, "W1_ANGLE=0,120,240")  # two of them are another wheel's: no motion but turning
    results = do(plan, tmp_path / "study", LocalPool(1))
    assert [bool(result.refusal) for result in results] == [False, True, True]
    assert results[0].summary is not None
    with (plan.results_folder(tmp_path / "study") / "points.csv").open() as file:
        assert [bool(line["refused"]) for line in csv.DictReader(file)] == [False, True, True]
