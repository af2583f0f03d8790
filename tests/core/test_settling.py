# SPDX-License-Identifier: MIT
"""The covariance follows the motion once per slot of the history. Against one that follows each tick, in float64."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from omniwheel._core import ffi, lib
from tests.core.test_gyro import RADIUS_M
from tests.core.test_gyro import Filter as GyroFilter
from tests.core.test_gyro import Reference as GyroReference
from tests.core.test_pose_ekf import MODES, SLIP, Ekf, drive, make_reference, reference

Array = NDArray[np.float64]
P_SLIP = 0.0064


def compare(p: Array, exact: Array, relative: float) -> None:
    sd = np.sqrt(np.diag(exact))
    used = sd > 0.0
    scale = np.outer(sd[used], sd[used])
    assert np.abs((p - exact)[np.ix_(used, used)] / scale).max() <= relative


def settle(ekf: Any) -> None:
    lib.omni_pose_ekf_propagate_covariance(ekf.s, ekf.config, ekf.k)


def both(ekf: Ekf, exact: Any, motion: Array, step_us: int = 1000) -> Iterator[int]:
    """Drive the core's filter and the exact one, and yield each tick after it.

    From the second tick on a slip ratio is known better than p_slip, so its noise counts.
    """
    for tick, turned in enumerate(motion):
        exact.noise = reference.Noise() if tick > 0 else reference.Noise(q_slip=0.0)
        ekf.time_us += step_us - 1000
        ekf.predict(turned)
        exact.predict(turned)
        ekf.config.p_slip = 0.25
        yield tick


@MODES
def test_after_any_tick_it_is_what_following_each_tick_gives(wheels: int, mode: int) -> None:
    """A fast robot that turns and changes its speed within a slot, so that no tick of it is like the next."""
    ekf = Ekf(wheels, mode, r_null=0.0)
    exact = make_reference(ekf)
    for tick in both(ekf, exact, drive(wheels, 400, 5, speed=30.0)):
        compare(ekf.p, exact.p, relative=5e-5)  # 400 ticks, each rounded to 6e-8
        assert ekf.s.unpropagated_ticks == (tick + 1) % 4, "a tick alone leaves it until the slot ends"


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


@pytest.mark.parametrize("first", [True, False], ids=["off", "on"])
@pytest.mark.parametrize("phase", [1, 2, 3])
def test_a_gyro_that_is_switched_within_a_slot_leaves_nothing_of_it_out(phase: int, first: bool) -> None:
    """As if the covariance had been settled before: the wheels turn the body, then the gyro, or the other way round."""
    left, settled = GyroFilter(), GyroFilter()
    for turned, rate in rates(left, 400 + phase):
        for core in (left, settled):
            core.config.has_gyro = first
            move(core, turned, rate, gyro=first)
    settle(settled)
    for turned, rate in rates(left, 9):
        for core in (left, settled):
            core.config.has_gyro = not first
            move(core, turned, rate, gyro=not first)
    compare(left.p, settled.p, relative=1e-5)
    assert left.s.slot_ticks == 1, "the slot ended where the states changed"


def move(core: GyroFilter, turned: Array, rate: float, gyro: bool) -> None:
    """One tick with or without a gyro."""
    if gyro:
        core.predict(turned, rate)
    else:
        core.time_us += 1000
        lib.omni_pose_ekf_predict(core.s, core.config, core.k, ffi.new("float[4]", list(turned)), core.time_us)


def test_a_gyro_that_starts_anew_within_a_slot_has_only_what_came_since() -> None:
    core = GyroFilter()
    for turned, rate in rates(core, 402):
        core.predict(turned, rate)
    assert core.s.slot_ticks == 2
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    for turned, rate in rates(core, 1):
        core.predict(turned, rate)
    p = core.p
    bias = 3 + lib.OMNI_EKF_GYRO_BIAS
    assert p[bias, bias] == pytest.approx(core.config.p_bias, rel=1e-3)
    assert p[2, bias] == pytest.approx(-1e-3 * core.config.p_bias, rel=1e-2), "one tick of 1 ms, not three"


@pytest.mark.parametrize("phase", [0, 1, 2, 3])
def test_slip_ratios_that_start_within_a_slot_know_nothing_of_before(phase: int) -> None:
    """The mode changes between two ticks of a slot."""
    ekf = Ekf(3, lib.OMNI_EKF_MODE_POSE)
    for turned in drive(3, 400 + phase, 5):
        ekf.predict(turned)
    ekf.config.mode = SLIP
    exact = make_reference(ekf)
    exact.x = np.array([*ekf.x[:3], 0.0, 0.0, 0.0])
    exact.p[:3, :3] = np.array([[ekf.settled().p[a][b] for b in range(3)] for a in range(3)])
    exact.noise = reference.Noise(q_slip=0.0)
    for turned in drive(3, 9, 5):
        ekf.predict(turned)
        exact.predict(turned)
    compare(ekf.p, exact.p, relative=1e-5)


@MODES
@pytest.mark.parametrize("step_us", [5000, 20_000, 40_000])
def test_long_steps_are_slots_of_their_own(wheels: int, mode: int, step_us: int) -> None:
    """As when a log is replayed. The gain of a slot is that of its middle, so a slot must not be long."""
    step_s = step_us * 1e-6
    ekf = Ekf(wheels, mode, r_null=0.0, step_s=step_s)
    exact = make_reference(ekf)
    for _ in both(ekf, exact, step_us / 1000 * drive(wheels, 300, 5, speed=10.0), step_us):
        pass
    compare(ekf.p, exact.p, relative=3e-4)


@MODES
@pytest.mark.parametrize("every", [3, 5, 7])
def test_fixes_at_every_phase_of_a_slot(wheels: int, mode: int, every: int) -> None:
    rng = np.random.default_rng(2)
    ekf = Ekf(wheels, mode, r_null=0.0)
    exact = make_reference(ekf)
    for tick in both(ekf, exact, drive(wheels, 600, 5, speed=10.0)):
        if tick % every == 0 and tick > 0:
            fix = (exact.x[:3] + rng.normal(0.0, 0.005, 3)).astype(np.float32).astype(float)
            assert ekf.correct(fix) == lib.OMNI_OK
            exact.update(fix)
            compare(ekf.p, exact.p, relative=1e-4)
    assert np.abs(ekf.x - exact.x).max() < 1e-3 * np.sqrt(np.diag(exact.p)).max()


def test_a_gyro_that_was_wrong_is_taken_back_with_the_covariance_of_now() -> None:
    core, settled = GyroFilter(), GyroFilter()
    for turned, rate in rates(core, 402):
        for each in (core, settled):
            each.predict(turned, rate)
    settle(settled)
    for each in (core, settled):
        lib.omni_pose_ekf_undo_gyro_turn(each.s, each.config, each.k, 1.5, 30.0, 0.5)
    assert np.array_equal(core.p, settled.p)
