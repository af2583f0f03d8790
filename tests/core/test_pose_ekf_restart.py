# SPDX-License-Identifier: MIT
"""Late fixes over a restart and over a change of mode, and the edges of what a fix may be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_pose_ekf import GEOMETRY, POSE, SLIP, TICK_US, Array, Ekf, float32

RADIUS_m = 0.0508


def rolled(wheels_rad: Array, ticks: int) -> Array:
    """Return the straight way of wheels that slip nowhere, in the body's frame."""
    geometry = GEOMETRY[3]
    return np.asarray(geometry.inverse @ (geometry.radius_m * float32(wheels_rad)) * ticks)


@pytest.mark.parametrize("ticks_late", [0, 2, 5, 40])
def test_a_restart_trusts_the_wheels_again_from_the_fix_on(ticks_late: int) -> None:
    ekf = Ekf(3, SLIP, gate=25.0, gate_restart=1)
    straight = GEOMETRY[3].matrix @ [0.5, 0.2, 0.0] / RADIUS_m * 1e-3
    ekf.predict(straight, 399)
    for wheel, slip in enumerate((0.3, -0.2, 0.1)):
        ekf.s.error_state[wheel] = slip
    ekf.predict(straight, 51)
    fix = np.array([3.0, -2.0, 0.0])
    assert ekf.correct(fix, ticks_late * TICK_US) == lib.OMNI_OK
    assert ekf.s.restarts == 1
    np.testing.assert_array_equal(ekf.x[3:], 0.0)
    np.testing.assert_allclose(ekf.x[:3], fix + rolled(straight, ticks_late), atol=2e-5)


@pytest.mark.parametrize("ticks_after", [1, 2, 3])
def test_the_past_stays_what_it_was_when_the_mode_changes(ticks_after: int) -> None:
    """A fix that says where the filter thought it was then has no innovation."""
    ekf = Ekf(3, SLIP)
    turned = [0.02, -0.01, 0.03]
    ekf.predict(turned, 400)
    for wheel in range(3):
        ekf.s.error_state[wheel] = 0.4
    ekf.predict(turned, 8)
    then = ekf.x[:3]
    ekf.predict(turned, 2)
    ekf.config.mode = POSE
    ekf.predict(turned, ticks_after)
    assert ekf.correct(then, (2 + ticks_after) * TICK_US) == lib.OMNI_OK
    assert np.abs([ekf.s.innovation[axis] for axis in range(3)]).max() < 1e-5


def test_a_fix_on_the_gate_passes_and_one_beyond_does_not() -> None:
    def corrected(gate: float) -> tuple[int, float]:
        ekf = Ekf(gate=gate)
        ekf.predict([0.0] * 3, 10)
        return ekf.correct((0.02, 0.01, 0.0)), ekf.s.nis

    nis = corrected(0.0)[1]
    assert nis > 1.0
    assert corrected(nis) == (lib.OMNI_OK, nis)
    assert corrected(float(np.nextafter(np.float32(nis), np.float32(0.0)))) == (lib.OMNI_ERR_RANGE, nis)


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_any_number_of_a_fix_that_is_none_refuses_it(place: int, bad: float) -> None:
    ekf = Ekf()
    ekf.predict([0.001] * 3, 10)
    before = ekf.snapshot()
    numbers = [0.0, 0.0, 0.0, 0.01, 0.01]
    numbers[place] = bad
    assert ekf.correct(numbers[:3], sd=numbers[3:]) == lib.OMNI_ERR_NOT_FINITE
    assert ekf.snapshot() == before
