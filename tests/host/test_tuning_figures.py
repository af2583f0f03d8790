# SPDX-License-Identifier: MIT
"""Figures of docs/guides/tuning.md that are of real wheels, run again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil_sim import metrics
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.world import IDEAL_WHEELS

PAGE = " ".join((Path(__file__).parents[2] / "docs" / "guides" / "tuning.md").read_text(encoding="utf-8").split())
DRY_N_M = 0.4


def torque_error_mm(dead: float, *, ideal: bool = False) -> float:
    """Return the position error of direct torque control with stiff motors, for 40 s of the demo's path."""
    demo = load_scenario("demo").with_duration(40.0)
    torque = demo.robot.table["CTL_MODE"].parse("test", "CTL_MODE", "torque")
    world = {"coulomb_friction_N_m": DRY_N_M, **(IDEAL_WHEELS if ideal else {})}
    run = run_in_process(demo.with_parameters({"CTL_MODE": torque, "DT_DEAD": dead}).with_world(world))
    return 1e3 * metrics.tracking_rmse(run.record).position_m


def test_dry_friction_and_the_dead_band_that_makes_up_for_it() -> None:
    with_it, without = torque_error_mm(DRY_N_M / 4.67), torque_error_mm(0.0)
    assert f"path is off by {with_it:.1f} instead of {without:.1f} mm" in PAGE


@pytest.mark.parametrize("ideal", [False, True])
def test_the_velocity_that_creep_and_rollers_add(ideal: bool) -> None:
    """What the body does beyond the wheels' turning less the imposed slip, from the geometry, on the demo's path."""
    scenario = load_scenario("demo").with_world(IDEAL_WHEELS if ideal else {})
    record = run_in_process(scenario).record
    geometry = scenario.robot.geometry
    angles = np.radians(geometry["wheel_angle_deg"])
    rows = np.column_stack((-np.sin(angles), np.cos(angles), np.full(3, geometry["wheel_distance_m"])))
    rates = np.diff(record["truth"], axis=0) / 1e-3
    theta = 0.5 * (record["truth"][1:, 2] + record["truth"][:-1, 2])
    cosine, sine = np.cos(theta), np.sin(theta)
    body = np.stack((cosine * rates[:, 0] + sine * rates[:, 1], cosine * rates[:, 1] - sine * rates[:, 0], rates[:, 2]))
    turned = 0.5 * (record["wheel_rad_s"][1:, :3] + record["wheel_rad_s"][:-1, :3]) * geometry["wheel_radius_m"]
    left = body - np.linalg.pinv(rows) @ (turned * (1.0 - record["slip_ratio"][1:, :3])).T
    largest = np.abs(left[:, metrics.on_path(record)[1:]]).max(axis=1)
    if ideal:
        assert f"({largest[2]:.3f} rad/s on ideal wheels)" in PAGE
    else:
        assert f"add at most {1e3 * largest[:2].max():.1f} mm/s and {largest[2]:.3f} rad/s" in PAGE
