# SPDX-License-Identifier: MIT
"""The best that any filter could do in ten minutes without a fix: python -m bench.figures.no_fix_bound.

The worlds are those of ``bench.figures.no_fix``, on ideal wheels. The filter knows how slip is drawn, and where it
stands at first. A cell is what 95 % of its errors at the end are below. The robot's filter does not know that slip
is 5 % in the mean.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.figures.no_fix import FIRST_SEED, SECONDS, SETS, SHARE, Sensors
from hil_sim.processes import worker_pool
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.table_command import need_one_or_more, say
from hil_sim.world import IDEAL_WHEELS
from omni_reproduce.limits import statistics_of, wheels_of
from omni_reproduce.posterior_bound import STEP_TICKS, Array, BoundError, bound_variances, motion_gains

PATHS = 4
DRAWS = 20_000
"""Errors drawn for each path, with seed 1, to find what ``SHARE`` percent of them are below."""


def scenario_of(sensors: Sensors, seconds: int) -> Scenario:
    """Return the scenario: stand, then drive the rose for so long."""
    found = load_scenario("no_fixes").with_world({**sensors.world, **IDEAL_WHEELS})
    events = tuple(replace(event, at_s=float(sensors.stand_s)) for event in found.events)
    found = replace(found, events=events, duration_s=float(sensors.stand_s + seconds))
    return found.with_parameters({"TRJ_LAPS": 0.0, **sensors.parameters})


def end_variances(scenario: Scenario, seed: int) -> Array:
    """Return the bound of the variances of x, y, theta at the end of one path, (3,) in m^2 and rad^2.

    Raises BoundError for a sensor that the bound does not know.
    """
    wheels, _ = wheels_of(scenario)
    statistics = replace(statistics_of(scenario, 1), start_variance=0.0)
    record = run_in_process(scenario, seed).record
    moves, gains = motion_gains(record, wheels, statistics)
    gains[standing(record["wheel_rad_s"][:, : wheels.count], len(moves))] = 0.0
    return np.asarray(bound_variances(moves[None], gains[None], wheels.count, statistics)[0, -1])


def standing(wheel_rad_s: Array, steps: int) -> NDArray[np.bool_]:
    """Return in which steps no wheel turns: its angle is not rounded anew then. ``wheel_rad_s`` has a row per tick."""
    still = (wheel_rad_s[: steps * STEP_TICKS] == 0.0).all(axis=1)
    return np.asarray(still.reshape(steps, STEP_TICKS).all(axis=1))


def percentiles(variances: Array) -> tuple[float, float]:
    """Return what ``SHARE`` percent of normal errors of these variances (paths, 3) are below: metres, radians."""
    errors = np.random.default_rng(1).normal(size=(DRAWS, *variances.shape)) * np.sqrt(variances)
    position = np.hypot(errors[..., 0], errors[..., 1])
    return float(np.percentile(position, SHARE)), float(np.percentile(np.abs(errors[..., 2]), SHARE))


def row(sensors: Sensors, paths: int, seconds: int, pool: Executor) -> str:
    """Return a set's line of the table. Raises BoundError for a sensor that the bound does not know."""
    scenario = scenario_of(sensors, seconds)
    seeds = range(FIRST_SEED, FIRST_SEED + paths)
    position, heading = percentiles(np.array(list(pool.map(partial(end_variances, scenario), seeds))))
    return f"| {sensors.title} | {1e3 * position:.1f} | {np.degrees(heading):.2f} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, a line as soon as it is known."""
    parser = argparse.ArgumentParser(prog="python -m bench.figures.no_fix_bound", description=__doc__)
    parser.add_argument("--paths", type=int, default=PATHS, help=f"paths of each line ({PATHS})")
    parser.add_argument("--seconds", type=int, default=SECONDS, help=f"length of a drive ({SECONDS})")
    chosen = parser.parse_args(arguments)
    need_one_or_more(parser, chosen, "paths", "seconds")
    say("| sensors | position [mm] | heading [°] |\n|---|---|---|")
    with worker_pool() as pool:
        for sensors in SETS:
            try:
                say(row(sensors, chosen.paths, chosen.seconds, pool))
            except BoundError as error:
                say(f"| {sensors.title} | not computed: {error} | |")


if __name__ == "__main__":
    main()
