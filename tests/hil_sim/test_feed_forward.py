# SPDX-License-Identifier: MIT
"""The body in the feed-forward: the simulated robot speeds up as it is asked to, and the page has what that brings."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import IDEAL_WHEELS
from tests.hil_sim import feed_forward_page
from tests.hil_sim.batches import assert_the_same_without_lanes
from tests.hil_sim.feed_forward_page import PAGE, ROBOTS, WEAKER, figures

SMOOTH = {"coulomb_friction_N_m": 0.0, "roller_friction_N_s_m": 0.0}


def lag(robot: str, body: float) -> float:
    """Return by how much the wheels are too slow after 0.05 s of a start, as a share, driven by nothing else."""
    scenario: Scenario = feed_forward_page.ramps(robot).with_world({**IDEAL_WHEELS, **SMOOTH}).with_duration(2.0)
    scenario = scenario.with_parameters({"WS_P": 0.0, "WS_I": 0.0, "WS_FF_BODY": body, "LIM_A": 0.25, "LIM_V": 0.1})
    record = run_in_process(scenario).record
    wanted = record["wheel_reference"][:, : scenario.robot.wheels]
    at = int(np.argmax(np.abs(wanted).max(axis=1) > 0.0)) + 50
    return float(1.0 - np.abs(record["wheel_rad_s"][at]).sum() / np.abs(wanted[at]).sum())


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_simulated_robot_speeds_up_as_wanted(robot: str) -> None:
    without, with_body = lag(robot, 0.0), lag(robot, 1.0)
    assert abs(with_body) < 0.02
    assert without > 2.0 * abs(with_body)
    assert robot != "fast_three_wheel" or without > 0.5


@pytest.mark.full
def test_the_page_has_what_it_brings() -> None:
    assert feed_forward_page.written() == PAGE.read_text(encoding="utf-8"), (
        "python -m tests.hil_sim.feed_forward_page --write"
    )


@pytest.mark.full
def test_what_the_page_says_of_it() -> None:
    """No path changes by 1 %, or 1.5 % with weak loops; wheels follow starts and stops better, most with weak loops."""
    for robot in ROBOTS:
        for gain in (1.0, WEAKER):
            plain, body = figures(robot, 0.0, gain), figures(robot, 1.0, gain)
            assert body.position_mm == pytest.approx(plain.position_mm, rel=0.015 if gain == WEAKER else 0.01)
            assert body.heading_mrad == pytest.approx(plain.heading_mrad, rel=0.01)
            assert body.ramp_rad_s < plain.ramp_rad_s
            assert body.path_A < 1.1 * plain.path_A
            assert body.path_duty < 1.01 * plain.path_duty


@pytest.mark.parametrize("name", ["fast", "four_wheel"])
def test_eight_runs_at_once_give_the_bits_of_single_ones(name: str) -> None:
    scenario = load_scenario(name).with_duration(4.0).with_parameters({"WS_FF_BODY": 1.0})
    assert_the_same_without_lanes(scenario, 1, 8)
