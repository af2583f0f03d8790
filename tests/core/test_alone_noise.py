# SPDX-License-Identifier: MIT
"""More noise of x, y and heading without fixes: when it begins and ends, what it leaves alone, and late fixes."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_pose_ekf import GEOMETRY, POSE, SLIP, TICK_US, Array, Ekf, assert_same, drive, float32, reference

ALONE = 3.0
ALONE_TICKS = lib.OMNI_EKF_ALONE_US // TICK_US
NOISE = reference.Noise()
STANDS = [0.0, 0.0, 0.0]


def grown(ekf: Ekf, ticks: int) -> Array:
    """Return by how many times q the variances of x and heading grow per tick, of a robot that stands."""
    before = np.diag(ekf.p)[[0, 2]]
    ekf.predict(STANDS, ticks)
    return np.asarray((np.diag(ekf.p)[[0, 2]] - before) / ticks / [NOISE.q_xy, NOISE.q_theta])


def test_it_begins_two_seconds_after_a_fix_and_ends_with_the_next() -> None:
    ekf = Ekf(alone=ALONE, sd=(1e-3, 1e-3), gate=25.0)
    ekf.predict(STANDS)
    assert ekf.correct((0.0, 0.0, 0.0)) == lib.OMNI_OK
    assert grown(ekf, ALONE_TICKS) == pytest.approx([1.0, 1.0], rel=1e-3)
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-3)
    assert ekf.correct((9.0, 9.0, 0.0)) == lib.OMNI_ERR_RANGE
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-3), "a fix that is refused does not end it"
    assert ekf.correct((0.0, 0.0, 0.0)) == lib.OMNI_OK
    assert grown(ekf, 1000) == pytest.approx([1.0, 1.0], rel=1e-3)


def test_a_filter_that_never_had_a_fix_is_alone() -> None:
    ekf = Ekf(alone=ALONE, sd=(1e-3, 1e-3))
    ekf.time_us = 3_000_000
    ekf.predict(STANDS)
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-3)


def test_slip_ratios_gather_no_more_noise() -> None:
    """Their variances are those of a filter without the extra noise; the pose's are larger."""
    found = []
    for alone in (0.0, ALONE):
        ekf = Ekf(3, SLIP, alone=alone)
        ekf.s.p[3][3] = ekf.s.p[4][4] = ekf.s.p[5][5] = 1e-6  # below p_slip, so they grow
        ekf.predict([0.01, 0.02, -0.01], 2 * ALONE_TICKS)
        found.append(np.diag(ekf.p))
    assert (found[0][3:] == found[1][3:]).all()
    assert (found[0][3:] > 1e-5).all()
    assert (found[1][:3] > found[0][:3]).all()


def test_one_times_is_the_filter_without_it_bit_by_bit() -> None:
    plain, same = Ekf(3, SLIP), Ekf(3, SLIP, alone=0.0)
    for ekf in (plain, same):
        ekf.predict([0.01, 0.02, -0.01], 2 * ALONE_TICKS)
        assert ekf.correct((0.01, 0.0, 0.1), 40 * TICK_US) == lib.OMNI_OK
    assert plain.snapshot() == same.snapshot()
    assert plain.s.white_factor == 1.0


def carry(filter_: Any, motion: list[tuple[Array, float, float]]) -> None:
    for turned, factor, slip_factor in motion:
        filter_.noise = reference.Noise(NOISE.q_xy * factor, NOISE.q_theta * factor, NOISE.q_slip * slip_factor)
        filter_.predict(turned)


@pytest.mark.parametrize(("wheels", "mode"), [(3, POSE), (3, SLIP), (4, SLIP)])
@pytest.mark.parametrize("age_ticks", [0, 30, 200])
def test_a_late_fix_after_a_gap_is_exact(wheels: int, mode: int, age_ticks: int) -> None:
    """It was taken before, or after, the extra noise began; a float64 filter goes back to that time."""
    ekf = Ekf(wheels, mode, alone=ALONE)
    p = np.diag([1e-4, 1e-4, 1e-4, *[0.0064] * (ekf.states - 3)])
    past = reference.Filter(GEOMETRY[wheels], reference.Noise(), np.zeros(ekf.states), p)
    ticks = ALONE_TICKS + 100
    motion: list[tuple[Array, float, float]] = []
    for number, turned in enumerate(drive(wheels, ticks, 5), start=1):
        ekf.predict(turned)
        ekf.config.p_slip = 0.25  # so that slip ratios gather noise, but for the first tick
        motion.append((turned, 1.0 + ALONE if number > ALONE_TICKS else 1.0, 0.0 if number == 1 else 1.0))
    split = ticks - age_ticks
    carry(past, motion[:split])
    fix = float32(past.x[:3] + [0.004, -0.003, 0.005])
    assert ekf.correct(fix, age_ticks * TICK_US) == lib.OMNI_OK
    past.update(fix)
    now = copy.deepcopy(past)
    carry(now, motion[split:])
    assert_same(ekf, now, mean_sd=5e-3, relative=5e-3)
