# SPDX-License-Identifier: MIT
"""More noise of x, y and heading without fixes: when it begins and ends, what it leaves alone, and late fixes.

A robot that stands without fixes has none at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
from omniwheel.core_config import robot_config
from tests.core.test_gyro import DENSITY, DISTANCE_M, Q_SLIP, Q_THETA, Q_XY, RADIUS_M, Filter
from tests.core.test_pose_ekf import POSE, SLIP, TICK_US, Array, Ekf, assert_late_fix_is_exact, drive, reference

ALONE = 3.0
ALONE_TICKS = lib.OMNI_EKF_DEAD_RECKONING_AFTER_US // TICK_US
SLOT_TICKS = lib.OMNI_EKF_SLOT_TICKS  # what begins, begins with a slot of the history
NOISE = reference.Noise()
STANDS = [0.0, 0.0, 0.0]
TURNS = [1e-6, 1e-6, 1e-6]  # on the spot, so that an unsure heading does not make the position unsure


def grown(ekf: Ekf, ticks: int, wheels: Sequence[float] = TURNS) -> Array:
    """Return by how many times q the variances of x and heading grow per tick, of a robot that turns on the spot."""
    before = np.diag(ekf.p)[[0, 2]]
    ekf.predict(wheels, ticks)
    return np.asarray((np.diag(ekf.p)[[0, 2]] - before) / ticks / [NOISE.q_xy, NOISE.q_theta])


def test_it_begins_two_seconds_after_a_fix_and_ends_with_the_next() -> None:
    ekf = Ekf(dead_reckoning_noise=ALONE, sd=(1e-3, 1e-3), gate=25.0)
    ekf.predict(STANDS)
    assert ekf.correct((0.0, 0.0, 0.0)) == lib.OMNI_OK
    assert grown(ekf, ALONE_TICKS) == pytest.approx([1.0, 1.0], rel=1e-3)
    ekf.predict(TURNS, SLOT_TICKS)
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-3)
    assert ekf.correct((9.0, 9.0, 0.0)) == lib.OMNI_ERR_RANGE
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-3), "a fix that is refused does not end it"
    assert ekf.correct((0.0, 0.0, 0.0)) == lib.OMNI_OK
    assert grown(ekf, 1000) == pytest.approx([1.0, 1.0], rel=1e-3)


@pytest.mark.parametrize("begun_us", [0, 3_000_000, 2**40])
def test_a_filter_that_never_had_a_fix_is_alone_two_seconds_after_its_first_tick(begun_us: int) -> None:
    """However long the robot's clock has run before."""
    ekf = Ekf(dead_reckoning_noise=ALONE, sd=(1e-3, 1e-3))
    ekf.time_us = begun_us
    ekf.predict(STANDS)
    assert grown(ekf, ALONE_TICKS) == pytest.approx([1.0, 1.0], rel=1e-3)
    ekf.predict(TURNS, SLOT_TICKS)
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-3)


def test_a_pose_that_is_set_counts_as_told() -> None:
    ekf = Ekf(dead_reckoning_noise=ALONE, sd=(1e-3, 1e-3))
    ekf.predict(STANDS, 2 * ALONE_TICKS)
    assert ekf.s.pose_noise_factor == 1.0 + ALONE
    lib.omni_pose_ekf_set_pose(ekf.s, ekf.config, ffi.new("omni_pose_t *"), ekf.time_us)
    assert ekf.s.pose_noise_factor == 1.0
    assert grown(ekf, ALONE_TICKS) == pytest.approx([1.0, 1.0], rel=1e-2)
    ekf.predict(TURNS, SLOT_TICKS)
    assert grown(ekf, 1000) == pytest.approx([1.0 + ALONE] * 2, rel=1e-2)


def test_the_parameter_is_a_factor_of_the_deviation() -> None:
    scenario = load_scenario("demo")
    for factor in (1.0, 2.5):
        values = scenario.with_parameters({"EKF_ALONE": factor}).parameter_values()
        config = robot_config(values, scenario.robot.table, 0)
        assert config.pose_ekf.dead_reckoning_noise == pytest.approx(factor**2 - 1.0)


