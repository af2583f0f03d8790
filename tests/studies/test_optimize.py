# SPDX-License-Identifier: MIT
"""Optimisation: deterministic, taken up where it was left, within its constraints, and loadable."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hil_sim.scenario import Scenario
from hil_sim.studies import optimize
from hil_sim.studies.errors import StudyError, StudyInputError
from hil_sim.studies.figures import parse_constraint, parse_number
from hil_sim.studies.folder import DEFINITION_FILE
from hil_sim.studies.optimize import BEST_FILE, Outcome, Plan, open_study, run_study
from hil_sim.studies.pools import LocalPool, Pool
from hil_sim.studies.space import parse_axes
from omniwheel.errors import MissingPackageError
from omniwheel.presets import read_preset

FILES = ("best.toml", "trials.csv", "summary.json")


@pytest.fixture
def plan(quick: Scenario) -> Plan:
    return Plan(
        scenario=quick,
        axes=parse_axes(["ISMC_LAM_XY=1:30:log", "TRJ_PETALS=3:8"], quick.robot.table),
        minimise=parse_number("peak_duty.mean"),
        constraints=(parse_constraint("completed>=0"),),
        trials=12,
        runs=8,
        first_seed=2,
        batch_runs=8,
    )


def do(plan: Plan, folder: Path, pool: Pool) -> Outcome:
    with open_study(plan, folder) as study:
        return run_study(plan, study, pool)


def same(first: Path, second: Path) -> bool:
    return all((first / name).read_bytes() == (second / name).read_bytes() for name in FILES)


@pytest.mark.full
@pytest.mark.parametrize("sampler", ["tpe", "cmaes"])
def test_workers_and_interruptions_change_nothing(
    plan: Plan, tmp_path: Path, interrupted_after: Callable[[int], Pool], sampler: str
) -> None:
    plan = replace(plan, sampler=sampler)
    one = do(plan, tmp_path / "one", LocalPool(1))

    class Cut(LocalPool):
        trials = 0

        def results(self, batches: Any) -> Any:
            self.trials += 1
            if self.trials > 5:
                raise KeyboardInterrupt
            return super().results(batches)

    with pytest.raises(KeyboardInterrupt):
        do(plan, tmp_path / "two", Cut(2))
    two = do(plan, tmp_path / "two", LocalPool(2))
    assert same(tmp_path / "one", tmp_path / "two")
    assert two.trials == one.trials
    assert one.best.objective == min(trial.objective for trial in one.trials)
    assert len({trial.values["ISMC_LAM_XY"] for trial in one.trials}) > 10


def test_the_first_trial_is_the_scenario_itself_and_the_best_can_be_loaded(plan: Plan, tmp_path: Path) -> None:
    outcome = do(plan, tmp_path / "study", LocalPool(2))
    assert outcome.trials[0].values == outcome.before.values == {"ISMC_LAM_XY": 4.0, "TRJ_PETALS": 8.0}
    assert read_preset(tmp_path / "study" / "best.toml", plan.scenario.robot.table).parameters == outcome.best.values
    assert outcome.fresh_seeds == (10, 17)
    assert outcome.after.objective < outcome.before.objective


@pytest.mark.full
def test_the_best_keeps_the_constraints(plan: Plan, tmp_path: Path) -> None:
    free = do(plan, tmp_path / "free", LocalPool(2))
    bound = sorted(trial.objective for trial in free.trials)[6]
    tight = replace(plan, constraints=(*plan.constraints, parse_constraint(f"peak_duty.mean>={bound!r}")))
    outcome = do(tight, tmp_path / "tight", LocalPool(2))
    assert outcome.best.objective >= bound > free.best.objective
    assert 0 < sum(not trial.feasible for trial in outcome.trials) < len(outcome.trials)
    assert all(f"peak_duty.mean >= {bound:g}" in trial.broken for trial in outcome.trials if not trial.feasible)


def test_refused_sets_are_infeasible_and_nothing_feasible_is_an_error(plan: Plan, tmp_path: Path) -> None:
    axes = parse_axes(["W1_ANGLE=100:140"], plan.scenario.robot.table)
    refused = replace(plan, axes=axes, trials=4)
    outcome = do(refused, tmp_path / "angles", LocalPool(2))
    assert len(outcome.trials) == 4
    hopeless = replace(plan, constraints=(parse_constraint("peak_duty.mean<=0"),), trials=3)
    with pytest.raises(StudyError, match="none of 3 trials"):
        do(hopeless, tmp_path / "hopeless", LocalPool(2))
    (tmp_path / "early").mkdir()
    for stale in (BEST_FILE, DEFINITION_FILE):
        (tmp_path / "early" / stale).write_text("of another study")
    with (
        pytest.raises(StudyError, match=r"completed\.mean") as caught,
        open_study(replace(plan, constraints=(), trials=2), tmp_path / "early", fresh=True) as study,
    ):
        run_study(replace(plan, constraints=(), trials=2), study, LocalPool(2))
    assert caught.value.hint is not None
    assert "--duration" in caught.value.hint
    assert not (tmp_path / "early" / BEST_FILE).exists()
    assert (tmp_path / "hopeless" / "trials.csv").read_text().count("\n") == 4


def test_only_a_range_of_a_parameter_can_be_searched(plan: Plan, tmp_path: Path) -> None:
    table = plan.scenario.robot.table
    for word in ("world.slip_max=0:0.1", "CTL_MODE=pid,ismc"):
        with pytest.raises(StudyInputError, match="cannot be optimised"):
            open_study(replace(plan, axes=parse_axes([word], table)), tmp_path / "study")
    with pytest.raises(StudyInputError, match="unknown sampler"):
        open_study(replace(plan, sampler="luck"), tmp_path / "study")
    assert not (tmp_path / "study").exists()


def test_without_optuna_it_says_what_to_install(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(optimize, "import_module", refuse)
    with pytest.raises(MissingPackageError) as caught:
        open_study(plan, tmp_path / "study")
    assert "omniwheel[optimize]" in caught.value.hint
