# SPDX-License-Identifier: MIT
"""Pose fixes of a tracked body that is not at the wheels' centre (FIX_X, FIX_Y, FIX_TH)."""

from __future__ import annotations

import math

import pytest

from omniwheel._core import lib
from tests.core.test_robot import TICK_US, Bench

FIX_EVERY = 20
PLACES = [(0.12, -0.05, 0.0), (-0.03, 0.2, 0.7), (0.0, 0.0, -1.5)]


def tracked(pose: tuple[float, float, float], place: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the pose of the tracked body, by plain trigonometry."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    return x + c * place[0] - s * place[1], y + s * place[0] + c * place[1], theta + place[2]


def drive(bench: Bench, place: tuple[float, float, float], seconds: float) -> tuple[float, float]:
    """Turn on the spot at (1, 2) with fixes of the tracked body; return the largest late errors [m], [rad]."""
    bench.arm()
    largest = 0.0, 0.0
    for tick in range(round(seconds * 1e6 / TICK_US)):
        if tick % 100 == 0:
            bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.5))
        # All wheels turn alike and without slip, so their angle is the robot's heading.
        theta = sum(bench.angle[:3]) / 3 * 0.0508 / 0.2632
        x, y, heading = tracked((1.0, 2.0, theta), place)
        bench.inputs.has_fix = tick % FIX_EVERY == 0
        fix = bench.inputs.fix
        fix.time_us = bench.time_us + TICK_US
        fix.pose.x, fix.pose.y, fix.pose.theta = x, y, heading
        fix.sd_xy = fix.sd_theta = 0.005
        out = bench.tick()
        if tick * TICK_US > 0.5 * seconds * 1e6:
            apart = math.hypot(out.pose.x - 1.0, out.pose.y - 2.0)
            turned = abs(math.remainder(out.pose.theta - theta, math.tau))
            largest = max(largest[0], apart), max(largest[1], turned)
    return largest


@pytest.mark.parametrize("place", PLACES)
def test_the_estimate_is_of_the_wheels_centre(place: tuple[float, float, float]) -> None:
    bench = Bench(FIX_X=place[0], FIX_Y=place[1], FIX_TH=place[2])
    metres, radians = drive(bench, place, 8.0)
    assert metres < 0.002
    assert radians < 0.005


def test_a_tracked_point_that_is_not_told_moves_the_estimate() -> None:
    assert drive(Bench(), PLACES[0], 8.0)[0] > 0.05
