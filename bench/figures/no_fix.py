# SPDX-License-Identifier: MIT
"""How far the pose drifts in ten minutes without a fix, with each set of sensors: python -m bench.figures.no_fix.

The robot is told exactly where it stands at first. It stands for three seconds, or 20, and learns a gyro's bias. Then
it drives the demo's rose again and again, on real wheels that slip by 0 to 10 %. All parameters are as shipped. A cell
is what 95 % of the seeds are below at the end.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.figures.flow import OPTICAL, TOLD_OPTICAL
from bench.figures.gyro import drive_scenario
from hil_sim.processes import worker_pool
from hil_sim.scenario import load_scenario
from hil_sim.table_command import need_one_or_more, say

Array = NDArray[np.float64]

SEEDS = 50
SECONDS = 600
FIRST_SEED = 3001
SHARE = 95.0


@dataclass(frozen=True)
class Sensors:
    """A set of sensors beside the encoders: numbers of their world, what the robot is told, and how long it stands."""

    title: str
    world: Mapping[str, float]
    parameters: Mapping[str, float]
    stand_s: int = 3


_GYRO, _FLOOR = {"gyro_rate_Hz": 1000.0}, {"flow_rate_Hz": 50.0}
SETS = (
    Sensors("wheels alone", {}, {}),
    Sensors("gyro", _GYRO, {"GYRO_AXIS": 3.0}),
    Sensors("gyro, 20 s at rest before", _GYRO, {"GYRO_AXIS": 3.0}, stand_s=20),
    Sensors("floor motion: way and turn", _FLOOR, {"FLOW_MODE": 2.0}),
    Sensors(
        "gyro, and floor motion: way",
        {**_GYRO, **_FLOOR, **OPTICAL},
        {"GYRO_AXIS": 3.0, **TOLD_OPTICAL, "FLOW_SD": OPTICAL["flow_sd_m"]},
    ),
)
"""The sensors' noise is that of docs/guides/gyro.md and docs/guides/floor-motion.md."""


def drift(sensors: Sensors, seconds: int, seed: int) -> Array:
    """Return position error [m], heading error [rad] and way driven [m] at the end of one run. Raises RuntimeError."""
    scenario = load_scenario("no_fixes").with_seed(seed).with_world(sensors.world)
    scenario = scenario.with_parameters({"TRJ_LAPS": 0.0, **sensors.parameters})
    rows, _ = drive_scenario(scenario, f"{sensors.title}, seed {seed}", seconds, 1000 * sensors.stand_s)
    way = float(np.hypot(*np.diff(rows[:, 5:7], axis=0).T).sum())
    return np.array([np.hypot(*rows[-1, 2:4]), abs(rows[-1, 0]), way])


def row(sensors: Sensors, seeds: range, seconds: int, pool: Executor) -> str:
    """Return a set's line of the table."""
    ends = np.array(list(pool.map(partial(drift, sensors, seconds), seeds)))
    position, heading = np.percentile(ends[:, 0], SHARE), np.percentile(ends[:, 1], SHARE)
    share = np.percentile(ends[:, 0] / ends[:, 2], SHARE)
    return f"| {sensors.title} | {1e3 * position:.1f} | {100.0 * share:.3f} | {np.degrees(heading):.2f} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, a line as soon as it is known."""
    parser = argparse.ArgumentParser(prog="python -m bench.figures.no_fix", description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help=f"runs of each line ({SEEDS})")
    parser.add_argument("--seconds", type=int, default=SECONDS, help=f"length of a run ({SECONDS})")
    chosen = parser.parse_args(arguments)
    need_one_or_more(parser, chosen, "seeds", "seconds")
    seeds = range(FIRST_SEED, FIRST_SEED + chosen.seeds)
    say("| sensors | position [mm] | of the way [%] | heading [°] |\n|---|---|---|---|")
    with worker_pool() as pool:
        for sensors in SETS:
            say(row(sensors, seeds, chosen.seconds, pool))


if __name__ == "__main__":
    main()
