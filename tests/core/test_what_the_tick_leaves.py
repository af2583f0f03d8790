# SPDX-License-Identifier: MIT
"""What one tick leaves for the next and for whoever reads its outputs, in the moments at which set-points change."""

from __future__ import annotations

import math
from typing import Any

import pytest

from omniwheel._core import ffi, lib
from tests.core.test_robot import TICK_US, Bench

TICK_S = TICK_US * 1e-6
NAN = float("nan")


def pose_of(pose: Any) -> tuple[float, float, float]:
    return pose.x, pose.y, pose.theta


def at(bench: Bench, x: float, y: float, theta: float) -> None:
    bench.inputs.pose.x, bench.inputs.pose.y, bench.inputs.pose.theta = x, y, theta
    bench.tick(lib.OMNI_EVENT_SET_POSE)


def hold(bench: Bench, kind: int, ticks: int, **parts: Any) -> Any:
    for _ in range(ticks):
        bench.command(kind, **parts)
        bench.tick()
    return bench.outputs


def test_after_open_loop_duties_the_reference_begins_where_the_robot_has_got_to() -> None:
    bench = Bench()
    bench.arm()
    hold(bench, lib.OMNI_SETPOINT_DUTY, 400, duty=(0.3, 0.3, 0.3, 0.0))
    turned = pose_of(bench.outputs.pose)
    assert abs(turned[2]) > 0.05
    out = hold(bench, lib.OMNI_SETPOINT_POSE, 1, pose=turned)
    assert pose_of(out.reference.pose) == pytest.approx(turned, abs=0.02)


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
@pytest.mark.parametrize("turned", [0.0, 180.0])
def test_the_turn_rate_rises_as_fast_as_the_rim_may(robot_name: str, turned: float) -> None:
    bench = Bench(robot_name)
    angles = {f"W{n}_ANGLE": bench.values[lib.OMNI_PARAM_W1_ANGLE + n - 1] - turned for n in range(1, bench.wheels + 1)}
    bench = Bench(robot_name, LIM_A=0.2, **angles)
    bench.arm()
    out = hold(bench, lib.OMNI_SETPOINT_VELOCITY_BODY, 20, twist=(0, 0, 1.0))
    distance = bench.values[lib.OMNI_PARAM_WHEEL_DIST]
    assert out.reference.rate.wz == pytest.approx(0.2 / distance * 20 * TICK_S, rel=1e-3)
    assert out.reference.acceleration.wz == pytest.approx(0.2 / distance, rel=1e-3)


def test_from_a_velocity_of_the_body_to_one_of_the_world_nothing_jumps() -> None:
    bench = Bench(LIM_A=0.2)
    at(bench, 0, 0, math.pi / 2)
    bench.arm()
    before = hold(bench, lib.OMNI_SETPOINT_VELOCITY_BODY, 600, twist=(0.1, 0, 0)).reference.rate
    before = (before.vx, before.vy)
    assert before == pytest.approx((0, 0.1), abs=0.01)
    after = hold(bench, lib.OMNI_SETPOINT_VELOCITY_WORLD, 1, twist=(0, 0.1, 0)).reference.rate
    assert (after.vx, after.vy) == pytest.approx(before, abs=0.005)


def test_a_path_time_is_that_of_a_path_only() -> None:
    bench = Bench(TRJ_TYPE=3.0, TRJ_PERIOD=30.0, TRJ_ROT=0.0)
    bench.arm()
    bench.follow()
    while bench.tick().reference.phase != lib.OMNI_PHASE_PATH:
        assert bench.time_us < 20e6
    assert bench.tick(count=200).reference.path_time_s > 0.0
    assert hold(bench, lib.OMNI_SETPOINT_VELOCITY_BODY, 3, twist=(0.01, 0, 0)).reference.path_time_s == 0.0
    assert hold(bench, lib.OMNI_SETPOINT_NONE, 3).reference.path_time_s == 0.0
    assert hold(bench, lib.OMNI_SETPOINT_POSE, 3, pose=pose_of(bench.outputs.pose)).reference.path_time_s == 0.0


