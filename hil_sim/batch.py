# SPDX-License-Identifier: MIT
"""Many runs of a scenario at once, in C: a row of figures for each, and their statistics.

::

    result = run_batch(BatchSpec(load_scenario("demo"), {"WS_P": 5.0}), first_seed=1, count=64)
    result.rows["position_m"]  # in the order of the seeds
    result.statistics.quantile("position_m", 0.95)

A row is a pure function of scenario, parameters and seed. How seeds are cut into batches, how many threads or machines
run them, changes no bit of it. And ``run_in_process`` with that seed is the same run. The GIL is released meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hil_sim.c_scenario import CScenario
from hil_sim.limits import MAX_SEED
from hil_sim.processes import usable_processors
from hil_sim.record import struct_dtype
from hil_sim.scenario import Scenario
from hil_sim.statistics import Spread, Statistics
from omni_schema import SchemaError
from omniwheel._core import ffi, lib
from omniwheel.errors import OmniError

MAX_COUNT = 2**31 - 1
BLOCK: int = lib.HIL_BLOCK
"""Runs that go along together: batches of a multiple of this are fastest."""

Better = Literal["lower", "higher", "neither"]


@dataclass(frozen=True)
class Figure:
    """A figure of a run: its column in the rows, SI unit ("" for shares and indices), which is better, what it says."""

    name: str
    unit: str
    better: Better
    meaning: str


FIGURES: tuple[Figure, ...] = (
    Figure("completed", "", "higher", "1: the trajectory was driven to its end, 0: not"),
    Figure("x_m", "m", "lower", "RMSE of x: truth minus reference on the path"),
    Figure("y_m", "m", "lower", "RMSE of y"),
    Figure("theta_rad", "rad", "lower", "RMSE of the heading"),
    Figure("position_m", "m", "lower", "RMSE of the position, sqrt(x^2 + y^2)"),
    Figure("max_position_m", "m", "lower", "largest distance from the reference on the path"),
    Figure("max_theta_rad", "rad", "lower", "largest heading error on the path"),
    Figure("final_position_m", "m", "lower", "distance at the last armed tick on the path or after its end"),
    Figure("final_theta_rad", "rad", "lower", "heading error there"),
    Figure("estimate_x_m", "m", "lower", "RMSE of the estimate of x: estimate minus truth on the path"),
    Figure("estimate_y_m", "m", "lower", "RMSE of the estimate of y"),
    Figure("estimate_theta_rad", "rad", "lower", "RMSE of the estimated heading"),
    Figure("estimate_position_m", "m", "lower", "RMSE of the estimated position"),
    Figure("nis", "", "neither", "mean normalised innovation squared of the accepted fixes; 3 if the filter is right"),
    Figure("peak_wheel_rad_s", "rad/s", "lower", "fastest true wheel speed on the path"),
    Figure("peak_duty", "", "lower", "largest duty on the path"),
    Figure("rms_duty", "", "lower", "root mean square of all duties on the path"),
    Figure("saturated_share", "", "lower", "share of the path's ticks in which speeds or voltages were cut"),
    Figure("chatter", "", "lower", "mean change of a duty from tick to tick over the mean duty"),
)
"""Every figure of a row. NaN where a run has none: it never drove its path, or could not start."""

STATUSES: Mapping[int, str] = {
    lib.HIL_RUN_OK: "ok",
    lib.HIL_RUN_WORLD: "world refused",
    lib.HIL_RUN_ARMING: "arming refused",
    lib.HIL_RUN_PARAMETERS: "parameters refused",
    lib.HIL_RUN_TRAJECTORY: "trajectory refused",
    lib.HIL_RUN_ENDLESS: "endless path",
}
"""How a run came out, by the ``status`` of its row; "ok": it was played to its end, completed or not."""


class BatchCancelledError(OmniError):
    """The batch was cancelled; none of its rows count."""


class Cancel:
    """Stops batches that run in other threads, within a fifth of a simulated second of each run. Cannot be undone."""

    def __init__(self) -> None:
        self.c: Any = ffi.new("int32_t *")

    def set(self) -> None:
        """Stop them, and every later batch with this object."""
        self.c[0] = 1

    @property
    def is_set(self) -> bool:
        """Whether ``set`` has been called."""
        return bool(self.c[0])


@dataclass(frozen=True)
class BatchSpec:
    """What to run: a scenario, and parameters that replace its own, at the start and in its events. Can be pickled."""

    scenario: Scenario
    parameters: Mapping[str, float] = field(default_factory=dict)

    def applied(self) -> Scenario:
        """Return the scenario with the parameters in it, the one that ``run_in_process`` replays runs of."""
        return self.scenario.with_parameters(self.parameters) if self.parameters else self.scenario


@dataclass(frozen=True)
class BatchResult:
    """Rows of consecutive seeds, one per run, of ``row_dtype``."""

    rows: NDArray[Any]

    @property
    def statistics(self) -> Statistics:
        """The rows' statistics."""
        return statistics_of(self.rows)


