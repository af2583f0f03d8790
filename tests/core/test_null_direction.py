# SPDX-License-Identifier: MIT
"""What the pose filter learns from the null direction of four wheels, with fixes and without."""

from __future__ import annotations

import math

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_pose_ekf import GEOMETRY, SLIP, Ekf, drive, float32

DIFFER = 1.0 + np.array([0.03, -0.02, 0.0, 0.04])
"""What the wheels turn by, over what rigid equal wheels would."""


def test_four_wheels_that_differ_add_up_to_the_plain_sum_without_fixes() -> None:
    """What wheels differ by is in the null direction, and lasts: it must not become slip ratios that move the pose."""
    slipping, plain = Ekf(4, SLIP, r_null=6.6e-11), Ekf(4, lib.OMNI_EKF_MODE_ODOMETRY)
    for turned in drive(4, 10_000, 19):
        for ekf in (slipping, plain):
            ekf.predict(float32(turned * DIFFER))
    assert list(slipping.s.error_state)[:4] == [0.0] * 4
    np.testing.assert_allclose(slipping.x[:3], plain.x[:3], atol=1e-6)


def test_four_wheels_stop_learning_from_their_null_direction_when_fixes_stop() -> None:
    ekf = Ekf(4, SLIP, r_null=6.6e-11)
    seen = []
    for tick, turned in enumerate(drive(4, 8_000, 19)):
        ekf.predict(float32(turned * DIFFER))
        if tick % 20 == 0 and 1000 < tick < 4000:
            ekf.correct(ekf.x[:3])
        seen.append(list(ekf.s.error_state)[:4])
    assert seen[990] == [0.0] * 4, "no fix yet"
    assert np.abs(seen[3990]).max() > 0.0
    assert seen[6100] == seen[-1], "the last fix was 2 s ago"


@pytest.mark.full
def test_four_wheels_see_slip_in_their_null_direction_and_counts_do_not_bias_it() -> None:
    count = 2 * math.pi / 10_000
    ekf = Ekf(4, SLIP, r_null=(0.03175 * count) ** 2 / 6)
    geometry = GEOMETRY[4]
    slip = np.array([0.06, 0.0, 0.0, 0.0])
    null = np.array([1.0, -1.0, 1.0, -1.0]) / 2
    angle = np.zeros(4)
    residual = []
    for tick, turned in enumerate(drive(4, 30_000, 19)):
        before = np.floor(angle / count)
        angle += turned / (1 - slip)
        moved = (np.floor(angle / count) - before) * count
        ekf.predict(moved)
        if tick % 500 == 0:
            ekf.correct(ekf.x[:3], sd=(100.0, 3.0))  # says nothing, but that fixes come
        residual.append(null @ (turned / (1 - slip) * (1 - ekf.x[3:])) * geometry.radius_m)
    unexplained = np.sqrt(np.mean(np.square(residual[-10_000:])))
    unaided = np.sqrt(np.mean(np.square(null @ (drive(4, 30_000, 19) / (1 - slip)).T * geometry.radius_m)))
    assert unexplained < 0.3 * unaided
    # What no null measurement can see, the ratio common to all wheels, must not creep.
    assert abs(ekf.x[3:].mean()) < 0.03
