# SPDX-License-Identifier: MIT
"""A wheel that turns faster than it is asked to stops the robot, whatever made it do so."""

from __future__ import annotations

import random
from collections.abc import Mapping

import pytest

from omniwheel._core import lib
from omniwheel.robots import parameter_table
from tests.hil_sim.moving import CONTROLLERS, ROBOTS, Moving, runs_away

LOCKED = ("MOT_J", "MOT_B", "MOT_K", "MOT_R", "MOT_L", "BAT_V_NOM", "MASS", "INERTIA", "LIM_A")
"""Parameters of the motor model and of the ramp: no other than a robot at rest takes them."""
SETTABLE = [p for p in parameter_table().parameters if not p.disarmed_only]
"""What an armed robot takes."""
PAIRS = 150
"""Random pairs of them per robot and controller."""


def test_the_model_and_the_ramp_are_locked_while_armed() -> None:
    assert all(parameter_table()[name].disarmed_only for name in LOCKED)


def test_a_wrong_motor_model_ends_as_a_stop_fault() -> None:
    """The friction that the parameter table has for another motor: 0.40 m/s in place of 0.1, for good."""
    robot = Moving("fast", lib.OMNI_SETPOINT_VELOCITY_BODY, 0.1, LIM_WHEEL=5.0)
    robot.move(1.0)
    assert robot.change({"MOT_B": 1.0})
    moved = robot.move(5.0)
    out = robot.outputs
    assert out.state == lib.OMNI_STATE_FAILSAFE
    assert out.fault_history == lib.OMNI_FAULT_OVERSPEED
    assert out.stop.wheel in range(1, robot.wheels + 1)
    assert abs(out.stop.wheel_rad_s) > 1.2 * 0.1 / 0.048
    assert moved < 1.0


@pytest.mark.parametrize(
    "cause",
    [
        {"MOT_B": 100.0},
        {"WS_P": 0.0, "WS_I": 0.0, "WS_FF_S": 12.0},
        {"WS_P": 0.0, "WS_I": 0.0, "WS_FF_S": 12.0, "WS_FF": 1.5},
    ],
)
@pytest.mark.parametrize("speed", [0.1, 0.8])
def test_a_runaway_ends_as_a_stop(cause: Mapping[str, float], speed: float) -> None:
    """Whatever its cause: the parameters are set past all locks."""
    robot = Moving("fast", lib.OMNI_SETPOINT_VELOCITY_BODY, speed)
    robot.move(1.0)
    assert robot.change(cause)
    moved = robot.move(1.5)
    assert robot.outputs.state == lib.OMNI_STATE_FAILSAFE
    assert moved < 3.0


@pytest.mark.parametrize("scenario", ROBOTS)
def test_full_braking_from_full_speed_is_no_fault(scenario: str) -> None:
    robot = Moving(scenario, lib.OMNI_SETPOINT_VELOCITY_BODY, 0.0, LIM_A=100.0)
    top = float(robot.config.limits.speed_m_s)
    for asked in (top, 0.0, -top, 0.0):
        robot.speed = asked
        robot.move(1.5)
        assert robot.outputs.state == lib.OMNI_STATE_ARMED


@pytest.mark.parametrize("scenario", ROBOTS)
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("kind", [lib.OMNI_SETPOINT_POSE, lib.OMNI_SETPOINT_VELOCITY_WORLD])
def test_a_sound_robot_drives_at_any_speed(scenario: str, controller: int, kind: int) -> None:
    robot = Moving(scenario, kind, 0.0, CTL_MODE=controller)
    # The original law loses the path of a fast robot that is to move faster.
    most = 0.2 if (scenario, controller) == ("fast", lib.OMNI_CTL_MODE_ORIGINAL) else 0.4
    for share in (0.05, most, -most, 0.0):
        robot.turn_to_speed(share * ROBOTS[scenario])
        robot.move(2.0)
        assert not robot.outputs.fault_history & lib.OMNI_FAULT_OVERSPEED
        assert robot.outputs.state == lib.OMNI_STATE_ARMED


@pytest.mark.parametrize("scenario", ROBOTS)
@pytest.mark.parametrize("after_s", [0.0, 0.02, 0.1, 0.2])
def test_a_robot_whose_wheels_coast_is_not_armed(scenario: str, after_s: float) -> None:
    robot = Moving(scenario, lib.OMNI_SETPOINT_VELOCITY_BODY, ROBOTS[scenario])
    robot.move(3.0)
    robot.event(lib.OMNI_EVENT_DISARM)
    robot.pause(after_s)
    coasts = max(map(abs, robot.wheel_rad_s())) > 0.1 * robot.config.limits.wheel_rad_s
    assert coasts or scenario != "fast", "its gears are light"
    robot.event(lib.OMNI_EVENT_ARM)
    if coasts:
        assert robot.outputs.state == lib.OMNI_STATE_DISARMED
        assert robot.arming_faults() == lib.OMNI_FAULT_OVERSPEED
        assert not robot.outputs.faults & lib.OMNI_FAULT_OVERSPEED, "it may be pushed"
    robot.event(lib.OMNI_EVENT_DISARM)
    robot.pause(6.0)
    robot.event(lib.OMNI_EVENT_ARM)
    assert robot.outputs.state == lib.OMNI_STATE_ARMED


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", ROBOTS)
@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("kind", [lib.OMNI_SETPOINT_POSE, lib.OMNI_SETPOINT_VELOCITY_BODY])
def test_no_parameter_that_may_be_set_in_motion_makes_the_robot_run_away(
    scenario: str, controller: int, kind: int
) -> None:
    """Each one at both of its ends, then pairs of them: the robot is hardly faster than asked, or it stops."""
    draw = random.Random(f"{scenario} {controller} {kind}")
    ends = [{p.name: end} for p in SETTABLE for end in (p.minimum, p.maximum)]
    pairs = [{p.name: draw.choice((p.minimum, p.maximum)) for p in draw.sample(SETTABLE, 2)} for _ in range(PAIRS)]
    found = [values for values in ends + pairs if runs_away(scenario, kind, controller, values)]
    assert not found