def row_dtype() -> np.dtype[np.void]:
    """Return the layout of a row: seed, ticks, status (see STATUSES), faults (bits seen since arming), and FIGURES."""
    return struct_dtype("hil_figures_t")


def prepare(spec: BatchSpec | Scenario) -> CScenario:
    """Return the scenario as C needs it, for many batches in any thread. Raises as run_batch does."""
    return CScenario(spec.applied() if isinstance(spec, BatchSpec) else spec)


def run_batch(
    spec: BatchSpec | Scenario | CScenario, first_seed: int | None = None, count: int = 1, cancel: Cancel | None = None
) -> BatchResult:
    """Run ``count`` seeds from ``first_seed`` (None: the scenario's own) on and return their rows.

    May be called from several threads at once. A run that cannot start, or cannot go on, has a status that is not "ok"
    and no figures. Raises SchemaError for impossible seeds, CoreError for parameters or WorldError for a world that no
    run could start with, BatchCancelledError.
    """
    plan = spec if isinstance(spec, CScenario) else prepare(spec)
    first = plan.scenario.seed if first_seed is None else first_seed
    _check_seeds(plan.scenario, first, count)
    rows = np.zeros(count, row_dtype())
    flag = ffi.NULL if cancel is None else cancel.c
    done = lib.hil_batch_run(plan.c, first, count, ffi.from_buffer("hil_figures_t[]", rows), flag)
    if done < 0:
        raise MemoryError("no memory for a block of runs")
    if done < count:
        raise BatchCancelledError(f"cancelled after {done} of {count} runs")
    return BatchResult(rows)


def run_batches(
    spec: BatchSpec | Scenario, first_seed: int, count: int, workers: int | None = None
) -> Generator[BatchResult, None, None]:
    """Run seeds on ``workers`` threads (None: one per processor); yield results of some blocks in their order.

    Closing the iterator, also by Ctrl-C, stops the runs. Raises as run_batch does.
    """
    plan, cancel = prepare(spec), Cancel()
    piece = BLOCK * min(max(count // 64, 1), 8)  # not by the number of workers: merging must round alike for all
    threads = workers or usable_processors()
    with ThreadPoolExecutor(threads) as pool:
        pending: deque[Future[BatchResult]] = deque()
        try:
            for start in range(first_seed, first_seed + count, piece):
                runs = min(piece, first_seed + count - start)
                pending.append(pool.submit(run_batch, plan, start, runs, cancel))
                if len(pending) > 2 * threads:
                    yield pending.popleft().result()
            while pending:
                yield pending.popleft().result()
        finally:
            cancel.set()
            pool.shutdown(cancel_futures=True)


def statistics_of(rows: NDArray[Any]) -> Statistics:
    """Return the statistics of rows, taken in their order."""
    statuses, status_counts = np.unique(rows["status"], return_counts=True)
    bits = {1 << bit: int(np.count_nonzero(rows["faults"] & np.uint32(1 << bit))) for bit in range(32)}
    return Statistics(
        runs=len(rows),
        ticks=int(np.sum(rows["ticks"])),
        statuses={STATUSES[int(status)]: int(n) for status, n in zip(statuses, status_counts, strict=True)},
        faults={bit: n for bit, n in bits.items() if n},
        spreads={figure.name: Spread.of(rows[figure.name]) for figure in FIGURES},
    )


def _check_seeds(scenario: Scenario, first: int, count: int) -> None:
    if not 1 <= count <= MAX_COUNT:
        raise ValueError(f"count is {count}; must be 1 to {MAX_COUNT}")
    if not 0 <= first <= MAX_SEED - (count - 1):
        problem = f"is {first} for {count} runs; the last seed may be {MAX_SEED} at most"
        raise SchemaError(scenario.source, "scenario.seed", problem)
