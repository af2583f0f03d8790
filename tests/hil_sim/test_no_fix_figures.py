# SPDX-License-Identifier: MIT
"""Ten minutes without a fix: what each set of sensors is good for, and the page that says so."""

from __future__ import annotations

import numpy as np
import pytest

from bench.figures import no_fix as no_fix_figures
from hil_sim.processes import worker_pool
from tests.native import ROOT

PAGE = ROOT / "docs" / "report" / "reproduce.md"


@pytest.mark.full
def test_each_sensor_adds_something() -> None:
    """On short runs: the heading by gyro or floor motion, the position by floor motion."""
    ends = {
        each.title: np.array([no_fix_figures.drift(each, 40, seed) for seed in (1, 2, 3)])
        for each in no_fix_figures.SETS
    }
    rms = {title: np.sqrt(np.mean(found**2, axis=0)) for title, found in ends.items()}
    wheels, gyro, rested, floor, both = rms.values()
    assert wheels[2] == pytest.approx(0.08 * 40, rel=0.5), "the way is what a robot of 0.15 m/s drives"
    assert gyro[1] < 0.3 * wheels[1]
    assert rested[1] < 0.3 * wheels[1]
    assert floor[0] < 0.3 * wheels[0]
    assert both[0] < 0.4 * gyro[0]


@pytest.mark.nightly
def test_the_page_says_what_the_command_says() -> None:
    page = PAGE.read_text(encoding="utf-8")
    seeds = range(no_fix_figures.FIRST_SEED, no_fix_figures.FIRST_SEED + no_fix_figures.SEEDS)
    with worker_pool() as pool:
        for each in no_fix_figures.SETS:
            assert no_fix_figures.row(each, seeds, no_fix_figures.SECONDS, pool) in page
