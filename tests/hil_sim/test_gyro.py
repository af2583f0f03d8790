# SPDX-License-Identifier: MIT
"""The simulated gyro, and what a robot makes of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench.figures import gyro as gyro_figures
from hil_sim.faults import Fault
from hil_sim.runs import faults_seen, new_world, run_in_process
from hil_sim.scenario import Scenario, load_scenario
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


@pytest.mark.full
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


def with_gyro(scenario: Scenario, **world: float) -> Scenario:
    return scenario.with_parameters({"GYRO_AXIS": 3.0}).with_world({"gyro_rate_Hz": 1000.0, **world})


def warned_s(record: Any) -> float:
    """Return for how long the warning showed after the first five seconds [s]."""
    return float(((record["faults"] & lib.OMNI_WARN_GYRO) != 0)[5000:].sum() * 1e-3)


def heading_error(record: Any) -> float:
    return float(np.abs(np.remainder(record["estimate"][-1, 2] - record["truth"][-1, 2] + np.pi, 2 * np.pi) - np.pi))


@pytest.mark.full
def test_a_gyro_is_used_after_somebody_has_turned_the_wheels_by_hand() -> None:
    """The steps of bring-up follow each other on one robot."""
    record = run_in_process(replace(with_gyro(load_scenario("hands")), duration_s=45.0)).record
    assert warned_s(record) == 0.0


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("friction", [0.15, 0.2, 0.3])
def test_a_gyro_keeps_the_heading_on_ice(friction: float, seed: int) -> None:
    """Wheels turn several times as far as the body."""
    scenario = with_gyro(load_scenario("fast_no_fixes").with_seed(seed), friction_coefficient=friction)
    record = run_in_process(scenario).record
    assert warned_s(record) == 0.0
    assert heading_error(record) < 0.02


@pytest.mark.parametrize("step_rad_s", [0.03, 0.05, -0.1, 0.3])
def test_a_bias_that_steps_turns_no_robot_that_holds_its_pose(step_rad_s: float) -> None:
    scenario = load_scenario("gyro_no_fixes").with_parameters({"GYRO_AXIS": 3.0})
    step = Fault("gyro_offset", 10.0, 1e9, value=step_rad_s)
    events = tuple(event for event in scenario.events if event.command == "arm")
    record = run_in_process(replace(scenario, events=events, duration_s=60.0, faults=(step,))).record
    assert abs(record["truth"][-1, 2]) < 0.1
    assert warned_s(record) > 4.0


@pytest.mark.full
def test_with_fixes_a_bias_that_steps_costs_what_the_page_says() -> None:
    scenario = load_scenario("gyro").with_parameters({"GYRO_AXIS": 3.0})
    step = Fault("gyro_offset", 10.0, 1e9, value=0.05)
    record = run_in_process(replace(scenario, faults=(step,))).record
    off = (record["estimate"][:, 2] - record["truth"][:, 2] + np.pi) % (2 * np.pi) - np.pi
    assert np.sqrt(np.mean(off[record["time_s"] > 12.0] ** 2)) == pytest.approx(0.036, abs=0.005)


@pytest.mark.full
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


@pytest.mark.full
def test_its_chip_warms_up_and_its_bias_with_it() -> None:
    steady = {"gyro_noise_density": 0.0, "gyro_bias_walk": 0.0, "gyro_range_rad_s": 1.0}
    warm = {**steady, "gyro_warm_up_K": 10.0, "gyro_warm_up_s": 2.0, "gyro_drift_per_K": 1e-3}
    drifts = []
    for seed in range(40):
        cold, hot = (readings(6000, seed, **world)[0] for world in (steady, warm))
        drift = hot - cold
        assert np.abs(drift[0]).max() == 0.0
        assert drift[2000] == pytest.approx(drift[-1] * (1.0 - math.exp(-1.0)) / (1.0 - math.exp(-3.0)), abs=1e-4)
        drifts.append(drift[-1])
    assert np.std(drifts) == pytest.approx(1e-2 * (1.0 - math.exp(-3.0)), rel=0.2)


def test_its_filter_delays_a_turn_by_its_time_constant() -> None:
    scenario = with_gyro(load_scenario("fast"), gyro_lag_s=0.004)
    run, _config = gyro_figures.start_run(scenario, "fast")
    rates = []
    for _ in range(8000):
        lib.hil_run_advance(run, 1)
        rates.append((run.world.twist[2], run.world.gyro_late[2]))
    true, late = np.array(rates).T
    assert np.abs(true).max() > 0.5
    behind_rad = np.cumsum((true - late)[1:] + (true - late)[:-1]) * 0.5e-3
    assert behind_rad == pytest.approx(0.004 * (late[1:] - late[0]), abs=2e-5)
    assert np.abs(behind_rad).max() > 1e-3
