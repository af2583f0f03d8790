# SPDX-License-Identifier: MIT
"""The heading after very many turns either way, and after more than a turn in one tick."""

from __future__ import annotations

import math

import pytest

from omniwheel._core import lib
from tests.core.test_pose_ekf import GEOMETRY, Ekf, float32, reference

PI_F = float(float32(math.pi))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_hundreds_of_turns_cost_no_precision(sign: float) -> None:
    """The part of a turn that a float does not hold is kept: 500 of them would be 90 microradians."""
    ekf = Ekf(mode=lib.OMNI_EKF_MODE_ODOMETRY)
    geometry = GEOMETRY[3]
    turned = float32([sign * 0.02 * geometry.distance_m / geometry.radius_m] * 3)  # about 0.02 rad of heading
    exact = float((geometry.inverse @ (geometry.radius_m * turned))[2])
    ekf.predict(turned)
    per_tick = float(ekf.s.pose.theta)
    assert per_tick == pytest.approx(exact, abs=4e-9)
    ekf.predict(turned, count=157_079)
    assert abs(reference.wrap(ekf.s.pose.theta - 157_080 * per_tick)) < 2e-5
    assert -PI_F <= ekf.s.pose.theta < PI_F


@pytest.mark.parametrize("turns", [-2.6, -1.6, 1.6, 2.6])
def test_more_than_a_turn_in_a_tick_still_ends_in_range(turns: float) -> None:
    ekf = Ekf(mode=lib.OMNI_EKF_MODE_ODOMETRY)
    geometry = GEOMETRY[3]
    ekf.predict(float32([turns * math.tau * geometry.distance_m / geometry.radius_m] * 3))
    assert -PI_F <= ekf.s.pose.theta < PI_F
    assert abs(reference.wrap(ekf.s.pose.theta - turns * math.tau)) < 1e-5
