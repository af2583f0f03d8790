# SPDX-License-Identifier: MIT
"""Monte Carlo: one scenario, very many seeds; what spreads, how far, and the worst runs to be looked at again."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.scenario import Scenario, load_scenario
from hil_sim.scenario_file import write_scenario
from hil_sim.studies import engine
from hil_sim.studies.errors import StudyError
from hil_sim.studies.figures import FIGURES
from hil_sim.studies.folder import Definition, StudyFolder
from hil_sim.studies.plan import Point, check_plan
from hil_sim.studies.pools import Pool
from hil_sim.studies.study import Progress, Runner, base_definition, no_progress
from hil_sim.studies.study_summary import ranking, summarise
from omniwheel import files
from omniwheel.number_text import finite

ROWS_FILE = "runs.npy"
SUMMARY_FILE = "summary.json"
PICTURE_FILE = "spread.png"
WORST_FOLDER = "worst"


@dataclass(frozen=True)
class Plan:
    """What is wanted: seeds ``first_seed`` on, ``worst`` runs by ``worst_by`` kept as scenario files."""

    scenario: Scenario
    runs: int
    first_seed: int
    batch_runs: int
    worst: int = 5
    worst_by: str = "position_m"

    def definition(self) -> Definition:
        """Return what the numbers depend on."""
        return Definition("montecarlo", base_definition(self.scenario, self.first_seed, self.batch_runs))


@dataclass(frozen=True)
class Outcome:
    """What came of it. ``worst`` are the files of the worst runs, worst first."""

    summary: dict[str, Any]
    rows: NDArray[Any]
    worst: tuple[Path, ...]


def open_study(plan: Plan, path: Path, *, fresh: bool = False) -> StudyFolder:
    """Check the plan and open its folder. Raises StudyError, CoreError."""
    check_plan(plan.scenario, plan.first_seed, plan.runs, plan.batch_runs)
    return StudyFolder(path, plan.definition(), engine.ROW, plan.batch_runs, fresh=fresh)


def run_study(plan: Plan, folder: StudyFolder, pool: Pool, progress: Progress = no_progress) -> Outcome:
    """Do the study and write its results, byte for byte equal for every pool of workers."""
    runner = Runner(folder.store, pool, plan.batch_runs, progress)
    rows = runner.one(Point(plan.scenario), plan.first_seed, plan.runs)
    worst = _keep_worst(plan, rows, folder.path / WORST_FOLDER)
    summary = _summary(plan, rows, worst)
    with files.replaced(folder.path / ROWS_FILE) as file:
        np.save(file, rows)
    files.write_text(folder.path / SUMMARY_FILE, json.dumps(finite(summary), indent=2, allow_nan=False) + "\n")
    return Outcome(summary, rows, tuple(path for path, _ in worst))


def typical_runs(rows: NDArray[Any], figure: str) -> tuple[int, int] | None:
    """Return the numbers of the rows in the middle and at the worst end of those that have the figure, if any has."""
    order = [int(row) for row in ranking(rows, figure) if np.isfinite(rows[figure][row])]
    return (order[len(order) // 2], order[0]) if order else None


def _summary(plan: Plan, rows: NDArray[Any], worst: list[tuple[Path, int]]) -> dict[str, Any]:
    scenario = plan.scenario
    return {
        "scenario": scenario.name,
        "description": scenario.description,
        "robot": scenario.robot.name,
        "plant": scenario.plant,
        "seeds": [plan.first_seed, plan.first_seed + plan.runs - 1],
        "engine": engine.identity(),
        **summarise(rows),
        "worst_by": plan.worst_by,
        "worst": [
            {"file": f"{WORST_FOLDER}/{path.name}", **{name: rows[name][row].item() for name in ("seed", *FIGURES)}}
            for path, row in worst
        ],
    }


def _keep_worst(plan: Plan, rows: NDArray[Any], folder: Path) -> list[tuple[Path, int]]:
    """Write the worst runs as scenario files and run each again from its file: it must give the same row."""
    folder.mkdir(exist_ok=True)
    for old in folder.glob("*_seed_*.toml"):
        old.unlink()
    kept: list[tuple[Path, int]] = []
    if not np.any(np.isfinite(rows[plan.worst_by])):
        return kept
    for place, row in enumerate(ranking(rows, plan.worst_by)[: plan.worst], start=1):
        seed = int(rows["seed"][row])
        path = folder / f"{place:02d}_seed_{seed}.toml"
        write_scenario(plan.scenario.with_seed(seed), path, f"Number {place} of the worst runs by {plan.worst_by}.")
        if engine.run_rows(load_scenario(path), seed, 1).tobytes() != rows[row : row + 1].tobytes():
            raise StudyError(
                f"{path} does not reproduce its run",
                hint="this is a defect of omniwheel; please report it with the study's folder",
            )
        kept.append((path, int(row)))
    return kept
