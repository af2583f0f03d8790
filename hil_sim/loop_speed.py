# SPDX-License-Identifier: MIT
"""How fast the loops around the robot run here: what ``python -m omni.checks bench`` and ``make bench`` measure."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from importlib.util import find_spec

from hil_sim.batch import run_batch
from hil_sim.hil import run_hil
from hil_sim.lockstep import ASLEEP
from hil_sim.runs import Run, run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omniwheel._core import lib
from omniwheel.emulated_firmware import EMULATOR
from omniwheel.paths import MissingFileError, emulated_firmware_path

SCENARIO = "demo"
TICK_S = 1e-3
BLOCK_RUNS = 16
"""Runs that a worker does at a time."""


@dataclass(frozen=True)
class LoopTime:
    """What a loop took [s] for how much simulated time [s].

    ``cpu_s`` is the time that processors spent on it [s], 0 where other processes have their part in it. ``tick_us`` is
    what the firmware itself measured.
    """

    wall_s: float
    simulated_s: float
    cpu_s: float = 0.0
    tick_us: dict[str, float] = field(default_factory=dict)

    @property
    def realtime_factor(self) -> float:
        """Simulated time per wall time."""
        return self.simulated_s / self.wall_s


@dataclass(frozen=True)
class Loop:
    """A loop in words, the factor of real time that the project asks of it, and a function that runs it once."""

    words: str
    wanted: float | None
    run: Callable[[], LoopTime]


def loops(seconds: float, seed: int = 1, *, compared: bool = False, name: str = SCENARIO) -> dict[str, Loop]:
    """Return the loops that can run here, over ``seconds`` of a scenario, the demo's if none is named.

    The demo is driven in MuJoCo's world, too, if that is installed.

    ``compared``: with what they are compared with, too: waiting asleep, and Monte Carlo in other ways.
    """
    scenario = replace(load_scenario(name), duration_s=seconds, seed=seed)
    found = {"hil": Loop("firmware process in the loop, lockstep over TCP", 30.0, lambda: _of(run_hil(scenario)))}
    if compared:
        words = "firmware process in the loop, both ends sleeping while they wait"
        found["hil_asleep"] = Loop(words, None, lambda: _of(run_hil(scenario, waiting=ASLEEP)))
    if name == SCENARIO and find_spec("mujoco") is not None:
        found["mujoco"] = Loop("firmware process and MuJoCo's world", 10.0, lambda: _of(_with_mujoco(scenario)))
    if _has_emulator():
        words = "firmware on an emulated Cortex-M7 in the loop"
        found["emulated"] = Loop(words, 2.0, lambda: _of(run_hil(scenario, emulated=True)))
    found["in_process"] = Loop("in process: world and control core", 300.0, lambda: _in_process(scenario))
    if compared:
        words = "Monte Carlo, 1 worker, run after run"
        found["monte_carlo_single"] = Loop(words, None, lambda: _on_level(scenario, lib.HIL_LANES_NONE, blocks=1))
        if lib.hil_lanes_has_avx512():
            words = "Monte Carlo, 1 worker, AVX2 in place of AVX-512"
            found["monte_carlo_avx2"] = Loop(words, None, lambda: _on_level(scenario, lib.HIL_LANES_AVX2))
    wanted = 3000.0 if lib.hil_lanes_has_avx512() else 1000.0
    found["monte_carlo"] = Loop("Monte Carlo, 1 worker", wanted, lambda: monte_carlo(scenario, 1))
    found["monte_carlo_2"] = Loop("Monte Carlo, 2 workers", None, lambda: monte_carlo(scenario, 2))
    return found


def monte_carlo(scenario: Scenario, workers: int, blocks: int = 4) -> LoopTime:
    """Run ``blocks`` blocks of consecutive seeds, shared by workers."""
    firsts = [scenario.seed + BLOCK_RUNS * number for number in range(blocks)]
    start, cpu_start = time.perf_counter(), time.process_time()
    with ThreadPoolExecutor(workers) as pool:
        simulated_s = sum(pool.map(lambda first: _block_s(scenario, first), firsts))
    return LoopTime(time.perf_counter() - start, simulated_s, time.process_time() - cpu_start)


def _with_mujoco(scenario: Scenario) -> Run:
    from hil_sim.mujoco_world import MujocoWorld

    return run_hil(scenario, world=MujocoWorld(scenario))


def _on_level(scenario: Scenario, level: int, blocks: int = 4) -> LoopTime:
    lib.hil_lanes_set_level(level)
    try:
        return monte_carlo(scenario, 1, blocks)
    finally:
        lib.hil_lanes_set_level(lib.HIL_LANES_BEST)


def _block_s(scenario: Scenario, first: int) -> float:
    """Run a block and return the time it simulated [s]."""
    return float(run_batch(scenario, first, BLOCK_RUNS).rows["ticks"].sum()) * TICK_S


def _in_process(scenario: Scenario) -> LoopTime:
    cpu_start = time.process_time()
    run = run_in_process(scenario)
    return replace(_of(run), cpu_s=time.process_time() - cpu_start)


def _of(run: Run) -> LoopTime:
    return LoopTime(run.wall_s, run.ticks * TICK_S, tick_us=run.tick_us)


def _has_emulator() -> bool:
    try:
        emulated_firmware_path()
    except MissingFileError:
        return False
    return shutil.which(EMULATOR) is not None
