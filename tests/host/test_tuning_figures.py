# SPDX-License-Identifier: MIT
"""Figures of docs/guides/tuning.md that are of real wheels, run again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.record import Record
from hil_sim.runs import Player, run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.world import IDEAL_WHEELS
from omniwheel._core import lib

PAGE = " ".join((Path(__file__).parents[2] / "docs" / "guides" / "tuning.md").read_text(encoding="utf-8").split())
DRY_N_M = 0.4
LOOK_TICKS, MOST_TICKS = 8, 100_000


def torque_error_mm(dead: float, *, ideal: bool = False) -> float:
    """Return the position error of direct torque control with stiff motors, for 40 s of the demo's path."""
    demo = load_scenario("demo").with_duration(40.0)
    torque = demo.robot.table["CTL_MODE"].parse("test", "CTL_MODE", "torque")
    world = {"coulomb_friction_N_m": DRY_N_M, **(IDEAL_WHEELS if ideal else {})}
    run = run_in_process(demo.with_parameters({"CTL_MODE": torque, "DT_DEAD": dead}).with_world(world))
    return 1e3 * metrics.tracking_rmse(run.record).position_m


def test_dry_friction_and_the_deadband_that_makes_up_for_it() -> None:
    with_it, without = torque_error_mm(DRY_N_M / 4.67), torque_error_mm(0.0)
    assert f"path is off by {with_it:.1f} instead of {without:.1f} mm" in PAGE


def unknown_velocity(name: str) -> NDArray[np.float64]:
    """Return what the robot takes for unknown in the second half of a path, by look and axis [m/s, m/s, rad/s]."""
    scenario = load_scenario(name).with_world(IDEAL_WHEELS)
    values = scenario.parameter_values()
    gains: NDArray[np.float64] = np.array([values["ISMC_K_XY"], values["ISMC_K_XY"], values["ISMC_K_TH"]])
    player = Player(scenario)
    record = Record(MOST_TICKS)
    player._run.record = record.c
    margins = []
    while lib.hil_player_play(player._player, LOOK_TICKS):
        margins.append(list(player._run.robot.margin.margin))
    followed = np.array([margin for margin in margins if any(margin)])
    unknown: NDArray[np.float64] = gains - followed[len(followed) // 2 :]
    return unknown


@pytest.mark.full
def test_the_velocity_that_the_robot_takes_for_unknown() -> None:
    for name, sentence in (
        ("demo", "is at most {} with fixes at 50 Hz"),
        ("no_fixes", "Without fixes it is at most {}."),
    ):
        unknown = unknown_velocity(name)
        assert sentence.format(f"{1e3 * unknown[:, :2].max():.0f} mm/s and {unknown[:, 2].max():.3f} rad/s") in PAGE


@pytest.mark.full
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
