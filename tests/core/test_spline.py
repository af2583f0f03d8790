# SPDX-License-Identifier: MIT
"""The smooth path through points, beside SciPy's cubic splines."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from omniwheel._core import lib
from tests.core.test_trajectory import WAYPOINTS, Plan

Points = list[tuple[float, float, float]]
PERIOD_S = 10.0


def random_points(seed: int, count: int) -> Points:
    """Return points in a square of side 2 m with headings of up to half a turn from one to the next."""
    generator = np.random.default_rng(seed)
    return [(float(x), float(y), float(3 * h)) for x, y, h in generator.uniform(-1.0, 1.0, (count, 3))]


def reference(points: Points, *, closed: bool) -> CubicSpline:
    """Return SciPy's spline through the points: natural ends, or periodic up to whole turns of the heading."""
    values = np.array(points)
    values[:, 2] = np.unwrap(values[:, 2])
    if not closed:
        return CubicSpline(np.linspace(0.0, PERIOD_S, len(values)), values, bc_type="natural")
    turn = np.unwrap([*values[:, 2], values[0, 2]])[-1] - values[0, 2]
    drift = np.zeros((len(values) + 1, 3))
    drift[:, 2] = turn * np.linspace(0.0, 1.0, len(values) + 1)
    periodic = np.vstack([values, values[0]]) - drift
    periodic[-1] = periodic[0]
    times = np.linspace(0.0, PERIOD_S, len(values) + 1)
    spline = CubicSpline(times, periodic, bc_type="periodic")
    spline.c[3] += drift[:-1]
    spline.c[2] += np.array([0.0, 0.0, turn / PERIOD_S])
    return spline


def spline(points: Points, laps: float, **options: Any) -> Plan:
    return Plan({"type": "spline", "period_s": PERIOD_S, "laps": laps, **options}, waypoints=points)


def sampled(plan: Plan, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return pose, first and second derivative (n x 3 x 3)."""
    return np.array([plan.path(float(u)) for u in times])


@pytest.mark.parametrize("laps", [1.0, 3.0, 0.0])
@pytest.mark.parametrize("count", [2, 3, 5, 17, 32])
def test_it_is_the_cubic_spline(count: int, laps: float) -> None:
    points = random_points(count, count)
    plan = spline(points, laps)
    assert plan.result == lib.OMNI_OK
    wanted = reference(points, closed=laps != 1.0)
    times = np.linspace(0.0, PERIOD_S, 401)[:-1].astype(np.float32).astype(float)
    found = sampled(plan, times)
    whole_turns = 2 * math.pi * round((found[0, 0, 2] - wanted(0.0)[2]) / (2 * math.pi))
    found[:, 0, 2] -= whole_turns
    legs_per_s = count / PERIOD_S
    for order in range(3):
        expected = wanted(times, order)
        # Float32 tells apart 1e-7 of a share of a leg, and the third derivative steps at the points.
        tolerance = 3e-5 * max(1.0, np.abs(wanted(times, min(order + 1, 3))).max() / legs_per_s)
        assert np.abs(found[:, order] - expected).max() < tolerance, order


def test_an_open_path_begins_and_ends_at_its_points() -> None:
    plan = spline(WAYPOINTS, 1.0)
    assert plan.c.duration_s == pytest.approx(PERIOD_S)
    for share, (x, y, theta) in zip(np.linspace(0.0, 1.0, len(WAYPOINTS)), WAYPOINTS, strict=True):
        pose = plan.path(float(share * PERIOD_S))[0]
        assert pose[:2] == pytest.approx([x, y], abs=2e-6)
        assert math.remainder(pose[2] - theta, 2 * math.pi) == pytest.approx(0.0, abs=5e-6)
    assert np.abs(plan.path(PERIOD_S)[2]).max() < 1e-4, "no curvature at the end"
    end = plan.at_us(plan.end_us() + 1_000_000)
    assert (end.pose.x, end.pose.y) == pytest.approx(WAYPOINTS[-1][:2], abs=2e-6)
    assert (end.rate.vx, end.rate.vy, end.rate.wz) == (0.0, 0.0, 0.0)


def test_laps_of_a_closed_path_join_without_a_step() -> None:
    turning = [(math.cos(a), math.sin(a), a) for a in np.linspace(0.0, 2 * math.pi, 8, endpoint=False)]
    plan = spline(turning, 2.0)
    assert plan.c.lap_turn_rad == pytest.approx(2 * math.pi, abs=1e-5)
    before, after = (plan.path(float(np.float32(PERIOD_S + d))) for d in (-1e-4, 1e-4))
    assert after[0][:2] == pytest.approx(before[0][:2], abs=3e-4)
    assert math.remainder(after[0][2] - before[0][2], 2 * math.pi) == pytest.approx(0.0, abs=3e-4)
    for order in (1, 2):
        assert after[order] == pytest.approx(before[order], abs=2e-3)
    assert plan.c.duration_s == pytest.approx(2 * PERIOD_S)
    assert plan.path(2 * PERIOD_S)[0][:2] == pytest.approx(turning[0][:2], abs=1e-5)


def test_it_does_not_stop_at_its_points() -> None:
    along = [(0.1 * i, 0.0, 0.0) for i in range(11)]
    speeds = sampled(spline(along, 1.0), np.linspace(0.0, PERIOD_S, 101))[:, 1, 0]
    assert speeds == pytest.approx(1.0 / PERIOD_S, rel=1e-4)


@pytest.mark.full
def test_it_is_slowed_down_to_what_the_wheels_can_do() -> None:
    fast = spline(WAYPOINTS, 1.0, period_s=0.5, scale=True)
    assert fast.c.scale > 1.0
    times = np.arange(0, fast.end_us(), 2000)
    _, rates, _, _ = fast.sample(times)
    slow = spline(WAYPOINTS, 1.0, period_s=0.5 * fast.c.scale, scale=True)
    assert slow.c.needed_scale == pytest.approx(1.0, abs=0.06)
    assert np.isfinite(rates).all()


@pytest.mark.parametrize(
    ("points", "result"),
    [
        ([(0.0, 0.0, 0.0)], lib.OMNI_ERR_RANGE),
        ([(0.0, 0.0, 0.0)] * 33, lib.OMNI_ERR_RANGE),
        ([(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0)], lib.OMNI_ERR_NOT_FINITE),
    ],
)
def test_bad_points_hold_the_pose(points: Points, result: int) -> None:
    plan = spline(points, 1.0)
    assert plan.result == result
    assert plan.c.config.type == lib.OMNI_TRJ_TYPE_HOLD


def test_points_on_one_spot_hold_it() -> None:
    plan = spline([(0.3, -0.2, 1.0)] * 5, 0.0)
    assert plan.result == lib.OMNI_OK
    pose, first, second = plan.path(3.3)
    assert pose == pytest.approx([0.3, -0.2, 1.0], abs=1e-6)
    assert np.abs([first, second]).max() < 1e-6
