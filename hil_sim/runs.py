# SPDX-License-Identifier: MIT
"""Runs of scenarios: what they all give, and those without a link, around ``omni_robot_tick`` in this process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.c_events import NEVER, TICKS_PER_S
from hil_sim.c_scenario import CScenario, scenario_world
from hil_sim.metrics import STATE_ARMED
from hil_sim.processes import usable_processors
from hil_sim.record import Record
from hil_sim.scenario import Scenario
from hil_sim.timeline import Applied, Played, Progress, RunError
from hil_sim.world import World, WorldError
from omniwheel._core import ffi, lib
from omniwheel.core_config import PLAN_REFUSED, refused_parameters
from omniwheel.errors import CoreError, OmniError

Measure = TypeVar("Measure")

PIECE_TICKS = 4000
"""Ticks between two calls of a run's progress."""


@dataclass(frozen=True)
class Run:
    """What a run leaves: the scenario, the world's record (one row of hil_sample_t per tick), and how it came about.

    ``way`` is "in-process" or "hil". ``parameters`` are those the run ended with. ``tick_us`` holds the mean and
    the longest time of a tick that the firmware measured [us], empty in process. ``wall_s`` is the time that the
    ticks took. ``world`` is module and class of an external world, empty for our own.
    """

    scenario: Scenario
    way: str
    record: NDArray[Any]
    applied: tuple[Applied, ...]
    ticks: int
    done: bool
    wall_s: float
    parameters: dict[str, float]
    firmware_version: str
    tick_us: dict[str, float] = field(default_factory=dict)
    messages: tuple[str, ...] = ()
    world: str = ""

    @property
    def stopped_early(self) -> bool:
        """Whether the path was to be driven to its end and was not, in a scenario that breaks nothing."""
        return not self.done and self.scenario.duration_s is None and not self.scenario.faults

    @property
    def realtime_factor(self) -> float:
        """Simulated time divided by wall time."""
        return self.ticks * 1e-3 / self.wall_s if self.wall_s > 0.0 else float("inf")


def new_world(scenario: Scenario) -> World:
    """Return the scenario's world at time zero."""
    return World(scenario_world(scenario))


class Player:
    """A scenario's timeline on a run in this process; all of it happens in C."""

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        self._plan = CScenario(scenario)
        self._run = ffi.new("hil_run_t *")
        self._path = ffi.new("hil_path_t *")
        self._moments = ffi.new("hil_moment_t[]", len(scenario.events))
        self._player = ffi.new("hil_player_t *")
        lib.hil_player_init(self._player, self._plan.c, scenario.seed, self._run, self._moments, self._path)

    def play(self, progress: Progress | None = None) -> Played:
        """Run to the end and return what happened. Raises RunError or CoreError if the run cannot start or go on."""
        pieces = []
        going = True
        while going:
            record = Record(PIECE_TICKS + lib.HIL_UPDATE_TICKS)
            self._run.record = record.c
            going = bool(lib.hil_player_play(self._player, PIECE_TICKS))
            pieces.append(record.samples)
            if progress is not None:
                progress(self._run.ticks / TICKS_PER_S, self._expected_end_s())
        self._check()
        return Played(np.concatenate(pieces), self.applied, int(self._run.ticks), self._player.timeline.done != NEVER)

    @property
    def applied(self) -> tuple[Applied, ...]:
        """Events so far, in their order."""
        moments = self._moments[0 : self._player.timeline.applied]
        events = self.scenario.events
        return tuple(Applied(moment.applied_tick / TICKS_PER_S, events[moment.event]) for moment in moments)

    @property
    def values(self) -> dict[str, float]:
        """The parameters as they are now."""
        values = self.scenario.parameter_values()
        for entry in self.applied:
            values.update(entry.event.settings or {})
        return values

    def _expected_end_s(self) -> float | None:
        end = lib.hil_player_expected_end(self._player)
        return None if end == NEVER else end / TICKS_PER_S

    def _check(self) -> None:
        status, detail = self._player.status, self._player.detail
        if status == lib.HIL_RUN_WORLD:
            raise WorldError(ffi.string(self._player.why).decode())
        if status == lib.HIL_RUN_PARAMETERS:
            raise refused_parameters(list(self._player.values), self.scenario.robot.table, detail)
        if status != lib.HIL_RUN_OK:
            raise refusal(status, detail & 0xFFFFFFFF)


def refusal(status: int, faults: int) -> OmniError:
    """Return the error that says why a run with this ``hil_run_status_t`` could not start or go on."""
    if status == lib.HIL_RUN_ARMING:
        return RunError(f"arming was rejected: {', '.join(core.fault_names(faults))}")
    return CoreError(_REFUSALS[status])


_REFUSALS = {
    lib.HIL_RUN_WORLD: "the world drawn from [dispersion] is invalid; narrow its ranges",
    lib.HIL_RUN_PARAMETERS: "the core rejected a change of parameters",
    lib.HIL_RUN_TRAJECTORY: PLAN_REFUSED,
    lib.HIL_RUN_ENDLESS: core.ENDLESS,
}


def run_in_process(scenario: Scenario, seed: int | None = None, progress: Progress | None = None) -> Run:
    """Run a scenario in this process."""
    scenario = scenario.with_seed(seed)
    player = Player(scenario)
    start = time.perf_counter()
    played = player.play(progress)
    return finish(scenario, "in-process", played, time.perf_counter() - start, player.values, "in-process")


def run_seeds(scenario: Scenario, seeds: Iterable[int], measure: Callable[[Run], Measure]) -> Iterator[Measure]:
    """Run a scenario with several seeds on all processors; yield what ``measure`` says of each, in their order."""
    with ThreadPoolExecutor(usable_processors()) as pool:
        yield from pool.map(lambda seed: measure(run_in_process(scenario, seed)), seeds)


def finish(
    scenario: Scenario, way: str, played: Played, wall_s: float, parameters: dict[str, float], firmware_version: str
) -> Run:
    """Return the run that a played timeline makes."""
    return Run(
        scenario=scenario,
        way=way,
        record=played.record,
        applied=played.applied,
        ticks=played.ticks,
        done=played.done,
        wall_s=wall_s,
        parameters=dict(parameters),
        firmware_version=firmware_version,
    )


def faults_seen(run: Run) -> tuple[list[str], list[str]]:
    """Return the names of the stop faults and of the warnings that were present at any time after arming."""
    armed = np.flatnonzero(run.record["state"] == STATE_ARMED)
    since_arming = run.record["faults"][armed[0] :] if len(armed) else run.record["faults"]
    bits = int(np.bitwise_or.reduce(since_arming)) if len(since_arming) else 0
    return core.fault_names(bits), core.warning_names(bits)
