# SPDX-License-Identifier: MIT
"""What the tick says of itself: the set-point in force, how sure it is, what the original law asks of each wheel."""

from __future__ import annotations

import math

import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench

KINDS = ("POSE", "VELOCITY_BODY", "VELOCITY_WORLD", "DUTY")


@pytest.mark.parametrize("kind", KINDS)
def test_the_kind_of_set_point_in_force_is_told(kind: str) -> None:
    number = getattr(lib, f"OMNI_SETPOINT_{kind}")
    bench = Bench()
    bench.command(number)
    assert bench.tick().setpoint_kind == lib.OMNI_SETPOINT_NONE, "nothing is in force before arming"
    bench.arm()
    bench.command(number)
    assert bench.tick().setpoint_kind == number


def test_how_sure_the_pose_is_is_told_per_axis() -> None:
    bench = Bench(EKF_Q_XY=0.02, EKF_Q_TH=0.07)
    out = bench.tick(count=500)
    variance = bench.robot.estimator.pose_ekf.p
    told = [out.pose_sd[axis] for axis in range(3)]
    assert told == pytest.approx([math.sqrt(variance[axis][axis]) for axis in range(3)])
    assert 0.0 < told[0] < told[2]


@pytest.mark.parametrize(("way", "sign"), [((1.0, 1.0), -1.0), ((1.0, -1.0), 1.0)])
def test_how_x_and_y_depend_on_each_other_is_told(way: tuple[float, float], sign: float) -> None:
    """An unsure heading makes the robot unsure across its way: to the left of (1, 1) x falls while y rises."""
    bench = Bench(EKF_MODE=1, EKF_Q_XY=0.001, EKF_Q_TH=0.1)
    bench.arm()
    for _ in range(100):
        bench.command(lib.OMNI_SETPOINT_VELOCITY_WORLD, twist=(0.2 * way[0], 0.2 * way[1], 0.0))
        out = bench.tick(count=20)
    assert out.pose_xy_m2 == bench.robot.estimator.pose_ekf.p[0][1]
    correlation = out.pose_xy_m2 / (out.pose_sd[0] * out.pose_sd[1])
    assert 0.5 < sign * correlation < 1.0


@pytest.mark.parametrize("robot_name", ["three_wheel", "four_wheel"])
def test_the_original_law_has_every_wheel_and_its_wishes_are_told(robot_name: str) -> None:
    bench = Bench(robot_name, CTL_MODE=float(lib.OMNI_CTL_MODE_ORIGINAL))
    bench.arm()
    for _ in range(30):
        bench.command(lib.OMNI_SETPOINT_POSE, pose=(0.05, 0.02, 0.3))
        out = bench.tick(count=10)
    wishes = bench.robot.control.original
    for wheel in range(bench.wheels):
        volts = out.duty[wheel] * bench.config.motor_direction[wheel] * out.supply_V
        assert out.voltage_V[wheel] == pytest.approx(volts, rel=1e-5)
        assert volts == pytest.approx(out.duty_scale * wishes.voltage_V[wheel], rel=1e-5)
        assert out.wheel_reference[wheel] == wishes.wheel_reference[wheel]
        assert abs(volts) > 0.01
        assert abs(out.wheel_reference[wheel]) > 0.01
