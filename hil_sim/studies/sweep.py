# SPDX-License-Identifier: MIT
"""Sweep: the same seeds at many settings, so that points differ by their settings and not by luck."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil_sim.scenario import Scenario
from hil_sim.studies import engine
from hil_sim.studies.figures import FIGURES, Number
from hil_sim.studies.folder import Definition, StudyFolder
from hil_sim.studies.plan import Point, check_plan
from hil_sim.studies.pools import Pool
from hil_sim.studies.space import Axis
from hil_sim.studies.study import Progress, Runner, base_definition, no_progress
from hil_sim.studies.study_summary import summarise
from omniwheel import files
from omniwheel.number_text import finite

SUMMARY_FILE = "summary.json"
TABLE_FILE = "points.csv"
PICTURE_FILE = "sweep.png"
_COLUMNS = ("mean", "sd", "median", "p5", "p95", "p99", "max")


@dataclass(frozen=True)
class Plan:
    """What is wanted: ``runs`` runs at each point, seeds ``first_seed`` on; ``shown`` is what the picture shows."""

    scenario: Scenario
    axes: Sequence[Axis]
    points: Sequence[Point]
    runs: int
    first_seed: int
    batch_runs: int
    shown: Number

    def results_folder(self, study: Path) -> Path:
        """Return where in the study's folder the results go. What was swept names it: sweeps share their runs only."""
        return study / "-".join(axis.name for axis in self.axes)

    def definition(self) -> Definition:
        """Return what the numbers depend on; the points are told apart by the batches' keys."""
        return Definition("sweep", base_definition(self.scenario, self.first_seed, self.batch_runs))


@dataclass(frozen=True)
class PointResult:
    """A point with its summary and the number that is shown; or why it could not be run."""

    point: Point
    shown: float
    summary: dict[str, Any] | None
    refusal: str = ""


def open_study(plan: Plan, path: Path, *, fresh: bool = False) -> StudyFolder:
    """Check the plan and open its folder. Raises StudyError, CoreError."""
    check_plan(plan.scenario, plan.first_seed, plan.runs, plan.batch_runs)
    return StudyFolder(path, plan.definition(), engine.ROW, plan.batch_runs, fresh=fresh)


def run_study(plan: Plan, folder: StudyFolder, pool: Pool, progress: Progress = no_progress) -> list[PointResult]:
    """Run all points and write summary and table, byte for byte equal for every pool of workers."""
    runner = Runner(folder.store, pool, plan.batch_runs, progress)
    refused = runner.complete(plan.points, plan.first_seed, plan.runs)
    results = []
    for number, point in enumerate(plan.points):
        if number in refused:
            results.append(PointResult(point, float("nan"), None, refused[number].refusal))
            continue
        rows = runner.rows(point, plan.first_seed, plan.runs)
        results.append(PointResult(point, plan.shown.of(rows), summarise(rows)))
    text = json.dumps(finite(document(plan, results)), indent=1, allow_nan=False)
    target = plan.results_folder(folder.path)
    _make(target)
    files.write_text(target / SUMMARY_FILE, text + "\n")
    files.write_text(target / TABLE_FILE, table(plan, results))
    return results


def _make(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise files.write_error(folder, error) from error


def document(plan: Plan, results: Sequence[PointResult]) -> dict[str, Any]:
    """Return the sweep as plain data."""
    return {
        "scenario": plan.scenario.name,
        "description": plan.scenario.description,
        "engine": engine.identity(),
        "seeds": [plan.first_seed, plan.first_seed + plan.runs - 1],
        "shown": str(plan.shown),
        "axes": [{"name": axis.name, "unit": axis.unit, "low": axis.low, "high": axis.high} for axis in plan.axes],
        "points": [
            {
                "values": dict(result.point.values),
                "shown": result.shown,
                **(result.summary or {"refused": result.refusal}),
            }
            for result in results
        ],
    }


def table(plan: Plan, results: Sequence[PointResult]) -> str:
    """Return a CSV with a line per point: its values, completion, and every figure's statistics in SI units."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [axis.name for axis in plan.axes]
    writer.writerow([*names, "completed_share", *(f"{f}.{c}" for f in FIGURES for c in _COLUMNS), "refused"])
    for result in results:
        values = [repr(result.point.values[name]) for name in names]
        writer.writerow([*values, *_numbers(result.summary), result.refusal])
    return out.getvalue()


def _numbers(summary: dict[str, Any] | None) -> list[str]:
    if summary is None:
        return [""] * (1 + len(FIGURES) * len(_COLUMNS))
    entries = (summary["figures"][name][column] for name in FIGURES for column in _COLUMNS)
    return [repr(summary["completed"]["share"]), *("" if entry is None else repr(entry) for entry in entries)]
