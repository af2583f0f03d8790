# SPDX-License-Identifier: MIT
"""The covariance follows the motion once per slot of the history. Against one that follows each tick, in float64."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from omniwheel._core import ffi, lib
from tests.core.test_gyro import Filter as GyroFilter
from tests.core.test_gyro import Reference as GyroReference
from tests.core.test_gyro import RADIUS_M
from tests.core.test_pose_ekf import GEOMETRY, MODES, SLIP, Ekf, drive, make_reference, reference

Array = NDArray[np.float64]
P_SLIP = 0.0064


def compare(p: Array, exact: Array, relative: float) -> None:
    sd = np.sqrt(np.diag(exact))
    used = sd > 0.0
    scale = np.outer(sd[used], sd[used])
    assert np.abs((p - exact)[np.ix_(used, used)] / scale).max() <= relative


def settle(ekf: Any) -> None:
    lib.omni_pose_ekf_settle(ekf.s, ekf.config, ekf.k)


@MODES
def test_after_any_tick_it_is_what_following_each_tick_gives(wheels: int, mode: int) -> None:
    """A fast robot that turns and changes its speed within a slot, so that no tick of it is like the next."""
    ekf = Ekf(wheels, mode, r_null=0.0)
    exact = make_reference(ekf)
    for tick, turned in enumerate(drive(wheels, 400, 5, speed=30.0)):
        exact.noise = reference.Noise() if tick > 0 else reference.Noise(q_slip=0.0)
        ekf.predict(turned)
        exact.predict(turned)
        ekf.config.p_slip = 0.25  # from the second tick on a ratio is known better than that, so its noise counts
        compare(ekf.p, exact.p, relative=5e-5)  # 400 ticks, each rounded to 6e-8
        assert ekf.s.settled_ticks in (0, ekf.s.slot_tick), tick


@MODES
def test_settling_within_a_slot_changes_the_covariance_by_rounding_only(wheels: int, mode: int) -> None:
    rng = np.random.default_rng(8)
    whole, parts = Ekf(wheels, mode), Ekf(wheels, mode)
    for turned in drive(wheels, 500, 9, speed=30.0):
        for ekf in (whole, parts):
            ekf.predict(turned)
        if rng.uniform() < 0.5:
            settle(parts)
            once = bytes(ffi.buffer(parts.s))
            settle(parts)
            assert bytes(ffi.buffer(parts.s)) == once, "a second time there is nothing to do"
    compare(parts.p, whole.p, relative=2e-5)
    if not (wheels == 4 and mode == SLIP):  # there the wheels' contradiction corrects the pose, with the covariance
        assert np.array_equal(parts.x, whole.x)


def rates(core: GyroFilter, ticks: int) -> Iterator[tuple[Array, float]]:
    """Yield what the wheels turn in a tick, and what the gyro says of it."""
    inverse = np.linalg.pinv(core.matrix)
    for turned in drive(3, ticks, 6, speed=20.0):
        yield turned, float(inverse[2] @ (RADIUS_M * turned)) / 1e-3 + 0.01


def test_with_a_gyro_it_is_what_following_each_tick_gives() -> None:
    core = GyroFilter()
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    for _ in range(4):
        core.predict(np.zeros(3), 0.0)
    exact = GyroReference(core)
    for turned, rate in rates(core, 400):
        core.predict(turned, rate)
        exact.predict(turned, rate, True)
        compare(core.p, exact.p, relative=2e-4)
    assert exact.skids == 0


def test_settling_within_a_slot_in_which_the_gyro_leads_some_ticks_changes_nothing() -> None:
    whole, parts = GyroFilter(), GyroFilter()
    rng = np.random.default_rng(4)
    for turned, rate in rates(whole, 403):
        leads = bool(rng.uniform() < 0.7)
        for core in (whole, parts):
            core.predict(turned, rate, leads)
        if rng.uniform() < 0.5:
            settle(parts)
    compare(parts.p, whole.p, relative=2e-4)


def test_a_gyro_that_is_switched_on_within_a_slot_starts_with_what_is_not_known_of_it() -> None:
    core = GyroFilter()
    for turned, rate in rates(core, 402):
        core.predict(turned, rate)
    assert core.s.slot_tick == 2
    settle(core)
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    for turned, rate in rates(core, 2):
        core.predict(turned, rate)
    p = core.p
    bias = 3 + lib.OMNI_EKF_BIAS
    assert p[bias, bias] == pytest.approx(core.config.p_bias, rel=1e-3)
    assert abs(p[2, bias]) < 0.01 * core.config.p_bias, "two ticks, not what the slot had before"


def test_slip_ratios_that_start_within_a_slot_know_nothing_of_its_first_half() -> None:
    """The mode changes between two ticks of a slot."""
    ekf = Ekf(3, lib.OMNI_EKF_MODE_POSE)
    for turned in drive(3, 402, 5):
        ekf.predict(turned)
    ekf.config.mode = SLIP
    for turned in drive(3, 2, 5):
        ekf.predict(turned)
    assert np.diag(ekf.p)[3:] == pytest.approx([P_SLIP] * 3, rel=1e-3)
    reach_m = GEOMETRY[3].radius_m * np.abs(drive(3, 2, 5)).sum(axis=0)
    assert (np.abs(ekf.p[:2, 3:]) <= 1.01 * reach_m * P_SLIP).all()
