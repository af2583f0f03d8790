# SPDX-License-Identifier: MIT
"""The governed reference: its direction under limits, its acceleration, and what it takes over from another kind."""

from __future__ import annotations

import math

import pytest

from omniwheel._core import lib
from tests.core.test_robot import TICK_US, Bench


def turned(theta: float) -> Bench:
    """Return an armed robot that stands at a heading."""
    bench = Bench()
    bench.tick(count=2)
    bench.inputs.pose.theta = theta
    bench.tick(lib.OMNI_EVENT_SET_POSE)
    bench.arm()
    return bench


def test_a_pose_far_away_is_approached_with_the_acceleration_limit_fed_forward() -> None:
    bench = turned(0.0)
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(3.0, 0.0, 0.0))
    first = bench.tick().reference.rate.vx
    out = bench.tick()
    limit = bench.config.limits.acceleration_m_s2
    assert out.reference.acceleration.vx == pytest.approx(limit, rel=1e-3)
    assert (out.reference.rate.vx - first) / (TICK_US * 1e-6) == pytest.approx(limit, rel=1e-2)


@pytest.mark.parametrize("limits", [{}, {"LIM_A": 0.4}, {"LIM_A": 2.0, "LIM_V": 1.4, "LIM_WHEEL": 60.0}])
@pytest.mark.parametrize("goal", [(1.0, 0.0, 0.0), (0.4, -0.9, 2.0), (0.0, 0.0, 3.0)])
def test_a_pose_is_reached_with_the_acceleration_limit_and_never_passed(
    limits: dict[str, float], goal: tuple[float, float, float]
) -> None:
    bench = Bench("fast_three_wheel", **limits)
    bench.arm()
    limit = bench.config.limits.acceleration_m_s2
    way = math.hypot(goal[0], goal[1])
    passed, turned_past, largest = 0.0, 0.0, 0.0
    for _ in range(1200):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=goal)
        reference = bench.tick(count=10).reference
        along = reference.pose.x * goal[0] + reference.pose.y * goal[1]
        passed = max(passed, along / way - way if way else 0.0)
        turned_past = max(turned_past, reference.pose.theta - goal[2])
        largest = max(largest, math.hypot(reference.acceleration.vx, reference.acceleration.vy))
    assert passed < 5e-4
    assert turned_past < 2e-3
    assert largest <= limit * 1.001
    assert (reference.pose.x, reference.pose.y, reference.pose.theta) == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize("kind", ["POSE", "VELOCITY_BODY"])
def test_a_demand_beyond_the_limits_keeps_its_direction(kind: str) -> None:
    bench = turned(0.0)
    wanted = (30.0, 10.0, 3.0)
    if kind == "POSE":
        # Three times the way is the speed that is asked for; it is far beyond every limit.
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(15.0, 5.0, 1.5))
    else:
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=wanted)
    for _ in range(60):
        bench.inputs.setpoint.time_us = bench.time_us
        out = bench.tick(count=10)
    if kind == "POSE":
        left = (15.0 - out.reference.pose.x, 1.5 - out.reference.pose.theta)
        rate = out.reference.rate
        assert rate.wz / rate.vx == pytest.approx(left[1] / left[0], rel=0.05)
    else:
        rate = bench.robot.reference_generator.reference_rate
        assert rate.wz / rate.vx == pytest.approx(wanted[2] / wanted[0], rel=1e-4)
    assert rate.vy / rate.vx == pytest.approx(1.0 / 3.0, rel=0.02)


def test_a_pose_takes_over_the_speed_of_a_body_velocity_in_the_world() -> None:
    bench = turned(math.pi / 2)
    for _ in range(40):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.05, 0.0, 0.0))
        out = bench.tick(count=10)
    assert bench.robot.reference_generator.reference_rate.vx == pytest.approx(0.05, rel=1e-3)
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.0, 2.0, math.pi / 2))
    out = bench.tick()
    heading = out.pose.theta
    step = bench.config.limits.acceleration_m_s2 * TICK_US * 1e-6
    assert out.reference.rate.vx == pytest.approx(0.05 * math.cos(heading), abs=1.5 * step)
    assert out.reference.rate.vy == pytest.approx(0.05 * math.sin(heading), abs=1.5 * step)


def test_a_body_velocity_takes_over_the_speed_of_a_pose_in_the_body() -> None:
    bench = turned(math.pi / 2)
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.0, 2.0, math.pi / 2))
    out = bench.tick(count=30)
    speed = out.reference.rate.vy
    assert speed > 0.03
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(speed, 0.0, 0.0))
    bench.tick()
    step = bench.config.limits.acceleration_m_s2 * TICK_US * 1e-6
    assert bench.robot.reference_generator.reference_rate.vx == pytest.approx(speed, abs=1.5 * step)
    assert bench.robot.reference_generator.reference_rate.vy == pytest.approx(0.0, abs=1.5 * step)


def test_a_stop_of_the_trajectory_hides_no_other_event() -> None:
    bench = turned(0.0)
    assert bench.tick(lib.OMNI_EVENT_TRAJECTORY_STOP | lib.OMNI_EVENT_DISARM).state == lib.OMNI_STATE_DISARMED
    bench.follow(TRJ_TYPE=3.0, TRJ_PERIOD=30.0)
    assert bench.robot.reference_generator.trajectory != 0
    bench.tick(lib.OMNI_EVENT_TRAJECTORY_STOP)
    assert int(bench.robot.reference_generator.trajectory == bench.plan) == 0
