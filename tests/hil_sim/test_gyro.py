# SPDX-License-Identifier: MIT
"""The simulated gyro, and what a robot makes of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hil_sim import gyro_figures
from hil_sim.runs import faults_seen, new_world, run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.world import IDEAL_WHEELS
from omniwheel._core import ffi, lib
from tests.native import ROOT


def readings(ticks: int, seed: int = 1, faults: Any = (), **world: float) -> tuple[Any, Any]:
    """Return readings [rad/s] and flags of a robot that stands, a row per tick."""
    scenario = replace(
        load_scenario("stand").with_seed(seed), world={**IDEAL_WHEELS, "gyro_rate_Hz": 1000.0, **world}, faults=faults
    )
    made = new_world(scenario)
    sensors = ffi.new("hil_sensors_t *")
    rows, valid = [], []
    for _ in range(ticks):
        lib.hil_world_step(made.c, 1000)
        lib.hil_world_sense(made.c, sensors)
        rows.append(list(sensors.gyro_rad_s))
        valid.append(sensors.gyro_valid)
    return np.array(rows), np.array(valid)


def test_its_noise_is_that_of_the_data_sheet() -> None:
    rates, valid = readings(20000, gyro_bias_rad_s=0.0, gyro_bias_walk=0.0)
    assert set(valid) == {7}
    assert rates.std(axis=0) * math.sqrt(1e-3) == pytest.approx([4.9e-5] * 3, rel=0.03)
    assert np.abs(np.corrcoef(rates.T) - np.eye(3)).max() < 0.04
    slow, valid = readings(20000, gyro_rate_Hz=200.0, gyro_bias_rad_s=0.0, gyro_range_rad_s=1.0)
    assert valid.mean() == pytest.approx(7 / 5)
    assert slow[valid == 7].std() * math.sqrt(5e-3) == pytest.approx(4.9e-5, rel=0.03)


def test_its_bias_is_another_one_in_each_run_and_walks() -> None:
    starts = [readings(200, seed, gyro_noise_density=0.0)[0][-1] for seed in range(60)]
    assert np.std(starts) == pytest.approx(0.0087, rel=0.2)
    walks = [readings(5000, seed, gyro_noise_density=0.0, gyro_bias_walk=1e-3)[0] for seed in range(30)]
    steps = np.concatenate([walk[-1] - walk[0] for walk in walks])
    assert steps.std() == pytest.approx(1e-3 * math.sqrt(5.0), rel=0.2)


@pytest.mark.parametrize(("axis", "sign"), [(1, 1), (2, 1), (3, 1), (-1, -1), (-2, -1), (-3, -1)])
def test_each_axis_may_point_up_or_down(axis: int, sign: int) -> None:
    scenario = load_scenario("gyro")
    scenario = replace(scenario, parameters={**scenario.parameters, "GYRO_AXIS": axis}, duration_s=6.0)
    run = run_in_process(replace(scenario, world={**scenario.world, "gyro_axis": axis}))
    wrong = run_in_process(replace(scenario, world={**scenario.world, "gyro_axis": -axis}))
    assert "gyro" not in faults_seen(run)[1]
    assert "gyro" in faults_seen(wrong)[1]
    for each, most in ((run, 0.01), (wrong, 0.5)):
        off = np.abs(each.record["estimate"][:, 2] - each.record["truth"][:, 2])
        assert off.max() < most
        assert off[-1] < 0.01, "noticed and taken back"


def test_scale_range_and_steps() -> None:
    rates, _ = readings(50, gyro_range_rad_s=0.1, gyro_bias_rad_s=1.0, gyro_noise_density=0.0)
    assert np.abs(rates).max() == 0.1
    fine, _ = readings(2000, gyro_range_rad_s=8.0)
    steps = fine / (8.0 / 32768.0)
    assert np.abs(steps - np.round(steps)).max() < 1e-6


def test_off_it_changes_nothing() -> None:
    scenario = load_scenario("demo")
    plain = run_in_process(replace(scenario, duration_s=5.0))
    with_gyro = replace(scenario, duration_s=5.0, world={**scenario.world, "gyro_rate_Hz": 1000.0})
    assert (run_in_process(with_gyro).record == plain.record).all()


@pytest.mark.parametrize("title", ["no fixes", "no fixes, fast robot", "no fixes, four wheels", "fixes"])
def test_the_heading_is_better_and_as_sure_as_it_says(title: str) -> None:
    setting = next(each for each in gyro_figures.SETTINGS if each.title == title)
    seeds = range(12)
    old, new = (gyro_figures.measure(replace(setting, seconds=25), seeds, gyro) for gyro in (False, True))
    assert new.rms_heading < 0.35 * old.rms_heading
    assert new.rms_position < 1.02 * old.rms_position
    assert 0.02 < float(np.mean(new.nees)) < 1.6
    assert new.warned == 0


@pytest.mark.parametrize(
    "setting",
    [
        pytest.param(each, id=each.title, marks=[] if each.title == "fixes, fast robot" else pytest.mark.nightly)
        for each in gyro_figures.SETTINGS
    ],
)
def test_the_page_says_what_the_figures_command_says(setting: gyro_figures.Setting) -> None:
    page = (ROOT / "docs" / "guides" / "gyro.md").read_text(encoding="utf-8")
    assert gyro_figures.row(setting, gyro_figures.SEEDS) in page.splitlines()
