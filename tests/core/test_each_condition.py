# SPDX-License-Identifier: MIT
"""Conditions with several parts: each part alone decides, whatever the others say."""

from __future__ import annotations

import math
from typing import Any

import pytest

from omniwheel._core import ffi, lib
from tests.core.test_motor_kf import OFF, RAD_PER_COUNT, SPEED, STEP_S, Filter
from tests.core.test_robot import Bench

CIRCLE = {"TRJ_TYPE": 3.0, "TRJ_SIZE": 0.3, "TRJ_PERIOD": 30.0, "TRJ_ROT": 0.0}
DEBOUNCE_TICKS = 500


def circling(controller: int, **parameters: float) -> Bench:
    bench = Bench()
    bench.arm()
    bench.follow(**CIRCLE, CTL_MODE=float(controller), **parameters)
    return bench


def margins(out: Any) -> list[float]:
    return [out.ismc_margin[axis] for axis in range(3)]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_gain_that_is_too_small_for_one_axis_of_the_world_is_warned_of(axis: int) -> None:
    """On a circle each axis has its turn: somewhere it alone is not covered, and that is enough."""
    k = 0.03
    bench = circling(lib.OMNI_CTL_MODE_ISMC, ISMC_K_XY=k)
    found = []
    for _ in range(250):
        at = margins(bench.tick(count=100))
        found.append((at[1 - axis] - at[axis], 2 * k - at[0] - at[1]))
    gain = max(found)[1] / 2  # between what the two axes need, where they differ most
    bench = circling(lib.OMNI_CTL_MODE_ISMC, ISMC_K_XY=gain)
    alone = 0
    for _ in range(25_000):
        out = bench.tick()
        at = margins(out)
        alone = alone + 1 if at[axis] < 0.0 and min(at[1 - axis], at[2]) >= 0.0 else 0
        if alone > DEBOUNCE_TICKS:
            break
    assert alone > DEBOUNCE_TICKS
    assert out.faults & lib.OMNI_WARN_ISMC_GAIN


def test_the_share_of_the_torques_that_is_given_is_a_share() -> None:
    bench = circling(lib.OMNI_CTL_MODE_TORQUE)
    for _ in range(100):
        assert 0.0 < bench.tick(count=20).duty_scale <= 1.0


def test_the_pose_of_a_velocity_means_nothing() -> None:
    bench = Bench(LIM_POS=2.0)
    bench.arm()
    for place in ((0.0, 0.0, 0.0), (2.5, 0.0, 0.0), (0.0, -9.0, 0.0)):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, pose=place, twist=(0.05, 0.0, 0.0))
        out = bench.tick(count=300)
        assert not out.faults & lib.OMNI_WARN_SETPOINT
        assert out.reference.rate.vx == pytest.approx(0.05, abs=1e-3)


def test_a_far_heading_is_turned_to_within_the_limit_of_the_turn_rate() -> None:
    bench = Bench(LIM_W=0.3)
    bench.arm()
    fastest = 0.0
    for _ in range(300):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.0, 0.0, 2.5))
        fastest = max(fastest, abs(bench.tick(count=10).reference.rate.wz))
    assert fastest == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize("mode", [OFF, SPEED])
def test_after_a_counter_that_is_somewhere_else_the_next_count_is_of_one_tick(mode: int) -> None:
    """Ticks without a count before it belong to a way that nobody knows."""
    counts = 20
    core = Filter(mode)
    for _ in range(400):
        core.step(6.0, counts)
    for _ in range(5):
        core.step(6.0, 0, valid=False)
    fresh = ffi.new("omni_motor_kf_state_t *", core.state[0])
    lib.omni_motor_kf_rebase(core.state)
    got = core.step(6.0, counts)
    lib.omni_motor_kf_rebase(fresh)
    fresh.missed = 0
    assert got == lib.omni_motor_kf_step(fresh, core.config, 6.0, counts, True)
    if mode == OFF:
        assert got == pytest.approx(counts * RAD_PER_COUNT / STEP_S)
    assert math.isfinite(got)


@pytest.mark.parametrize(("step_s", "ticks"), [(0.001, 20), (0.01, 2), (0.05, 1), (1.0, 1)])
def test_the_original_law_steps_every_twenty_milliseconds_or_every_tick(step_s: float, ticks: int) -> None:
    config = lib.omni_original_defaults(step_s, 1e-3)
    assert config.period_ticks == ticks
    assert config.period_s == pytest.approx(ticks * step_s)