@pytest.mark.parametrize("alone", [0.0, ALONE])
def test_with_a_gyro_only_the_wheels_share_of_a_slot_is_noisier(alone: float) -> None:
    """The slip ratios learn from what gyro and wheels are apart; its variance has the gyro's own noise once."""
    found = Filter()
    found.config.dead_reckoning_noise = alone
    found.s.pose_noise_factor = 1.0
    turned = [0.2 * 1e-3] * 3
    for _ in range(4 * (ALONE_TICKS // 4 + 10)):
        found.predict(turned, 0.2 * RADIUS_M / DISTANCE_M)
    assert found.s.pose_noise_factor == 1.0 + alone
    before = found.p[3:6, 3:6]
    for _ in range(4):
        found.predict(turned, 0.2 * RADIUS_M / DISTANCE_M)
    row = np.linalg.pinv(found.matrix)[2] * RADIUS_M * np.array(turned) * 4.0
    noise = 4.0 * (DENSITY**2 * 1e-3 + Q_THETA * (1.0 + alone))
    assert noise > 0.0
    prior = before + np.eye(3) * Q_SLIP * 4.0
    gain = prior @ row / (row @ prior @ row + noise)
    expected = prior - np.outer(gain, row @ prior)
    assert np.diag(found.p[3:6, 3:6]) == pytest.approx(np.diag(expected), rel=2e-2)


def test_what_a_gyro_gave_wrongly_comes_back_with_the_wheels_noise_of_now() -> None:
    grown_by = []
    for factor in (1.0, 5.0):
        found = Filter()
        found.s.pose_noise_factor = factor
        before = found.p[2, 2]
        lib.omni_pose_ekf_undo_gyro_turn(found.s, found.config, found.k, 0.01, 2.0, 0.0)
        grown_by.append(found.p[2, 2] - before)
    assert grown_by[0] == pytest.approx(Q_THETA * 2000.0, rel=1e-2)
    assert grown_by[1] == pytest.approx(5.0 * grown_by[0], rel=1e-2)


def test_slip_ratios_gather_no_more_noise() -> None:
    """Their variances are those of a filter without the extra noise; the pose's are larger."""
    found = []
    for alone in (0.0, ALONE):
        ekf = Ekf(3, SLIP, dead_reckoning_noise=alone)
        ekf.s.p[3][3] = ekf.s.p[4][4] = ekf.s.p[5][5] = 1e-6  # below p_slip, so they grow
        ekf.predict([0.01, 0.02, -0.01], 2 * ALONE_TICKS)
        found.append(np.diag(ekf.p))
    assert (found[0][3:] == found[1][3:]).all()
    assert (found[0][3:] > 1e-5).all()
    assert (found[1][:3] > found[0][:3]).all()


def test_one_times_is_the_filter_that_is_never_alone_bit_by_bit() -> None:
    """One of both gets a fix that changes nothing, of a sensor as bad as can be, so it is never alone."""
    plain, told = Ekf(3, SLIP), Ekf(3, SLIP)
    for ekf in (plain, told):
        ekf.predict([0.01, 0.02, -0.01], ALONE_TICKS)
        if ekf is told:
            ekf.s.last_absolute_update_us = ekf.time_us
        ekf.predict([0.01, 0.02, -0.01], ALONE_TICKS)
    told.s.last_absolute_update_us = plain.s.last_absolute_update_us
    assert plain.snapshot() == told.snapshot()


def test_a_robot_that_stands_without_fixes_gets_no_less_sure() -> None:
    """Before the filter is alone its noise counts: fixes tell when somebody pushes it."""
    ekf = Ekf(3, SLIP, dead_reckoning_noise=ALONE, sd=(1e-3, 1e-3))
    ekf.predict(STANDS)
    assert grown(ekf, ALONE_TICKS, STANDS) == pytest.approx([1.0, 1.0], rel=1e-3)
    ekf.predict(STANDS, SLOT_TICKS)
    before = ekf.p
    ekf.predict(STANDS, 600_000)
    assert (ekf.p == before).all()
    moves = [1e-3, 0.0, 0.0]
    for _ in range(100):
        ekf.predict(moves)
        ekf.predict(STANDS, SLOT_TICKS - 1)
    now = np.diag(ekf.p)[[0, 2]] - np.diag(before)[[0, 2]]
    assert (now > 0.99 * np.multiply([NOISE.q_xy, NOISE.q_theta], 100 * SLOT_TICKS * (1.0 + ALONE))).all()


@pytest.mark.full
def test_at_rest_a_gyro_does_not_make_the_heading_less_sure() -> None:
    """Its bias is still learned; one that turns by hand, wheels still, counts as motion."""
    found = Filter()
    found.config.dead_reckoning_noise = ALONE
    lib.omni_pose_ekf_start_gyro(found.s, found.config)
    for _ in range(ALONE_TICKS + SLOT_TICKS):
        found.predict(STANDS, 0.0, leads=False, rest=True)
    before = found.p
    for _ in range(100_000):
        found.predict(STANDS, 0.0, leads=False, rest=True)
    assert (np.diag(found.p)[:3] == np.diag(before)[:3]).all()
    assert found.p[7, 7] < before[7, 7]
    for _ in range(100_000):
        found.predict(STANDS, 0.1)
    assert found.p[2, 2] - before[2, 2] > 100.0 * DENSITY**2
    assert found.p[0, 0] - before[0, 0] > 0.99 * 100_000 * Q_XY * (1.0 + ALONE)


def stand(ekf: Ekf, corrected_ticks: Sequence[int]) -> None:
    """Stand a while, and settle `p` within slots, as whatever corrects the estimate does."""
    for tick in range(400):
        ekf.predict(STANDS)
        if tick in corrected_ticks:
            lib.omni_pose_ekf_propagate_covariance(ekf.s, ekf.config, ekf.k)


def test_noise_that_is_in_p_already_stays_there() -> None:
    """A slot that is settled half-way has counted for half. Nothing is taken out of `p` again."""
    found = []
    for corrected in ((), range(1, 400, 4)):
        ekf = Ekf(3, SLIP, dead_reckoning_noise=ALONE, sd=(1e-9, 1e-9))
        ekf.predict(STANDS)
        ekf.s.last_absolute_update_us = 0
        ekf.time_us += 2 * lib.OMNI_EKF_DEAD_RECKONING_AFTER_US
        ekf.predict(STANDS, 2 * SLOT_TICKS + 1)  # the first one is long, and a slot of its own
        before = ekf.p
        stand(ekf, corrected)
        found.append((np.diag(ekf.p) - np.diag(before))[[0, 2]])
        assert (np.diff([before[0, 0], ekf.p[0, 0]]) >= 0.0).all()
    assert (found[0] == 0.0).all()
    expected = np.multiply([NOISE.q_xy, NOISE.q_theta], 100 * 2 * (1.0 + ALONE))
    assert found[1] == pytest.approx(expected, rel=2e-2)


def carry(filter_: Any, motion: Sequence[tuple[Array, float, float]]) -> None:
    for turned, factor, slip_factor in motion:
        filter_.noise = reference.Noise(NOISE.q_xy * factor, NOISE.q_theta * factor, NOISE.q_slip * slip_factor)
        filter_.predict(turned)


@pytest.mark.parametrize(("wheels", "mode"), [(3, POSE), (3, SLIP), (4, SLIP)])
@pytest.mark.parametrize("age_ticks", [0, 30, 200])
def test_a_late_fix_after_a_gap_is_exact(wheels: int, mode: int, age_ticks: int) -> None:
    """It was taken before, or after, the extra noise began; a float64 filter goes back to that time."""
    ekf = Ekf(wheels, mode, dead_reckoning_noise=ALONE)
    ticks = ALONE_TICKS + 100
    motion: list[tuple[Array, float, float]] = []
    for number, turned in enumerate(drive(wheels, ticks, 5), start=1):
        ekf.predict(turned)
        ekf.config.p_slip = 0.25  # so that slip ratios gather noise, but for the first tick
        motion.append((turned, 1.0 + ALONE if number > ALONE_TICKS + SLOT_TICKS else 1.0, 0.0 if number == 1 else 1.0))
    assert_late_fix_is_exact(ekf, motion, carry, age_ticks)
