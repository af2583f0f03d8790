# SPDX-License-Identifier: MIT
"""LIM_POS holds for the robot's pose, whatever drives it: beyond it the robot stops and cannot be armed."""

from __future__ import annotations

from typing import Any

import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench

LIMIT_M = 0.1


def driven(bench: Bench, velocity: tuple[float, float, float]) -> Any:
    """Arm, and drive by a velocity in the world frame until the robot stops itself; return the tick that did."""
    bench.arm()
    for _ in range(4000):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_WORLD, twist=velocity)
        out = bench.tick()
        if out.state != lib.OMNI_STATE_ARMED:
            return out
    raise AssertionError("it drove on")


def placed(bench: Bench, x_m: float, y_m: float) -> Any:
    bench.inputs.pose.x, bench.inputs.pose.y = x_m, y_m
    return bench.tick(lib.OMNI_EVENT_SET_POSE)


@pytest.mark.parametrize("velocity", [(0.1, 0.0, 0.0), (-0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, -0.1, 0.0)])
def test_a_pose_beyond_the_limit_stops_in_its_tick(velocity: tuple[float, float, float]) -> None:
    out = driven(Bench(LIM_POS=LIMIT_M), velocity)
    assert out.state == lib.OMNI_STATE_FAILSAFE
    assert out.fault_history == lib.OMNI_FAULT_POSITION
    assert LIMIT_M < max(abs(out.pose.x), abs(out.pose.y)) < LIMIT_M + 2e-4, "0.1 m/s are 0.1 mm a tick"
    assert not out.drive
    assert list(out.duty) == [0.0] * len(list(out.duty))


def test_it_is_armed_again_only_within_the_limit() -> None:
    bench = Bench(LIM_POS=LIMIT_M)
    driven(bench, (0.1, 0.0, 0.0))
    bench.command(lib.OMNI_SETPOINT_NONE)
    assert bench.tick(lib.OMNI_EVENT_DISARM).state == lib.OMNI_STATE_DISARMED
    assert bench.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_DISARMED
    bench.tick(count=300)  # its wheels come to rest
    placed(bench, 0.9 * LIMIT_M, 0.0)
    assert bench.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_ARMED


@pytest.mark.parametrize(("place", "beyond"), [(1.0, False), (1.001, True)])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_limit_itself_is_within(place: float, beyond: bool, axis: int, sign: float) -> None:
    bench = Bench(LIM_POS=1.0)
    bench.tick()
    placed(bench, *((sign * place, 0.0) if axis == 0 else (0.0, sign * place)))
    assert bool(bench.tick().faults & lib.OMNI_FAULT_POSITION) is beyond


def test_the_limit_holds_for_open_loop_duties() -> None:
    bench = Bench(LIM_POS=LIMIT_M)
    bench.arm()
    for _ in range(4000):
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.0, 0.5, -0.5, 0.0))
        out = bench.tick()
    assert out.state == lib.OMNI_STATE_FAILSAFE
    assert out.fault_history & lib.OMNI_FAULT_POSITION
