# SPDX-License-Identifier: MIT
"""What a study has to do: points (settings of one scenario) times consecutive seeds, cut into batches of one size."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from hil_sim import core
from hil_sim.limits import MAX_SEED
from hil_sim.scenario import Scenario
from hil_sim.studies.engine import RUNS_AT_ONCE
from hil_sim.studies.errors import StudyInputError
from hil_sim.studies.store import KEY_BYTES

WORLD_PREFIX = "world."


@dataclass(frozen=True)
class Point:
    """A scenario with some of its parameters (by name) and numbers of its world ("world.NAME") set to values."""

    scenario: Scenario
    values: Mapping[str, float] = field(default_factory=dict)

    def applied(self) -> Scenario:
        """Return the scenario with the values in it. Raises SchemaError."""
        own = {name: value for name, value in self.values.items() if not name.startswith(WORLD_PREFIX)}
        world = {name[len(WORLD_PREFIX) :]: value for name, value in self.values.items() if name not in own}
        return self.scenario.with_parameters(own).with_world(world)


@dataclass(frozen=True)
class Batch:
    """Some runs of a point: seeds ``first_seed`` to ``first_seed + runs - 1``."""

    point: Point
    first_seed: int
    runs: int

    @property
    def key(self) -> bytes:
        """Say which runs these are, the number of them and what all points have in common left out."""
        text = json.dumps([dict(self.point.values), self.first_seed], sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=KEY_BYTES).digest()

    def __str__(self) -> str:
        values = ", ".join(f"{name} = {value:g}" for name, value in self.point.values.items())
        seeds = f"seeds {self.first_seed} to {self.first_seed + self.runs - 1}"
        return f"{seeds} of {values}" if values else seeds


def batches(point: Point, first_seed: int, runs: int, batch_runs: int) -> Iterator[Batch]:
    """Cut a point's runs into batches; the last one may be shorter."""
    for start in range(0, runs, batch_runs):
        yield Batch(point, first_seed + start, min(batch_runs, runs - start))


def check_plan(scenario: Scenario, first_seed: int, runs: int, batch_runs: int) -> None:
    """Refuse a plan that has no runs, no end, or seeds that do not exist. Raises StudyInputError, CoreError."""
    if runs < 1:
        raise StudyInputError(f"{runs} runs are too few", hint="give --runs a number from 1")
    if batch_runs < RUNS_AT_ONCE or batch_runs % RUNS_AT_ONCE:
        raise StudyInputError(f"a batch of {batch_runs} runs", hint=f"give --batch a multiple of {RUNS_AT_ONCE}")
    if not 0 <= first_seed <= MAX_SEED - runs:
        raise StudyInputError(f"seeds from {first_seed} on are out of range", hint=f"the largest seed is {MAX_SEED}")
    core.robot_config(scenario.parameter_values(), scenario.robot.table, 0)
    if _endless(scenario):
        raise StudyInputError(
            f"{scenario.name} has no end within an hour",
            hint="end every run after a time with --duration S, or give the scenario a trajectory with an end",
        )


def _endless(scenario: Scenario) -> bool:
    commands = {event.command for event in scenario.events}
    if scenario.duration_s is not None or "arm" not in commands or commands & {"disarm", "estop", "trajectory_stop"}:
        return False
    changes = [event.settings or {} for event in scenario.events]
    laps = [values["TRJ_LAPS"] for values in (scenario.parameter_values(), *changes) if "TRJ_LAPS" in values]
    return "trajectory_start" not in commands or min(laps) == 0.0
