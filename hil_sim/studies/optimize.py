# SPDX-License-Identifier: MIT
"""Optimise: the parameters that make a number of many runs smallest, within constraints, checked on fresh seeds.

Resuming plays the optimisation again from its start. The sampler is deterministic and finds the finished runs in the
store. So an interrupted optimisation ends where an uninterrupted one does.
"""

from __future__ import annotations

import csv
import io
import json
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.limits import SAMPLERS
from hil_sim.scenario import Scenario
from hil_sim.studies import engine
from hil_sim.studies.errors import StudyError, StudyInputError
from hil_sim.studies.figures import COMPLETED, Constraint, Number
from hil_sim.studies.folder import Definition, StudyFolder
from hil_sim.studies.plan import Point, check_plan
from hil_sim.studies.pools import Pool
from hil_sim.studies.space import Axis
from hil_sim.studies.study import Progress, Runner, base_definition, no_progress
from hil_sim.studies.study_summary import summarise
from omni_schema import SchemaError
from omniwheel import files, parameter_file
from omniwheel.errors import MissingPackageError, OmniError
from omniwheel.number_text import finite

BEST_FILE = "best.toml"
SUMMARY_FILE = "summary.json"
TRIALS_FILE = "trials.csv"
PICTURE_FILE = "history.png"
ALL_COMPLETED = Constraint(Number(COMPLETED, "mean"), upper=False, bound=1.0)
"""Holds unless the user constrains completion: a robot that gives up early has small errors."""

_WORSE = 1e6
_REFUSED = 1e9
"""What the samplers are told instead of a value: infeasible trials rank behind all feasible ones, refused ones last."""


@dataclass(frozen=True)
class Plan:
    """What is wanted: ``trials`` parameter sets, ``runs`` runs each with the same seeds, and a check on others."""

    scenario: Scenario
    axes: Sequence[Axis]
    minimise: Number
    constraints: Sequence[Constraint]
    trials: int
    runs: int
    first_seed: int
    batch_runs: int
    sampler: str = "tpe"

    @property
    def bounds(self) -> tuple[Constraint, ...]:
        """The constraints that hold."""
        own = tuple(self.constraints)
        return own if any(entry.number.figure == COMPLETED for entry in own) else (*own, ALL_COMPLETED)

    def definition(self) -> Definition:
        """Return what the numbers depend on; how many trials and runs is not part of it."""
        content = {
            **base_definition(self.scenario, self.first_seed, self.batch_runs),
            "axes": [[axis.name, axis.low, axis.high, axis.log] for axis in self.axes],
            "minimise": str(self.minimise),
            "constraints": [str(bound) for bound in self.bounds],
            "sampler": self.sampler,
            "optuna": _optuna().__version__,
        }
        return Definition("optimize", content)


@dataclass(frozen=True)
class Trial:
    """A parameter set that was tried. ``violation`` is 0 if all constraints hold, ``refusal`` why it cannot run."""

    number: int
    values: dict[str, float]
    objective: float
    violation: float
    broken: str = ""
    refusal: str = ""

    @property
    def feasible(self) -> bool:
        """Whether it may be the best."""
        return not self.refusal and self.violation <= 0.0 and math.isfinite(self.objective)


@dataclass(frozen=True)
class Side:
    """The scenario's own parameters or the best ones, judged by fresh seeds; None: they could not be run there."""

    values: dict[str, float]
    objective: float
    summary: dict[str, Any] | None
    feasible: bool


@dataclass(frozen=True)
class Outcome:
    """What came of it; ``best`` is among the trials."""

    trials: tuple[Trial, ...]
    best: Trial
    before: Side
    after: Side
    fresh_seeds: tuple[int, int]


Told = Callable[[Trial, Trial | None], None]
"""Called after every trial with it and the best one so far."""


