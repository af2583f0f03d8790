# SPDX-License-Identifier: MIT
"""Experiments with the position loop on the real firmware in simulated time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from omniwheel.errors import LimitError
from omniwheel.experiments import Outcome, PositionPlan, PushPlan, disturbance, position_step, position_sweep
from tests.host.experiments.test_wheel import FLOOR, ROOM_M, connected


def check_against_the_model(outcome: Outcome) -> None:
    bandwidth, phase = outcome["bandwidth_hz"], outcome["phase_margin_rad"]
    assert abs(bandwidth.measured - bandwidth.model) < bandwidth.half_width + 0.03 * bandwidth.model
    assert bandwidth.half_width < 0.25 * bandwidth.model
    assert phase.measured == pytest.approx(phase.model, abs=math.radians(6.0))
    assert outcome["distance"].measured == pytest.approx(outcome["distance"].model, rel=0.05)
    assert outcome["coherence"].measured > 0.8


@pytest.mark.full
@pytest.mark.parametrize("axis", ["x", "theta"])
def test_the_measured_position_loop_is_that_of_the_model(axis: str) -> None:
    with connected(FLOOR) as robot:
        outcome = position_sweep(robot, PositionPlan(axis, duration_s=12.0), ROOM_M, lambda _: None)
        assert not robot.status.armed
    check_against_the_model(outcome)
    assert not outcome.remarks


@pytest.mark.full
def test_a_smaller_lambda_shows_where_the_governed_step_showed_nothing() -> None:
    """`omni tune` steps through the reference governor: 40-fold gains gave the same rise time."""
    rises = []
    with connected(FLOOR) as robot:
        for lam in (12.0, 3.0):
            robot.parameters["ISMC_LAM_XY"] = lam
            outcome = position_step(robot, PositionPlan("x", 0.004, 1.5), ROOM_M, lambda _: None)
            rises.append(outcome["rise_s"].measured)
    assert rises[1] > 1.5 * rises[0]


def test_a_push_moves_the_robot_and_it_comes_back() -> None:
    with connected(FLOOR) as robot:
        outcome = disturbance(robot, PushPlan(2), ROOM_M, lambda _: None)
        assert not robot.status.armed
    assert outcome["speed_rad_s"].measured > 0.1
    assert 1e-4 < outcome["moved_m"].measured < 0.01
    assert outcome["left_m"].measured < 0.5 * outcome["moved_m"].measured
    pushed = outcome.burst.time_s < 0.1
    volts = outcome.burst.wheel("voltage", 1)
    assert np.max(volts[pushed]) > 1.0


@pytest.mark.parametrize(
    ("plan", "why"),
    [
        (PositionPlan("x", 0.3), "an amplitude of 0.3 m is invalid"),
        (PositionPlan("x", 0.0), "an amplitude of 0 m is invalid"),
        (PositionPlan("x", 0.1), "LIM_WHEEL is 3"),
        (PositionPlan("x", 0.008), "LIM_DUTY leaves"),
    ],
)
def test_steps_that_the_robot_cannot_take_are_refused_before_it_arms(plan: PositionPlan, why: str) -> None:
    with connected(FLOOR) as robot:
        with pytest.raises(LimitError, match=why):
            position_step(robot, plan, ROOM_M, lambda _: None)
        assert not robot.armed_here
        assert not robot.status.armed


@pytest.mark.parametrize("plan", [PushPlan(4), PushPlan(0), PushPlan(1, 13.0)])
def test_pushes_that_cannot_be_are_refused_before_it_arms(plan: PushPlan) -> None:
    with connected(FLOOR) as robot:
        with pytest.raises(LimitError):
            disturbance(robot, plan, ROOM_M, lambda _: None)
        assert not robot.armed_here
