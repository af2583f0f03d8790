# SPDX-License-Identifier: MIT
"""The warning that pose fixes have stopped coming: only after some have come, and only while none is fresh."""

from __future__ import annotations

import pytest

from omniwheel._core import lib
from tests.core.test_robot import TICK_US, Bench

TIMEOUT_S = 0.2


def stale(bench: Bench) -> bool:
    return bool(bench.outputs.faults & lib.OMNI_WARN_POSE_STALE)


def give_fix(bench: Bench) -> None:
    """One fix of where the robot is, with the next tick."""
    bench.inputs.has_fix = True
    bench.inputs.fix.time_us = bench.time_us + TICK_US
    bench.inputs.fix.sd_xy = bench.inputs.fix.sd_theta = 0.01
    bench.tick()
    bench.inputs.has_fix = False


@pytest.fixture
def bench() -> Bench:
    bench = Bench(FIX_TIMEOUT=TIMEOUT_S)
    bench.tick(count=2)
    return bench


def test_a_robot_that_never_had_a_fix_misses_none(bench: Bench) -> None:
    bench.tick(count=1000)
    assert not stale(bench)
    assert bench.outputs.fixes_accepted == 0


def test_fixes_that_stop_are_missed_after_the_timeout_until_the_next_one(bench: Bench) -> None:
    give_fix(bench)
    assert bench.outputs.fixes_accepted == 1
    limit = round(TIMEOUT_S * 1e6 / TICK_US)
    for _ in range(limit):
        bench.tick()
        assert not stale(bench)
    bench.tick(count=2)
    assert stale(bench)
    bench.tick(count=100)
    assert stale(bench)
    give_fix(bench)
    assert not stale(bench)
