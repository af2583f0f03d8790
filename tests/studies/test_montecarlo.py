# SPDX-License-Identifier: MIT
"""A study's numbers are the scenario's and the seeds' alone: not the workers', the batches' or the interruptions'."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hil_sim import metrics
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.studies import montecarlo
from hil_sim.studies.errors import StudyError, StudyFolderError, StudyInputError
from hil_sim.studies.montecarlo import Outcome, Plan, open_study, run_study
from hil_sim.studies.plan import check_plan
from hil_sim.studies.pools import LocalPool, Pool

RUNS = 40
RESULTS = ("summary.json", "runs.npy", "study.json")


def do(plan: Plan, folder: Path, pool: Pool, *, fresh: bool = False) -> Outcome:
    with open_study(plan, folder, fresh=fresh) as study:
        return run_study(plan, study, pool)


@pytest.fixture
def plan(quick: Scenario) -> Plan:
    return Plan(quick, RUNS, 5, 8, worst=3)


def files(folder: Path) -> dict[str, bytes]:
    worst = {path.name: path.read_bytes() for path in (folder / "worst").iterdir()}
    return {**{name: (folder / name).read_bytes() for name in RESULTS}, **worst}


def test_the_bytes_do_not_depend_on_the_workers(plan: Plan, tmp_path: Path) -> None:
    for workers in (1, 2, 4):
        do(plan, tmp_path / str(workers), LocalPool(workers))
    assert files(tmp_path / "1") == files(tmp_path / "2") == files(tmp_path / "4")


def test_an_interrupted_study_goes_on_without_losing_a_batch(
    plan: Plan, tmp_path: Path, interrupted_after: Callable[[int], Pool], counting: Any
) -> None:
    with pytest.raises(KeyboardInterrupt):
        do(plan, tmp_path / "cut", interrupted_after(3))
    do(plan, tmp_path / "cut", counting)
    assert len(counting.asked) == RUNS // 8 - 3
    do(plan, tmp_path / "whole", LocalPool(1))
    assert files(tmp_path / "cut") == files(tmp_path / "whole")


def test_a_study_can_be_made_longer(plan: Plan, tmp_path: Path, counting: Any) -> None:
    do(Plan(plan.scenario, 20, 5, 8, worst=3), tmp_path / "grown", LocalPool(1))
    do(plan, tmp_path / "grown", counting)
    assert [batch.first_seed for batch in counting.asked] == [21, 29, 37]  # the cut batch is done again
    do(plan, tmp_path / "whole", LocalPool(1))
    assert files(tmp_path / "grown") == files(tmp_path / "whole")


def test_a_row_is_what_the_run_says(plan: Plan, tmp_path: Path) -> None:
    rows = do(plan, tmp_path / "study", LocalPool(2)).rows
    run = run_in_process(plan.scenario, 7)
    row = rows[rows["seed"] == 7][0]
    assert row["ticks"] == run.ticks
    assert row["position_m"] == pytest.approx(metrics.tracking_rmse(run.record).position_m, rel=1e-9)
    assert row["peak_wheel_rad_s"] == metrics.effort(run.record, 3).peak_wheel_rad_s


def test_the_worst_runs_can_be_driven_again(plan: Plan, tmp_path: Path) -> None:
    outcome = do(plan, tmp_path / "study", LocalPool(2))
    worst = outcome.rows[np.argsort(-outcome.rows["position_m"])[:3]]
    assert [entry["seed"] for entry in outcome.summary["worst"]] == worst["seed"].tolist()
    for path, row in zip(outcome.worst, worst, strict=True):
        again = run_in_process(load_scenario(path))
        assert again.scenario.seed == row["seed"]
        assert again.ticks == row["ticks"]
        error = metrics.pose_error(again.record[metrics.on_path(again.record)])
        assert math.hypot(*error[-1, :2]) == row["final_position_m"]
        assert np.max(np.abs(again.record["wheel_rad_s"][metrics.on_path(again.record)])) == row["peak_wheel_rad_s"]
        original = run_in_process(plan.scenario, int(row["seed"]))
        assert again.record.tobytes() == original.record.tobytes()


def test_a_worst_run_that_does_not_repeat_is_an_error(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = load_scenario("no_slip").with_duration(0.5)
    monkeypatch.setattr(montecarlo, "load_scenario", lambda path: other)
    with pytest.raises(StudyError, match="does not reproduce"):
        do(plan, tmp_path / "study", LocalPool(1))


def test_another_study_in_the_folder_is_refused_and_named(plan: Plan, tmp_path: Path) -> None:
    do(plan, tmp_path / "study", LocalPool(1))
    before = files(tmp_path / "study")
    others = {
        "ISMC_LAM_XY was 4.0, is 7.0": Plan(plan.scenario.with_parameters({"ISMC_LAM_XY": 7.0}), RUNS, 5, 8),
        "slip_max was 0.1, is 0.2": Plan(plan.scenario.with_world({"slip_max": 0.2}), RUNS, 5, 8),
        "first_seed was 5, is 6": Plan(plan.scenario, RUNS, 6, 8),
        "batch was 8, is 16": Plan(plan.scenario, RUNS, 5, 16),
    }
    for message, other in others.items():
        with pytest.raises(StudyFolderError, match=message):
            do(other, tmp_path / "study", LocalPool(1))
    assert files(tmp_path / "study") == before
    do(others["batch was 8, is 16"], tmp_path / "study", LocalPool(1), fresh=True)
    assert (
        json.loads(before["summary.json"])["figures"]
        == json.loads((tmp_path / "study" / "summary.json").read_text())["figures"]
    )


def test_a_folder_of_somebody_elses_is_left_alone(plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("important")
    for fresh in (False, True):
        with pytest.raises(StudyFolderError, match="no study"):
            open_study(plan, tmp_path, fresh=fresh)
    assert (tmp_path / "thesis.tex").read_text() == "important"


@pytest.mark.parametrize(("runs", "seed", "batch"), [(0, 1, 8), (8, 1, 12), (8, 1, 0), (8, 2**63 - 4, 8), (8, -1, 8)])
def test_plans_that_are_none(quick: Scenario, runs: int, seed: int, batch: int) -> None:
    with pytest.raises(StudyInputError):
        check_plan(quick, seed, runs, batch)


def test_an_endless_scenario_is_refused(quick: Scenario) -> None:
    endless = load_scenario("demo").with_parameters({"TRJ_LAPS": 0.0})
    with pytest.raises(StudyInputError, match="no end"):
        check_plan(endless, 1, 8, 8)
    check_plan(endless.with_duration(1.0), 1, 8, 8)
    check_plan(load_scenario("demo"), 1, 8, 8)
