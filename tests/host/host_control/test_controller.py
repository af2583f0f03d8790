# SPDX-License-Identifier: MIT
"""The host's controller: the core's law through the robot's geometry, against closed forms; what it refuses."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.errors import CoreError, ParameterRangeError
from omniwheel.frames import Pose, Twist
from omniwheel.host_control.controller import (
    PERIOD_S,
    HostController,
    HostControlSettings,
    host_control_values,
    pwm_of,
    share_of,
)
from omniwheel.mocap.source import MocapPose
from omniwheel.robots import read_robot

STILL = Twist(0.0, 0.0, 0.0)
DEFAULTS = HostControlSettings()
ROBOT = read_robot("four_wheel")
ANGLES = np.radians([45.0, 135.0, 225.0, 315.0])
RADIUS_M, DISTANCE_M = 0.03175, 0.195


def controller(settings: HostControlSettings = DEFAULTS, **changes: Any) -> HostController:
    return HostController(ROBOT, host_control_values(ROBOT, changes), settings)


def seen(pose: Pose, time_s: float, latency_s: float = 0.0, frame: int = 1) -> MocapPose:
    return MocapPose(pose, time_s - latency_s, time_s, frame)


def wheels_for(world: np.ndarray[Any, Any], theta: float) -> np.ndarray[Any, Any]:
    """Rigid-body kinematics written down anew: r w_i = the speed of wheel i's place along its direction of drive."""
    c, s = math.cos(theta), math.sin(theta)
    body = np.array([c * world[0] + s * world[1], -s * world[0] + c * world[1]])
    tangents = np.column_stack([-np.sin(ANGLES), np.cos(ANGLES)])
    result: np.ndarray[Any, Any] = (tangents @ body + DISTANCE_M * world[2]) / RADIUS_M
    return result


@pytest.mark.full
@given(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-3.0, 3.0), st.floats(-0.05, 0.05))
def test_the_p_controller_is_kp_times_the_error_through_the_kinematics(
    x: float, y: float, theta: float, turn: float
) -> None:
    host = controller(CTL_MODE="p", FL_KP_XY=2.0, FL_KP_TH=1.5, LIM_WHEEL=3.0)
    host.fix(seen(Pose(x, y, theta), 10.0))
    rate = Twist(0.01, -0.02, 0.03)
    command = host.step(10.0, Pose(0.0, 0.0, theta + turn), rate)
    wanted = np.array(rate) - np.array([2.0, 2.0, 1.5]) * np.array([x, y, -turn])
    wheels = wheels_for(wanted, theta)
    wheels *= min(1.0, 3.0 / np.abs(wheels).max())
    assert command.wheel_rad_s == pytest.approx(wheels, abs=2e-3)
    assert command.pwm == pytest.approx(255.0 * np.array(command.wheel_rad_s) / host.full_speed_rad_s, abs=0.51)


def test_a_far_goal_is_cut_with_its_direction_kept() -> None:
    host = controller(CTL_MODE="p")
    host.fix(seen(Pose(2.0, -1.0, 0.3), 5.0))
    command = host.step(5.0, Pose(0.0, 0.0, 0.3), STILL)
    assert 0.0 < command.scale < 0.2
    assert max(map(abs, command.wheel_rad_s)) == pytest.approx(host.wheel_limit_rad_s, rel=1e-6)
    wanted = wheels_for(np.array([-2.0, 1.0, 0.0]), 0.3)
    ratio = np.array(command.wheel_rad_s) / wanted
    assert ratio == pytest.approx(np.full(4, ratio[0]), rel=1e-5)


def test_a_motor_wired_the_other_way_gets_the_other_sign() -> None:
    straight = controller(CTL_MODE="p")
    turned = controller(CTL_MODE="p", W2_MOT_DIR=-1)
    for host in (straight, turned):
        host.fix(seen(Pose(0.3, 0.1, 0.5), 1.0))
    first, second = (host.step(1.0, Pose(0.0, 0.0, 0.0), STILL).pwm for host in (straight, turned))
    assert second == (first[0], -first[1], first[2], first[3])
    assert first[1] != 0


@given(st.integers(0, 254), st.floats(-1.5, 1.5))
def test_pwm_is_linear_beyond_the_deadband_and_reads_back(pwm_min: int, share: float) -> None:
    pwm = pwm_of(share, pwm_min)
    limited = max(-1.0, min(1.0, share))
    assert -255 <= pwm <= 255
    assert pwm == 0 or abs(pwm) >= pwm_min
    assert abs(share_of(pwm, pwm_min) - limited) <= 0.51 / (255 - pwm_min) + 0.5 / 255
    assert pwm_of(-share, pwm_min) == -pwm