def open_study(plan: Plan, path: Path, *, fresh: bool = False) -> StudyFolder:
    """Check the plan and open its folder. Raises StudyError, CoreError, MissingPackageError."""
    check_plan(plan.scenario, plan.first_seed, 2 * plan.runs, plan.batch_runs)
    if plan.sampler not in SAMPLERS:
        raise StudyInputError(f"unknown sampler {plan.sampler}; known are {', '.join(SAMPLERS)}")
    for axis in plan.axes:
        if axis.of_the_world or axis.named:
            what = "is a number of the world, not of the robot" if axis.of_the_world else "is not a range"
            raise StudyInputError(
                f"{axis.name} {what}: it cannot be optimised", hint="write NAME=LOW:HIGH or NAME=LOW:HIGH:log"
            )
    return StudyFolder(path, plan.definition(), engine.ROW, plan.batch_runs, fresh=fresh)


def run_study(
    plan: Plan, folder: StudyFolder, pool: Pool, progress: Progress = no_progress, told: Told = lambda trial, best: None
) -> Outcome:
    """Optimise, check the result, and write it. Raises StudyError if no trial keeps the constraints."""
    runner = Runner(folder.store, pool, plan.batch_runs, progress)
    trials = _search(plan, runner, told)
    files.write_text(folder.path / TRIALS_FILE, trial_table(plan, trials))
    best = _best(trials)
    if best is None:
        for stale in (BEST_FILE, SUMMARY_FILE, PICTURE_FILE):  # of fewer runs or before --fresh: no longer true
            (folder.path / stale).unlink(missing_ok=True)
        nearest = min(trials, key=lambda trial: trial.violation)
        why = nearest.refusal or nearest.broken
        raise StudyError(
            f"none of {len(trials)} trials keeps the constraints; the nearest: {why}",
            hint=f"{_remedy(plan, why)}; all trials are in {folder.path / TRIALS_FILE}",
        )
    first = plan.first_seed + plan.runs
    before, after = (_judge(plan, runner, values, first) for values in (_present(plan), best.values))
    outcome = Outcome(tuple(trials), best, before, after, (first, first + plan.runs - 1))
    _write(plan, folder.path, outcome)
    return outcome


def _remedy(plan: Plan, why: str) -> str:
    if ALL_COMPLETED in plan.bounds and str(ALL_COMPLETED) in why:
        return f'runs that end early (--duration, an event) never reach their end: constrain "{COMPLETED}.mean>=0"'
    return "loosen a constraint, widen a range or use more --trials"


def _search(plan: Plan, runner: Runner, told: Told) -> list[Trial]:
    optuna = _optuna()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # constraints are marked experimental in some versions
        study = optuna.create_study(sampler=_sampler(plan))
        start = {name: value for name, value in _present(plan).items() if _inside(plan, name, value)}
        if len(start) == len(plan.axes):
            study.enqueue_trial(start)
        trials: list[Trial] = []
        for number in range(plan.trials):
            asked = study.ask()
            trial = _try(plan, runner, number, {axis.name: _suggest(asked, axis) for axis in plan.axes})
            trials.append(trial)
            asked.set_user_attr("violation", min(trial.violation, _REFUSED))
            study.tell(asked, _reported_value(trial))
            told(trial, _best(trials))
    return trials


def _reported_value(trial: Trial) -> float:
    if trial.feasible:
        return trial.objective
    return min(_WORSE * (1.0 + trial.violation), _REFUSED)


def _suggest(asked: Any, axis: Axis) -> float:
    if axis.whole:
        return float(asked.suggest_int(axis.name, int(axis.low), int(axis.high), log=axis.log))
    value = float(np.float32(asked.suggest_float(axis.name, axis.low, axis.high, log=axis.log)))
    return min(max(value, axis.low), axis.high)


def _sampler(plan: Plan) -> Any:
    samplers, seed = _optuna().samplers, plan.first_seed % 2**32
    if plan.sampler == "cmaes":
        _need("cmaes")
        return samplers.CmaEsSampler(seed=seed, warn_independent_sampling=False)
    if plan.sampler == "random":
        return samplers.RandomSampler(seed=seed)
    return samplers.TPESampler(seed=seed, constraints_func=_constraints)


def _constraints(trial: Any) -> tuple[float]:
    return (float(trial.user_attrs["violation"]),)


