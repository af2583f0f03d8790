# SPDX-License-Identifier: MIT
"""How far the pose drifts after fixes stop: python -m bench.figures.lost_fix [--seeds 100].

Slip ratios stay as they were, or return to their means. The robot drives the demo's rose, on real wheels, with fixes
at 50 Hz for a minute. Then none comes any more. A cell is the error of the estimate some time later, position in mm /
heading in mrad: the root mean square over the seeds. All parameters are as shipped, but ``EKF_RETURN`` is 0 where slip
ratios stay.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bench.figures.gyro import LOOK_TICKS, drive_scenario
from hil_sim.processes import worker_pool
from hil_sim.scenario import load_scenario
from hil_sim.table_command import need_one_or_more, say

Array = NDArray[np.float64]

SEEDS = 100
FIRST_SEED = 5001
LOOKS_S = (5, 10, 30)
"""Times after the last fix."""


@dataclass(frozen=True)
class Setting:
    """A world, what the robot is told, and how long it has fixes [s]."""

    title: str
    world: Mapping[str, float] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    scenario: str = "demo"
    fixes_s: int = 60


_GYRO_WORLD, _GYRO = {"gyro_rate_Hz": 1000.0}, {"GYRO_AXIS": 3.0}
SETTINGS = (
    Setting("demo"),
    Setting("slip drawn each 0.5 s", {"slip_time_s": 0.5}),
    Setting("slip drawn each 20 s", {"slip_time_s": 20.0}),
    Setting("slip to 30 %", {"slip_max": 0.3}),
    Setting("slip to 30 %, drawn each second", {"slip_max": 0.3, "slip_time_s": 1.0}),
    Setting("no slip", {"slip_max": 0.0}),
    Setting("robots that differ", scenario="tolerances"),
    Setting("four wheels", scenario="four_wheel"),
    Setting("gyro", _GYRO_WORLD, _GYRO),
    Setting("gyro, slip drawn each 0.5 s", {**_GYRO_WORLD, "slip_time_s": 0.5}, _GYRO),
    Setting("fast robot", scenario="fast", fixes_s=10),
)


def drift(setting: Setting, parameters: Mapping[str, float], seed: int) -> Array:
    """Return a row for each time of ``LOOKS_S``: error of position [m] and heading [rad]. Raises RuntimeError."""
    scenario = load_scenario(setting.scenario).with_seed(seed).with_world(setting.world)
    scenario = scenario.with_parameters({"TRJ_LAPS": 0.0, **setting.parameters, **parameters})
    seconds = setting.fixes_s + LOOKS_S[-1]
    looks, _ = drive_scenario(scenario, f"{setting.title}, seed {seed}", seconds, last_fix_s=setting.fixes_s)
    chosen = looks[[(setting.fixes_s + look_s) * 1000 // LOOK_TICKS - 1 for look_s in LOOKS_S]]
    return np.column_stack([np.hypot(chosen[:, 2], chosen[:, 3]), chosen[:, 0]])


def row(setting: Setting, seeds: range, pool: Executor) -> str:
    """Return a setting's line of the table."""
    errors = []
    for parameters in ({"EKF_RETURN": 0.0}, {}):
        found = np.array(list(pool.map(partial(drift, setting, parameters), seeds)))
        errors.append(1e3 * np.sqrt(np.mean(found**2, axis=0)))
    cells = [f"{position:.1f} / {heading:.1f}" for look in zip(*errors, strict=True) for position, heading in look]
    return f"| {' | '.join([setting.title, *cells])} |"


def head() -> str:
    """Return the first two lines of the table."""
    titles = [f"{look} s, {how}" for look in LOOKS_S for how in ("they stay", "they return")]
    return f"| world | {' | '.join(titles)} |\n|---|{'---|' * len(titles)}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, a line as soon as it is known."""
    parser = argparse.ArgumentParser(prog="python -m bench.figures.lost_fix", description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help=f"runs of each cell, from seed {FIRST_SEED} ({SEEDS})")
    chosen = parser.parse_args(arguments)
    need_one_or_more(parser, chosen, "seeds")
    say(head())
    with worker_pool() as pool:
        for setting in SETTINGS:
            say(row(setting, range(FIRST_SEED, FIRST_SEED + chosen.seeds), pool))


if __name__ == "__main__":
    main()
