# SPDX-License-Identifier: MIT
"""Which numbers a path may have, to the last float; and paths with hardly any or no laps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from omniwheel._core import lib
from tests.core.test_trajectory import Plan

RANGES = {
    "size_m": (0.0, 1e4),
    "period_s": (1e-3, 3600.0),
    "laps": (0.0, 1e4),
    "rotation_cycles": (0.0, 1e3),
    "rotation_amplitude_rad": (-1e3, 1e3),
    "ramp_s": (0.0, 3600.0),
    "margin": (1e-3, 1.0),
}
STILL = {"type": "hold", "rotation": "fixed"}


@pytest.mark.parametrize("name", RANGES)
def test_both_ends_of_a_range_belong_to_it_and_nothing_beyond(name: str) -> None:
    """A robot that stands still can do that with any numbers, so the numbers alone decide."""
    for end, beyond in zip(RANGES[name], (-math.inf, math.inf), strict=True):
        assert Plan({**STILL, name: end}).result == lib.OMNI_OK
        if name != "margin" or beyond > 0.0:
            outside = float(np.nextafter(np.float32(end), np.float32(beyond)))
            assert Plan({**STILL, name: outside}).result == lib.OMNI_ERR_RANGE


@pytest.mark.parametrize(
    "bad",
    [{"margin": -0.5}, {"margin": 0.0}, {"voltage_limit_V": -1.0}, {"wheel_limit_rad_s": -1.0}, {"ff_speed_V_s": -0.1}],
    ids=str,
)
def test_a_limit_that_is_none_is_refused_even_at_rest(bad: dict[str, Any]) -> None:
    assert Plan({**STILL, **bad}).result == lib.OMNI_ERR_RANGE


def test_a_line_begins_at_its_start_and_comes_back() -> None:
    plan = Plan({"type": "line", "rotation": "fixed", "size_m": 0.4, "period_s": 10.0, "laps": 2.0})
    places = [plan.path(u)[0][0] for u in (0.0, 5.0, 10.0, 15.0, 20.0)]
    np.testing.assert_allclose(places, [0.0, 0.2, 0.4, 0.2, 0.0], atol=1e-6)


def test_identify_without_laps_drives_one_each_way() -> None:
    plan = Plan({"type": "identify", "laps": 0.0, "period_s": 20.0, "rotation_amplitude_rad": 3.0})
    once = Plan({"type": "identify", "laps": 1.0, "period_s": 20.0, "rotation_amplitude_rad": 3.0})
    for u in (3.0, 10.0, 31.0, 50.0, 75.0):
        np.testing.assert_allclose(plan.path(u)[0], once.path(u)[0], atol=1e-6)
    assert plan.path(10.0)[0][0] == pytest.approx(-0.5, abs=1e-3), "half a lap of the circle"
    assert plan.path(60.0)[0][2] == pytest.approx(3.0, abs=1e-3), "a whole spin"


def test_so_small_a_share_of_a_lap_that_no_time_is_left_moves_nothing() -> None:
    plan = Plan({"type": "identify", "laps": 1e-10, "period_s": 1.0, "rotation_amplitude_rad": 3.0})
    assert plan.result == lib.OMNI_OK
    for u in (0.0, 1e-9, 2e-9, 3e-9, 1.0):
        np.testing.assert_allclose(plan.path(u)[0], [0.5, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("far", [1e38, 3e38])
def test_points_too_far_apart_for_a_float_are_refused(far: float) -> None:
    """Their distance is no number, and neither is what it asks of the wheels."""
    for waypoints in ([(far, 0.0, 0.0), (-far, 0.0, 0.0)], [(0.0, far, 0.0), (0.0, -far, 0.0), (1.0, 0.0, 0.0)]):
        plan = Plan({"type": "waypoints"}, waypoints=waypoints)
        assert plan.result == lib.OMNI_ERR_RANGE
        assert plan.at_us(1_000_000).pose.x == 0.0
