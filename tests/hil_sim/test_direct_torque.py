# SPDX-License-Identifier: MIT
"""Direct torque control through the whole tick, on both robots in the full plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim import metrics
from hil_sim.runs import Run, faults_seen, run_in_process
from hil_sim.scenario import load_scenario
from omniwheel.robots import read_robot


def drive(robot: str, duration_s: float, world: dict[str, float] | None = None, **parameters: str | float) -> Run:
    scenario = load_scenario("demo")
    table = scenario.robot.table
    values = {name: table[name].parse("test", name, value) for name, value in parameters.items()}
    values["CTL_MODE"] = float(table["CTL_MODE"].values["torque"])
    return run_in_process(
        replace(
            scenario,
            robot=read_robot(robot),
            parameters={**scenario.parameters, **values},
            world={**scenario.world, **(world or {})},
            events=tuple(event for event in scenario.events if event.settings is None),
            duration_s=duration_s,
        )
    )


@pytest.mark.parametrize("robot", ["three_wheel", "four_wheel"])
@pytest.mark.parametrize("path", ["line", "circle", "rose", "random"])
def test_it_drives_each_robot_along_each_path_on_a_slippery_floor(robot: str, path: str) -> None:
    run = drive(robot, 25.0, TRJ_TYPE=path, TRJ_PERIOD=8.0 if path in ("line", "random") else 30.0)
    assert faults_seen(run)[0] == []
    rmse = metrics.tracking_rmse(run.record, start_s=6.0)
    assert rmse.position_m < 0.003
    assert rmse.theta_rad < 0.005
    assert metrics.effort(run.record, run.scenario.robot.wheels).chatter < 0.05


def test_no_pwm_compensation_leaves_the_motors_friction_to_the_gains() -> None:
    with_emf, without = (
        metrics.tracking_rmse(drive("three_wheel", 20.0, DT_EMF=share).record).position_m for share in (1.0, 0.0)
    )
    assert with_emf < 0.3 * without
    assert without < 0.1


@pytest.mark.full
def test_a_deadband_in_the_curve_makes_up_for_dry_friction() -> None:
    stiff = {"coulomb_friction_N_m": 0.4}
    without, with_it = (
        metrics.tracking_rmse(drive("three_wheel", 20.0, stiff, DT_DEAD=dead).record) for dead in (0.0, 0.4 / 4.667)
    )
    assert with_it.position_m < 0.6 * without.position_m
    assert with_it.theta_rad < 0.5 * without.theta_rad


def test_a_wheel_on_ice_turns_no_faster_than_it_may() -> None:
    ice = {"friction_coefficient": 0.005, "slip_max": 0.0}
    loose: dict[str, str | float] = {
        "SAFE_ERR_XY": 100.0,
        "SAFE_ERR_TH": 100.0,
        "TRJ_TYPE": "circle",
        "TRJ_PERIOD": 25.0,
        "LIM_WHEEL": 100.0,
    }
    watched, free = (drive("three_wheel", 15.0, ice, DT_SLIP=slip, **loose) for slip in (0.03, 0.0))
    asked = np.abs(watched.record["wheel_reference"][:, :3]).max()
    fastest = [float(np.abs(run.record["wheel_rad_s"][:, :3]).max()) for run in (watched, free)]
    assert fastest[0] < asked + 0.03 / 0.0508 + 0.1
    assert fastest[1] > 3.1  # all that the supply can give
