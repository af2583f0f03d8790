# SPDX-License-Identifier: MIT
"""The mean of each slip ratio: what it learns from, when ratios return to it, and that a late fix stays exact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
from omniwheel.core_config import robot_config
from tests.core.test_pose_ekf import (
    GEOMETRY,
    POSE,
    SLIP,
    TICK_US,
    Array,
    Ekf,
    assert_late_fix_is_exact,
    drive,
    reference,
)

ALONE_TICKS = lib.OMNI_EKF_DEAD_RECKONING_AFTER_US // TICK_US
SLOT_TICKS = lib.OMNI_EKF_SLOT_TICKS
SEEN_TICKS = 250
"""So long after a fix a ratio counts as seen."""
RATE = 0.01
KNOWN = 1e-4
"""Variance of a slip ratio that is known well; p_slip is 0.0064."""
SLIPS = np.array([0.06, 0.02, -0.03])


def known(rate: float = RATE, wheels: int = 3, **options: Any) -> Ekf:
    """Return a filter that knows its slip ratios, which do not become less sure, and that has just begun."""
    ekf = Ekf(wheels, SLIP, noise=reference.Noise(q_slip=0.0), mean_reversion=rate, **options)
    ekf.predict([0.0] * wheels)  # it takes on its mode
    for i in range(wheels):
        ekf.s.error_state[i] = SLIPS[i % 3]
        ekf.s.history[0].error_state[i] = SLIPS[i % 3]
        ekf.s.p[3 + i][3 + i] = KNOWN
    return ekf


class GyroEkf(Ekf):
    """With a gyro, whose readings are exact: it has neither bias nor noise."""

    overrides_wheels, rate_rad_s = True, 0.0

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, has_gyro=True, **options)

    def predict(self, turned: Any, count: int = 1) -> None:
        wheels = ffi.new("float[4]", list(turned))
        turn = ffi.new(
            "omni_ekf_gyro_rate_t *", {"rate_rad_s": self.rate_rad_s, "overrides_wheels": self.overrides_wheels}
        )
        for _ in range(count):
            self.time_us += TICK_US
            lib.omni_pose_ekf_predict_gyro(self.s, self.config, self.k, wheels, turn, self.time_us)


def tell(ekf: Ekf) -> None:
    """A fix that changes nothing has come now."""
    ekf.s.last_absolute_update_us = ekf.s.last_fix_us = ekf.time_us


def means(ekf: Ekf) -> Array:
    return np.array([ekf.s.mean_slip[i] for i in range(ekf.wheels)])


def slips(ekf: Ekf) -> Array:
    return np.array([ekf.s.error_state[i] for i in range(ekf.wheels)])


def learned(rate: float = RATE, ways_m: float = 4.0) -> Ekf:
    """Return one that has rolled so far with these ratios while it was told its pose."""
    ekf = known(rate)
    turned = 0.2
    slot_m = SLOT_TICKS * turned * GEOMETRY[3].radius_m
    for _ in range(round(ways_m / slot_m)):
        tell(ekf)
        ekf.predict([turned] * 3, SLOT_TICKS)
    return ekf


def test_the_mean_over_a_way_is_that_of_the_ratios_weighted_with_what_the_wheel_rolled() -> None:
    """One metre of "nothing slips" counts along: after 4 m it is 4/5 of them, and a ratio that changes is averaged."""
    ekf = learned(ways_m=4.0)
    assert means(ekf) == pytest.approx(SLIPS * 4.0 / 5.0, rel=3e-3)
    before = ekf.s.mean_slip_distance_m[0]
    assert before == pytest.approx(4.0, rel=0.01)
    for i in range(3):
        ekf.s.error_state[i] = 0.1
    for _ in range(round(3.0 / (SLOT_TICKS * 0.2 * GEOMETRY[3].radius_m))):
        tell(ekf)
        ekf.predict([0.2, -0.2, 0.2], SLOT_TICKS)
    way = ekf.s.mean_slip_distance_m[0]
    assert way == pytest.approx(7.0, rel=0.01)
    assert means(ekf) == pytest.approx((SLIPS * before + 0.1 * (way - before)) / (way + 1.0), rel=5e-3)


def test_the_way_counts_up_to_ten_metres() -> None:
    ekf = learned(ways_m=14.0)
    assert ekf.s.mean_slip_distance_m[1] == 10.0
    assert means(ekf) == pytest.approx(SLIPS, rel=0.1)


@pytest.mark.parametrize("why", ["it stands", "the ratio is not known", "no fix has come", "the last fix is old"])
def test_it_learns_nothing(why: str) -> None:
    ekf = known()
    if why == "the ratio is not known":
        for i in range(3):
            ekf.s.p[3 + i][3 + i] = 0.5 * ekf.config.p_slip
    if why != "no fix has come":  # the pose counts as told from the first tick on, but nobody saw a slip ratio
        tell(ekf)
    if why == "the last fix is old":
        ekf.predict([0.0] * 3, SEEN_TICKS)
    ekf.predict([0.0 if why == "it stands" else 0.02] * 3, SEEN_TICKS)
    assert (means(ekf) == 0.0).all()
    assert ekf.s.mean_slip_distance_m[0] == 0.0


def test_ratios_return_two_seconds_after_the_last_fix_and_no_sooner() -> None:
    ekf = learned()
    for i in range(3):
        ekf.s.error_state[i] = 0.1
    tell(ekf)
    ekf.predict([0.02] * 3, SEEN_TICKS)
    mean = means(ekf)
    ekf.predict([0.02] * 3, ALONE_TICKS - SEEN_TICKS)
    assert slips(ekf) == pytest.approx(0.1, abs=1e-7)
    assert (means(ekf) == mean).all(), "a ratio of which nothing new is known teaches nothing"
    way = ekf.s.mean_slip_distance_m[0]
    slots = 150
    ekf.predict([0.02] * 3, slots * SLOT_TICKS)
    left = (1.0 - RATE * way / (way + 1.0)) ** slots
    assert slips(ekf) == pytest.approx(mean + (0.1 - mean) * left, rel=1e-3)
    assert (means(ekf) == mean).all(), "a mean learns nothing of what it brings about"
    tell(ekf)
    before = slips(ekf)
    ekf.predict([0.02] * 3, 100 * SLOT_TICKS)
    assert (slips(ekf) == before).all()


def test_a_wheel_that_stands_keeps_its_ratio() -> None:
    ekf = learned()
    ekf.s.error_state[0] = ekf.s.error_state[1] = 0.1
    ekf.predict([0.0] * 3, 2 * ALONE_TICKS)
    assert slips(ekf)[:2] == pytest.approx(0.1, abs=1e-7)
    ekf.predict([0.02, 0.0, 0.02], 50 * SLOT_TICKS)
    assert slips(ekf)[0] < 0.09
    assert slips(ekf)[1] == pytest.approx(0.1, abs=1e-7)


@pytest.mark.parametrize("robot", ["three wheels", "four wheels", "gyro"])
def test_a_mean_that_was_never_seen_changes_nothing(robot: str) -> None:
    """Bit by bit: a robot that drives away at once, and never has a fix, has the filter of a rate of 0.

    A gyro measures a sum of the ratios. That does not teach what each of them is.
    """
    kind, wheels = (GyroEkf, 3) if robot == "gyro" else (Ekf, 4 if robot == "four wheels" else 3)
    turned = np.array([0.02, 0.01, -0.01, 0.01])[:wheels]
    found = [kind(wheels, SLIP, r_null=6.6e-11, mean_reversion=rate) for rate in (0.0, 1.0)]
    for ekf in found:
        if isinstance(ekf, GyroEkf):  # it turns 3 % less than the wheels
            ekf.rate_rad_s = 0.97e3 * (GEOMETRY[3].inverse[2] @ turned) * GEOMETRY[3].radius_m
        ekf.predict(turned, 2 * ALONE_TICKS)
        assert slips(ekf).any() == (robot == "gyro")
    assert found[0].snapshot() == found[1].snapshot()


def test_a_sensor_of_motion_over_the_floor_keeps_the_ratios_where_it_sees_them() -> None:
    ekf = learned()
    for i in range(3):
        ekf.s.error_state[i] = 0.1
    ekf.predict([0.0] * 3, 2 * ALONE_TICKS)
    for _ in range(50):
        ekf.s.flow_slots = 5
        ekf.predict([0.02] * 3, SLOT_TICKS)
    assert slips(ekf) == pytest.approx(0.1, abs=1e-7)


def test_variances_are_those_of_ratios_that_stay() -> None:
    found = [learned(rate) for rate in (0.0, RATE)]
    for ekf in found:
        ekf.predict([0.02] * 3, 2 * ALONE_TICKS)
    assert np.diag(found[0].p)[3:] == pytest.approx(np.diag(found[1].p)[3:], rel=1e-6)
    assert np.diag(found[0].p)[:3] == pytest.approx(np.diag(found[1].p)[:3], rel=0.05)


@pytest.mark.parametrize("how", ["pose set", "another mode"])
def test_a_restart_forgets_the_means(how: str) -> None:
    ekf = learned()
    assert means(ekf).any()
    if how == "pose set":
        lib.omni_pose_ekf_reset(ekf.s, ekf.config, [(0, 0, 0)], 0.01, 0.01)
    else:
        ekf.config.mode = POSE
        ekf.predict([0.0] * 3)
    assert not means(ekf).any()
    assert ekf.s.mean_slip_distance_m[0] == 0.0


def test_the_parameter_is_a_time_constant() -> None:
    scenario = load_scenario("demo")
    for return_s, rate in ((0.0, 0.0), (10.0, 4e-4), (1e-4, 1.0)):
        values = scenario.with_parameters({"EKF_RETURN": return_s}).parameter_values()
        config = robot_config(values, scenario.robot.table, 0)
        assert config.pose_ekf.mean_reversion == pytest.approx(rate)


@pytest.mark.reference
@pytest.mark.parametrize(("wheels", "kind"), [(3, Ekf), (4, Ekf), (3, GyroEkf)])
@pytest.mark.parametrize("age_ticks", [0, 30, 200])
def test_a_late_fix_after_a_return_is_exact(wheels: int, kind: type[Ekf], age_ticks: int) -> None:
    """A float64 filter goes back to the time of the fix. What ratios returned since then counts as known.

    The gyro is there, but gives no turn: its own corrections in between are no part of the late fix's formula.
    """
    ticks = ALONE_TICKS + 400
    ekf = kind(wheels, SLIP, mean_reversion=0.02)
    if isinstance(ekf, GyroEkf):
        ekf.overrides_wheels = False
    ekf.predict([0.0] * wheels)
    for i in range(wheels):
        ekf.s.mean_slip[i], ekf.s.mean_slip_distance_m[i] = SLIPS[i % 3], 10.0
    ekf.config.p_slip = 0.25
    motion: list[tuple[Array, Array]] = []
    for turned in drive(wheels, ticks, 5):
        before = slips(ekf)
        ekf.predict(turned)
        # Four wheels' null direction is not measured here: nothing else changes the ratios.
        motion.append((turned, slips(ekf) - before))

    def carry(filter_: Any, part: Sequence[tuple[Array, Array]]) -> None:
        for turned, returned in part:
            filter_.predict(turned)
            filter_.x[3:] += returned

    assert np.abs(sum(returned for _, returned in motion)).max() > 0.02
    assert_late_fix_is_exact(ekf, motion, carry, age_ticks)
