# SPDX-License-Identifier: MIT
"""The core's estimate, limit and watch of the motors' currents, in the simulated world, which knows the true ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from omniwheel._core import lib
from tests.hil_sim.current_page import SCENARIOS, errors, table
from tests.hil_sim.motor_drive import Drive
from tests.hil_sim.rollers_page import PAGE

ERROR_SHARE = 0.02
"""Of the stall current: the largest error of the estimate (RMS)."""


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_estimate_is_near_the_true_current(name: str) -> None:
    error_A, true_A, stall_A = errors(name)
    assert error_A < ERROR_SHARE * stall_A
    assert true_A > 0.02 * stall_A, "there was something to estimate"


def test_the_page_has_these_figures() -> None:
    assert "\n".join(table()) in PAGE.read_text(encoding="utf-8")


LIMIT_A = 1.2
NOTICED_TICKS = 10
"""So long the robot takes a wheel that stops dead for one that turns: no count has been due yet."""


def block(run: Any, wheel: int) -> None:
    """From now on this wheel stands."""
    fault = run.world.config.fault[0]
    fault.kind, fault.wheel, fault.start_s, fault.stop_s = lib.HIL_FAULT_MOTOR_STALLED, wheel, 0.0, 1e9
    run.world.config.fault_count = 1


@pytest.mark.parametrize("name", ["demo", "fast"])
def test_a_wheel_that_gets_blocked_has_no_more_than_the_limit_and_is_named(name: str) -> None:
    wheel, peaks = 1, {}
    for limit_A in (0.0, LIMIT_A):
        drive = Drive(load_scenario(name), LIM_I=limit_A)
        limits, k = drive.config.limits, drive.config.kinematics
        turn = 0.8 * limits.wheel_rad_s * k.radius_m[0] / drive.run.world.config.wheel_distance_m[0]
        for run in drive.ticks(800, (0.0, 0.0, turn)):
            assert run.outputs.state == lib.OMNI_STATE_ARMED
        block(run, wheel)
        seen = []
        for run in drive.ticks(2000, (0.0, 0.0, turn)):
            if run.outputs.state != lib.OMNI_STATE_ARMED:
                break
            seen.append(abs(drive.true_A()[wheel]))
        peaks[limit_A] = max(seen[NOTICED_TICKS:])
        assert run.outputs.fault_history == lib.OMNI_FAULT_STALL
        assert run.outputs.stop.wheel == wheel + 1
    assert peaks[LIMIT_A] < 1.05 * LIMIT_A
    assert peaks[0.0] > 2.0 * LIMIT_A


def stopping(**parameters: float) -> tuple[list[float], list[float], float]:
    """Return speed and cut from the moment on at which a fast robot is told to stand, and how far it gets."""
    drive = Drive(load_scenario("fast"), LIM_A=3.0, **parameters)
    speed = 0.6 * float(drive.config.limits.speed_m_s)
    speeds, cuts = [], []
    *_, run = drive.ticks(1500, (speed, 0.0, 0.0))
    x_m = run.world.pose[0]
    for run in drive.ticks(500, (0.0, 0.0, 0.0)):
        speeds.append(float(np.hypot(run.world.twist[0], run.world.twist[1])))
        cuts.append(float(run.outputs.current_reduction))
    return speeds, cuts, float(run.world.pose[0] - x_m)


def test_a_robot_that_brakes_stops_where_it_would_without_the_limit() -> None:
    """With a limit far below what the brakes take."""
    (plain, _, way_m), (limited, _, limited_m) = stopping(), stopping(LIM_I=0.5)
    assert limited[0] > 0.9 * plain[0], "as fast as without, when it is told to stand"
    assert limited_m <= way_m + 2e-3
    still = [next(n for n, v in enumerate(speeds) if v < 0.02) for speeds in (plain, limited)]
    assert still[1] <= still[0] + 5


@pytest.mark.parametrize("name", ["demo", "four_wheel"])
def test_a_limit_and_a_watch_that_never_act_change_no_bit_of_a_run(name: str) -> None:
    scenario = load_scenario(name).with_parameters({"TRJ_PERIOD": 2.0, "TRJ_PETALS": 2.0, "TRJ_SIZE": 0.05})
    plain, watched = (
        run_in_process(one).record for one in (scenario, scenario.with_parameters({"LIM_I": 900.0, "SAFE_I": 900.0}))
    )
    assert plain.tobytes() == watched.tobytes()
