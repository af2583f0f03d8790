# SPDX-License-Identifier: MIT
"""Runs of a batch with and without lanes."""

from __future__ import annotations

from hil_sim.batch import run_batch
from hil_sim.scenario import Scenario
from omniwheel._core import lib


def assert_the_same_without_lanes(scenario: Scenario, first_seed: int, runs: int) -> None:
    """Compare the rows of a batch, bit for bit, with those of runs computed one by one."""
    in_lanes = run_batch(scenario, first_seed, runs).rows.tobytes()
    lib.hil_lanes_set_level(lib.HIL_LANES_NONE)
    try:
        assert run_batch(scenario, first_seed, runs).rows.tobytes() == in_lanes
    finally:
        lib.hil_lanes_set_level(lib.HIL_LANES_BEST)
