# SPDX-License-Identifier: MIT
"""Streamed setpoints that end: at rest they hold, in motion they are lost."""

from __future__ import annotations

import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench


@pytest.mark.parametrize("kind", ["OMNI_SETPOINT_VELOCITY_BODY", "OMNI_SETPOINT_VELOCITY_WORLD"])
def test_a_velocity_stream_that_ends_at_rest_holds_the_pose(kind: str) -> None:
    bench = Bench(SAFE_CMD_TO=0.3, LIM_A=0.05)
    bench.arm()
    bench.command(getattr(lib, kind), twist=(0.05, 0.02, 0.1))
    bench.tick(count=250)
    bench.command(getattr(lib, kind), twist=(0.05, 0.02, 0.1))
    asked = bench.tick(count=250).reference.rate.vx
    bench.command(getattr(lib, kind), twist=(0, 0, 0))
    braking = bench.tick(count=310)
    assert braking.state == lib.OMNI_STATE_ARMED
    assert 0 < braking.reference.rate.vx < asked, "it brakes within LIM_A"
    rest = bench.tick(count=1000)
    assert rest.setpoint_kind == lib.OMNI_SETPOINT_NONE
    held = rest.reference.pose.x, rest.reference.pose.y, rest.reference.pose.theta
    out = bench.tick(count=5000)
    assert out.state == lib.OMNI_STATE_ARMED
    assert out.fault_history & lib.OMNI_FAULT_COMMAND_LOSS == 0
    assert (out.reference.pose.x, out.reference.pose.y, out.reference.pose.theta) == held
    bench.command(getattr(lib, kind), twist=(0.05, 0, 0))
    assert bench.tick(count=200).setpoint_kind == getattr(lib, kind)


def test_a_pose_stream_that_ends_at_its_pose_holds_it() -> None:
    goal = (0.05, -0.02, 0.3)
    bench = Bench(SAFE_CMD_TO=0.3)
    bench.arm()
    for _ in range(300):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=goal)
        bench.tick(count=10)
    out = bench.tick(count=5000)
    assert out.state == lib.OMNI_STATE_ARMED
    assert out.fault_history & lib.OMNI_FAULT_COMMAND_LOSS == 0
    assert (out.reference.pose.x, out.reference.pose.y, out.reference.pose.theta) == pytest.approx(goal, abs=1e-4)
    assert out.setpoint_kind == lib.OMNI_SETPOINT_NONE


@pytest.mark.parametrize("twist", [(0.0, 0.0, 0.0), (0.02, 0.0, 0.0)])
def test_a_pose_stream_that_ends_on_the_way_is_lost(twist: tuple[float, float, float]) -> None:
    bench = Bench(SAFE_CMD_TO=0.3)
    bench.arm()
    moving = any(twist)
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.0 if moving else 0.5, 0, 0), twist=twist)
    assert bench.tick(count=301).state == lib.OMNI_STATE_FAILSAFE


def test_duties_that_end_at_zero_are_not_lost() -> None:
    bench = Bench(SAFE_CMD_TO=0.3)
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.1, 0, 0, 0))
    bench.tick(count=100)
    bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0, 0, 0, 0))
    out = bench.tick(count=2000)
    assert out.state == lib.OMNI_STATE_ARMED
    assert list(out.duty) == [0, 0, 0, 0]


def test_duties_that_turn_a_wheel_can_be_lost() -> None:
    bench = Bench(SAFE_CMD_TO=0.3)
    bench.arm()
    bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0, 0, 0.01, 0))
    assert bench.tick(count=301).state == lib.OMNI_STATE_FAILSAFE