def _try(plan: Plan, runner: Runner, number: int, values: dict[str, float]) -> Trial:
    try:
        point = Point(plan.scenario, values)
        core.robot_config(point.applied().parameter_values(), plan.scenario.robot.table, 0)
        refused = runner.complete([point], plan.first_seed, plan.runs)
        refusal = refused[0].refusal if refused else ""
    except (OmniError, SchemaError) as error:
        if isinstance(error, StudyError):
            raise
        refusal = str(error)
    if refusal:
        return Trial(number, values, math.nan, math.inf, refusal=refusal)
    rows = runner.rows(point, plan.first_seed, plan.runs)
    violation, broken = _violation(plan, rows)
    objective = plan.minimise.of(rows)
    return Trial(number, values, objective, violation if math.isfinite(objective) else math.inf, broken)


def _violation(plan: Plan, rows: NDArray[Any]) -> tuple[float, str]:
    """Return the sum of what is missed, each relative to its bound, and the broken constraints in words."""
    total, broken = 0.0, []
    for bound in plan.bounds:
        missed = bound.violation(rows)
        if missed > 0.0:
            total += missed / (abs(bound.bound) or 1.0)
            broken.append(f"{bound} is {bound.number.of(rows):.4g}")
    return total, "; ".join(broken)


def _best(trials: Sequence[Trial]) -> Trial | None:
    feasible = [trial for trial in trials if trial.feasible]
    return min(feasible, key=lambda trial: (trial.objective, trial.number)) if feasible else None


def _present(plan: Plan) -> dict[str, float]:
    own = plan.scenario.parameter_values()
    return {axis.name: own[axis.name] for axis in plan.axes}


def _inside(plan: Plan, name: str, value: float) -> bool:
    axis = next(axis for axis in plan.axes if axis.name == name)
    return axis.low <= value <= axis.high


def _judge(plan: Plan, runner: Runner, values: dict[str, float], first_seed: int) -> Side:
    point = Point(plan.scenario, values)
    if runner.complete([point], first_seed, plan.runs):
        return Side(values, math.nan, None, False)
    rows = runner.rows(point, first_seed, plan.runs)
    return Side(values, plan.minimise.of(rows), summarise(rows), _violation(plan, rows)[0] <= 0.0)


def trial_table(plan: Plan, trials: Sequence[Trial]) -> str:
    """Return a CSV with a line per trial."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [axis.name for axis in plan.axes]
    writer.writerow(["trial", *names, str(plan.minimise), "feasible", "broken", "refused"])
    for trial in trials:
        values = [parameter_file.shortest(trial.values[name]) for name in names]
        objective = repr(trial.objective) if math.isfinite(trial.objective) else ""
        writer.writerow([trial.number, *values, objective, int(trial.feasible), trial.broken, trial.refusal])
    return out.getvalue()


def document(plan: Plan, outcome: Outcome) -> dict[str, Any]:
    """Return the optimisation as plain data."""
    best = outcome.best
    return {
        "scenario": plan.scenario.name,
        "description": plan.scenario.description,
        "engine": engine.identity(),
        "minimise": str(plan.minimise),
        "constraints": [str(bound) for bound in plan.bounds],
        "sampler": plan.sampler,
        "trials": len(outcome.trials),
        "feasible_trials": sum(trial.feasible for trial in outcome.trials),
        "runs_per_trial": plan.runs,
        "best": {"trial": best.number, "values": best.values, "objective": best.objective},
        "fresh_seeds": list(outcome.fresh_seeds),
        **{
            word: {"values": s.values, "objective": s.objective, "feasible": s.feasible, "summary": s.summary}
            for word, s in (("before", outcome.before), ("after", outcome.after))
        },
    }


def _write(plan: Plan, path: Path, outcome: Outcome) -> None:
    text = json.dumps(finite(document(plan, outcome)), indent=1, allow_nan=False)
    files.write_text(path / SUMMARY_FILE, text + "\n")
    parameter_file.write(path / BEST_FILE, outcome.best.values, plan.scenario.robot.table)


def _optuna() -> Any:
    return _need("optuna")


def _need(module: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        hint = "pip install 'omniwheel[optimize]', or in a clone: make setup"
        raise MissingPackageError(f"omni optimize needs {module}, which is not installed", hint=hint) from error
