# SPDX-License-Identifier: MIT
"""What a loop has summed up does not outlive the time in which it had the wheels."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench

STOOD_m = 0.02


def controlled(bench: Bench, mode: str) -> None:
    bench.config = bench.configure(CTL_MODE=float(getattr(lib, f"OMNI_CTL_MODE_{mode}")))
    lib.omni_robot_set_config(bench.robot, bench.config)


@pytest.mark.parametrize("between", ["duty", "TORQUE", "ORIGINAL"])
def test_wheel_loops_start_afresh_after_something_else_drove_the_wheels(between: str) -> None:
    # Without feed-forward the integral alone holds the speed: some volts.
    bench = Bench(WS_FF=0.0)
    bench.arm()
    for _ in range(100):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.4))
        bench.tick(count=10)
    assert max(abs(bench.robot.control.wheel_speed.pid[i].integral) for i in range(3)) > 2.0
    if between != "duty":
        controlled(bench, between)
    for _ in range(100):
        if between == "duty":
            bench.command(lib.OMNI_SETPOINT_DUTY)
        else:
            bench.command(lib.OMNI_SETPOINT_NONE)
        bench.tick(count=10)
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.0))
    out = bench.tick()
    assert out.state == lib.OMNI_STATE_ARMED
    proportional = bench.config.wheel_speed.pid.kp
    for i in range(3):
        assert out.voltage_V[i] == pytest.approx(-proportional * out.wheel_rad_s[i], abs=0.5)


def wanted_speed(bench: Bench) -> float:
    rate = bench.outputs.reference.rate
    return math.hypot(rate.vx, rate.vy)


def fastest_change(bench: Bench, ticks: int, kind: int, **what: Any) -> float:
    """Return the largest step of the wanted speed over some ticks of a set-point [m/s]."""
    speeds = [wanted_speed(bench)]
    for _ in range(ticks):
        bench.command(kind, **what)
        bench.tick()
        speeds.append(wanted_speed(bench))
    return max(abs(b - a) for a, b in itertools.pairwise(speeds))


def limit_of(bench: Bench) -> float:
    return float(bench.config.limits.acceleration_m_s2) * 1e-3 * 1.01


@pytest.mark.parametrize("frame", ["BODY", "WORLD"])
def test_a_velocity_after_a_trajectory_starts_at_the_trajectorys_speed(frame: str) -> None:
    bench = Bench()
    bench.arm()
    bench.follow(TRJ_TYPE=3, TRJ_SIZE=0.5, TRJ_PERIOD=30.0, TRJ_RAMP=0.5, TRJ_ROT=1, TRJ_ROT_AMP=6.0)
    bench.tick(count=5000)
    assert wanted_speed(bench) > 0.05
    step = fastest_change(bench, 300, getattr(lib, f"OMNI_SETPOINT_VELOCITY_{frame}"), twist=(0.0, 0.0, 0.0))
    assert 0.0 < step <= limit_of(bench)
    assert wanted_speed(bench) == pytest.approx(0.0, abs=1e-6)


def test_a_pose_after_a_velocity_starts_at_that_speed() -> None:
    bench = Bench()
    bench.arm()
    fastest_change(bench, 500, lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, 0.05, 0.3))
    assert wanted_speed(bench) == pytest.approx(math.hypot(0.1, 0.05), rel=1e-4)
    pose = bench.outputs.pose
    step = fastest_change(bench, 300, lib.OMNI_SETPOINT_POSE, pose=(pose.x, pose.y, pose.theta))
    assert step <= limit_of(bench)


def test_a_velocity_after_duties_starts_at_the_measured_speed() -> None:
    bench = Bench()
    bench.arm()
    for _ in range(500):
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.0, 0.3, -0.3, 0.0))
        bench.tick()
    rate = bench.outputs.rate
    moving = math.hypot(rate.vx, rate.vy)
    assert moving > 0.02
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.0))
    bench.tick()
    assert wanted_speed(bench) == pytest.approx(moving, abs=5e-3)


@pytest.mark.parametrize("mode", ["PID", "ISMC"])
@pytest.mark.parametrize("kind", ["DUTY", "VELOCITY_BODY"])
def test_a_position_integral_does_not_wait_for_the_next_pose(mode: str, kind: str) -> None:
    bench = Bench(CTL_MODE=float(getattr(lib, f"OMNI_CTL_MODE_{mode}")), SAFE_STALL_V=60.0)
    bench.arm()
    bench.turning = False  # the error stays, the integral grows
    for _ in range(20):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(STOOD_m, 0.0, 0.0))
        bench.tick(count=10)
    state = bench.robot.control.fl if mode == "PID" else bench.robot.control.ismc
    assert abs(state.integral[0]) > 1e-5
    bench.command(getattr(lib, f"OMNI_SETPOINT_{kind}"))
    bench.tick(count=5)
    pose = bench.outputs.pose
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(pose.x, pose.y, pose.theta))
    out = bench.tick()
    assert math.hypot(out.terms.integral[0], out.terms.integral[1]) == 0.0