def test_wheels_that_saturate_are_warned_of_and_a_robot_at_rest_scales_nothing() -> None:
    bench = Bench(LIM_A=100.0, LIM_WHEEL=1.0)
    out = bench.tick()
    assert (out.wheel_scale, out.duty_scale) == (1.0, 1.0)
    assert not out.faults & lib.OMNI_WARN_SATURATED
    bench.arm()
    out = hold(bench, lib.OMNI_SETPOINT_VELOCITY_BODY, 10, twist=(1.0, 0, 0))
    assert out.wheel_scale < 1.0
    assert out.faults & lib.OMNI_WARN_SATURATED


@pytest.mark.parametrize("wrong", [NAN, 1e6])
def test_a_set_point_that_is_refused_is_none(wrong: float) -> None:
    bench = Bench()
    bench.arm()
    hold(bench, lib.OMNI_SETPOINT_POSE, 5, pose=(0.01, 0, 0))
    bench.command(lib.OMNI_SETPOINT_POSE, pose=(wrong, 0, 0))
    assert bench.tick().setpoint_kind == lib.OMNI_SETPOINT_NONE


def test_slip_is_fed_forward_only_while_fixes_come() -> None:
    bench = Bench(EKF_MODE=float(lib.OMNI_EKF_MODE_SLIP), ISMC_SLIP=1.0, LIM_A=100.0)
    bench.arm()
    for wheel in range(bench.wheels):
        bench.robot.estimator.pose_ekf.error_state[wheel] = 0.2
    out = hold(bench, lib.OMNI_SETPOINT_VELOCITY_BODY, 3, twist=(0, 0, 0.2))
    plain = 0.2 * bench.values[lib.OMNI_PARAM_WHEEL_DIST] / bench.values[lib.OMNI_PARAM_WHEEL_RADIUS]
    assert [out.wheel_reference[i] for i in range(3)] == pytest.approx([plain] * 3, rel=1e-4)


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
def test_every_wheels_current_is_told(robot_name: str) -> None:
    bench = Bench(robot_name)
    bench.arm()
    out = hold(bench, lib.OMNI_SETPOINT_VELOCITY_BODY, 100, twist=(0.05, 0.02, 0.2))
    told = [out.current_A[i] for i in range(4)]
    filtered = [bench.robot.estimator.motor_kf[i].x[2] for i in range(bench.wheels)]
    assert told == filtered + [0.0] * (4 - bench.wheels)
    assert all(abs(current) > 1e-4 for current in filtered)


def test_the_rounding_of_counts_is_that_of_the_first_wheel() -> None:
    bench = Bench()
    plain = bench.configure(W2_RSCALE=1.0).pose_ekf.r_null
    other = bench.configure(W2_RSCALE=1.05).pose_ekf.r_null
    assert other == plain


def planned(config: Any, bench: Bench, pose: tuple[float, float, float]) -> tuple[int, Any]:
    plan = ffi.new("omni_trajectory_t *")
    origin = ffi.new("omni_pose_t *", pose)
    kinematics = ffi.addressof(bench.config, "kinematics")
    return lib.omni_trajectory_plan(plan, config, kinematics, ffi.NULL, origin), plan


def test_a_path_that_begins_here_with_another_heading_has_a_way_there() -> None:
    bench = Bench(TRJ_TYPE=3.0, TRJ_ROT=0.0)
    config = ffi.addressof(bench.config, "trajectory")
    _, far = planned(config, bench, (0, 0, 0))
    start = pose_of(far.start)
    _, here = planned(config, bench, start)
    assert here.lead_in_s == 0.0
    for turn in (-0.5, 0.5):
        result, turned = planned(config, bench, (start[0], start[1], start[2] + turn))
        assert result == lib.OMNI_OK
        assert turned.lead_in_s > 0.1


def test_a_way_of_turning_that_there_is_not_is_refused() -> None:
    bench = Bench(TRJ_TYPE=3.0)
    config = ffi.addressof(bench.config, "trajectory")
    config.rotation = lib.OMNI_TRJ_ROT_COUNT
    assert planned(config, bench, (0, 0, 0))[0] == lib.OMNI_ERR_RANGE


def test_a_rose_has_one_to_thirty_two_petals() -> None:
    bench = Bench()
    config = ffi.addressof(bench.config, "trajectory")
    config.type = lib.OMNI_TRJ_TYPE_ROSE
    config.period_s = 600.0
    results = {}
    for petals in (0, 1, 32, 33):
        config.petals = petals
        results[petals] = planned(config, bench, (0, 0, 0))[0] != lib.OMNI_ERR_RANGE
    assert results == {0: False, 1: True, 32: True, 33: False}
