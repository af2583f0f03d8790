# SPDX-License-Identifier: MIT
"""Gets a study's batches done: takes what the store has, lets a pool do the rest, keeps each as soon as it is there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil_sim.scenario import Scenario
from hil_sim.scenario_file import scenario_document
from hil_sim.studies import engine
from hil_sim.studies.errors import StudyError
from hil_sim.studies.plan import Batch, Point, batches
from hil_sim.studies.pools import Done, Pool
from hil_sim.studies.store import BatchStore

TICKS_PER_S = 1000


class Progress(Protocol):
    """Is told of runs as they get done."""

    def __call__(self, runs: int, simulated_s: float, *, kept: bool) -> None:
        """Take note of so many runs; ``kept``: an earlier session did them."""


def no_progress(runs: int, simulated_s: float, *, kept: bool) -> None:
    """Report no progress."""


def base_definition(scenario: Scenario, first_seed: int, batch_runs: int) -> dict[str, Any]:
    """Return what every kind of study is defined by."""
    document = scenario_document(scenario)
    document["scenario"].pop("seed")
    return {
        "first_seed": first_seed,
        "batch": batch_runs,
        "engine": engine.identity(),
        **document,
        "robot": scenario.parameter_values(),
        "robot_numbers": [_numbers(robot) for robot in (scenario.robot, scenario.world_robot) if robot is not None],
    }


def _numbers(robot: Any) -> dict[str, Any]:
    return {name: dict(getattr(robot, name)) for name in ("geometry", "encoder", "motor", "wiring", "simulation")}


class Runner:
    """Runs points of a study and returns their rows."""

    def __init__(self, store: BatchStore, pool: Pool, batch_runs: int, progress: Progress = no_progress) -> None:
        self._store = store
        self._pool = pool
        self._batch_runs = batch_runs
        self._progress = progress

    def complete(self, points: Sequence[Point], first_seed: int, runs: int) -> dict[int, Done]:
        """Do what is not yet done of these points.

        Returns by the number of the point why some of them cannot be run. Raises StudyError for what no study survives.
        """
        refused: dict[int, Done] = {}
        numbers = {id(point): number for number, point in enumerate(points)}
        missing = [batch for point in points for batch in self._missing(point, first_seed, runs)]
        todo = (batch for batch in missing if numbers[id(batch.point)] not in refused)
        for done in self._pool.results(todo):
            if done.refusal:
                refused.setdefault(numbers[id(done.batch.point)], done)
                continue
            self._store.put(done.batch.key, done.rows)
            self._progress(len(done.rows), float(np.sum(done.rows["ticks"])) / TICKS_PER_S, kept=False)
        return refused

    def _missing(self, point: Point, first_seed: int, runs: int) -> Iterator[Batch]:
        for batch in batches(point, first_seed, runs, self._batch_runs):
            if self._store.holds(batch.key, batch.runs):
                self._progress(batch.runs, 0.0, kept=True)
            else:
                yield batch

    def rows(self, point: Point, first_seed: int, runs: int) -> NDArray[Any]:
        """Return a completed point's rows by seed."""
        rows = np.empty(runs, engine.ROW)
        at = 0
        for batch in batches(point, first_seed, runs, self._batch_runs):
            rows[at : at + batch.runs] = self._store.get(batch.key, batch.runs)
            at += batch.runs
        return rows

    def one(self, point: Point, first_seed: int, runs: int) -> NDArray[Any]:
        """Complete one point and return its rows; StudyError if it cannot be run."""
        refused = self.complete([point], first_seed, runs)
        if refused:
            raise StudyError(f"{refused[0].batch} cannot be run: {refused[0].refusal}", hint=refused[0].hint)
        return self.rows(point, first_seed, runs)