def test_the_filter_predicts_with_what_the_robot_was_told_after_the_delay() -> None:
    host = controller(HostControlSettings(delay_s=0.04))
    host.fix(seen(Pose(0.0, 0.0, 0.0), 1.0))
    host.sent((100, 100, 100, 100), 1.0)  # all wheels forward: a turn
    host.step(1.04, Pose(0.0, 0.0, 0.0), STILL)
    assert host.pose.theta == pytest.approx(0.0, abs=1e-6)
    host.step(1.54, Pose(0.0, 0.0, 0.0), STILL)
    turn = 100 / 255 * host.full_speed_rad_s * RADIUS_M / DISTANCE_M * 0.5
    assert host.pose.theta == pytest.approx(turn, rel=1e-3)


def test_a_late_fix_corrects_the_time_it_was_taken() -> None:
    host = controller(EKF_Q_XY=0.1, EKF_Q_TH=0.1, EKF_R_XY=1e-4, EKF_R_TH=1e-4)
    host.fix(seen(Pose(0.0, 0.0, 0.0), 1.0))
    speed = 0.08  # m/s along x; wheels at 45 degrees
    pwm = [round(255 * w / host.full_speed_rad_s) for w in wheels_for(np.array([speed, 0.0, 0.0]), 0.0)]
    host.sent(pwm, 0.9)
    for step in range(1, 51):
        now_s = 1.0 + step * PERIOD_S
        true_then = Pose(speed * (now_s - 0.1 - 1.0) + 0.002, 0.001, 0.0)  # the cameras say: 2 mm ahead, 1 mm left
        host.fix(MocapPose(true_then, now_s - 0.1, now_s, step))
        host.step(now_s, Pose(0.0, 0.0, 0.0), STILL)
    assert host.pose.x == pytest.approx(speed * 1.0 + 0.002, abs=5e-4)
    assert host.pose.y == pytest.approx(0.001, abs=2e-4)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_fix_that_is_no_number_is_not_used(bad: float) -> None:
    host = controller()
    assert not host.fix(seen(Pose(bad, 0.0, 0.0), 1.0))
    assert not host.located
    host.fix(seen(Pose(0.0, 0.0, 0.0), 1.0))
    assert not host.fix(seen(Pose(0.0, bad, 0.0), 1.02))
    assert host.last_fix_s == 1.0
    assert host.step(1.02, Pose(0.0, 0.0, 0.0), STILL).pwm == (0, 0, 0, 0)


def test_a_jump_is_refused_at_first() -> None:
    host = controller()
    host.fix(seen(Pose(0.0, 0.0, 0.0), 1.0))
    assert not host.fix(seen(Pose(1.0, 0.0, 0.0), 1.02))
    assert host.fix(seen(Pose(0.0, 0.0, 0.0), 1.04))


def test_what_cannot_be_run_on_the_host_is_refused() -> None:
    three = read_robot("three_wheel")
    with pytest.raises(CoreError, match="3 wheels"):
        HostController(three, host_control_values(three))
    for mode in ("none", "original"):
        with pytest.raises(ParameterRangeError, match=f"CTL_MODE = {mode}"):
            controller(CTL_MODE=mode)
    with pytest.raises(ParameterRangeError, match="FL_KP_XY"):
        controller(FL_KP_XY=-1.0)
    with pytest.raises(CoreError, match="MOT_DIR"):
        controller(W1_MOT_DIR=0)


@pytest.mark.parametrize(
    "bad",
    [{"full_speed_rad_s": 0.0}, {"full_speed_rad_s": math.nan}, {"pwm_min": 255}, {"pwm_min": -1}, {"delay_s": 2.0}],
)
def test_settings_out_of_range_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ParameterRangeError):
        replace(HostControlSettings(), **bad)


def test_noise_densities_keep_their_meaning_at_the_longer_step() -> None:
    host = controller(EKF_Q_XY=0.01, EKF_Q_TH=0.02)
    host.fix(seen(Pose(0.0, 0.0, 0.0), 1.0))
    before = copy.copy([host._core.ekf.p[i][i] for i in range(3)])
    host.step(2.0, Pose(0.0, 0.0, 0.0), STILL)
    grown = [host._core.ekf.p[i][i] - before[i] for i in range(3)]
    assert grown == pytest.approx([1e-4, 1e-4, 4e-4], rel=0.02)
