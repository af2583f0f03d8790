# SPDX-License-Identifier: MIT
"""What a loop has summed up does not outlive the time in which it had the wheels."""

from __future__ import annotations

import math

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
    assert max(abs(bench.robot.wheel_speed.pid[i].integral) for i in range(3)) > 2.0
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


@pytest.mark.parametrize("mode", ["PID", "ISMC"])
@pytest.mark.parametrize("kind", ["DUTY", "VELOCITY_BODY"])
def test_a_position_integral_does_not_wait_for_the_next_pose(mode: str, kind: str) -> None:
    bench = Bench(CTL_MODE=float(getattr(lib, f"OMNI_CTL_MODE_{mode}")), SAFE_STALL_V=60.0)
    bench.arm()
    bench.turning = False  # the error stays, the integral grows
    for _ in range(20):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(STOOD_m, 0.0, 0.0))
        bench.tick(count=10)
    state = bench.robot.fl if mode == "PID" else bench.robot.ismc
    assert abs(state.integral[0]) > 1e-5
    bench.command(getattr(lib, f"OMNI_SETPOINT_{kind}"))
    bench.tick(count=5)
    pose = bench.outputs.pose
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(pose.x, pose.y, pose.theta))
    out = bench.tick()
    assert math.hypot(out.terms.integral[0], out.terms.integral[1]) == 0.0
