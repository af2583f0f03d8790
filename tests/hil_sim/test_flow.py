# SPDX-License-Identifier: MIT
"""The simulated sensor of motion over the floor, and what a robot makes of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.figures import flow as flow_figures
from bench.figures.gyro import start_run
from hil_sim import core
from hil_sim.faults import Fault
from hil_sim.runs import faults_seen, new_world, run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.world import IDEAL_WHEELS
from omniwheel._core import ffi, lib
from tests.hil_sim.batches import assert_the_same_without_lanes
from tests.native import ROOT

QUIET = {"flow_sd_m": 0.0, "flow_share": 0.0, "flow_turn_sd_rad": 0.0, "flow_turn_bias_rad_s": 0.0}
EXACT = {**QUIET, "flow_step_m": 0.0, "flow_turn_step_rad": 0.0}


def readings(
    ticks: int, world: Mapping[str, float], faults: Any = (), volts: tuple[float, ...] = (6.0, 2.0, -3.0)
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return readings, flags and true poses of a robot whose wheels get these voltages, a row per tick."""
    scenario = load_scenario("stand").with_seed(1)
    scenario = replace(scenario, world={**IDEAL_WHEELS, "flow_rate_Hz": 50.0, **world}, faults=faults)
    made = new_world(scenario)
    sensors = ffi.new("hil_sensors_t *")
    assert lib.hil_world_drive_voltage(made.c, ffi.new("double[4]", [*volts, 0.0])) == lib.HIL_OK
    rows, valid, poses = [], [], []
    for _ in range(ticks):
        lib.hil_world_step(made.c, 1000)
        lib.hil_world_sense(made.c, sensors)
        rows.append(list(sensors.flow_moved))
        valid.append(sensors.flow_valid)
        poses.append(list(made.c.pose))
    return np.array(rows), np.array(valid), np.array(poses)


def test_its_readings_are_the_way_of_its_point_in_its_axes() -> None:
    """Put together again they give the path of the point, worked out from the true poses here."""
    angle, x, y = 0.7, 0.08, -0.03
    rows, valid, poses = readings(
        2000, {**EXACT, "flow_angle_rad": angle, "flow_x_m": x, "flow_y_m": y, "flow_delay_s": 0.0}
    )
    assert set(valid) == {0, 15}
    ends = np.flatnonzero(valid)[1:]  # the first one is of time zero
    assert set(np.diff(ends)) == {20}
    for a, b in pairwise(ends):
        theta = poses[a : b + 1, 2]
        point = poses[a : b + 1, :2] + np.stack(
            [np.cos(theta) * x - np.sin(theta) * y, np.sin(theta) * x + np.cos(theta) * y], 1
        )
        step = np.diff(point, axis=0)
        middle = 0.5 * (theta[1:] + theta[:-1]) + angle
        moved = [np.cos(middle) @ step[:, 0] + np.sin(middle) @ step[:, 1]]
        moved += [np.cos(middle) @ step[:, 1] - np.sin(middle) @ step[:, 0], theta[-1] - theta[0]]
        assert rows[b] == pytest.approx(moved, abs=1e-8)
    assert np.hypot(*np.ptp(poses[:, :2], axis=0)) > 0.1
    assert np.ptp(poses[:, 2]) > 0.1


def test_it_is_late_by_its_delay_and_silent_sensors_go_on_counting() -> None:
    on_time, when, _ = readings(400, {**EXACT, "flow_delay_s": 0.0})
    late, then, _ = readings(400, {**EXACT, "flow_delay_s": 0.005})
    arrived, taken = np.flatnonzero(then)[1:], np.flatnonzero(when)[1:]  # the first one is of time zero
    np.testing.assert_array_equal(arrived, taken[: len(arrived)] + 5)
    np.testing.assert_allclose(late[arrived], on_time[taken[: len(arrived)]])
    silent, valid, _ = readings(400, {**EXACT, "flow_delay_s": 0.0}, (Fault("flow_silent", 0.1, 0.25),))
    assert not valid[105:245].any()
    np.testing.assert_allclose(silent.sum(axis=0), on_time.sum(axis=0), rtol=1e-6)


@pytest.mark.full
def test_noise_steps_scale_and_drop_outs() -> None:
    still = (0.0, 0.0, 0.0)
    rows, valid, _ = readings(20000, {**EXACT, "flow_sd_m": 1e-3, "flow_turn_sd_rad": 2e-3}, volts=still)
    assert rows[valid > 0].std(axis=0) == pytest.approx([1e-3, 1e-3, 2e-3], rel=0.07)
    rows, valid, _ = readings(3000, {**QUIET, "flow_step_m": 1e-3, "flow_turn_step_rad": 2e-3})
    steps = rows[valid > 0] / [1e-3, 1e-3, 2e-3]
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    exact, there, _ = readings(3000, EXACT)
    assert np.abs(np.cumsum(rows[valid > 0], 0) - np.cumsum(exact[there > 0], 0)).max() <= 1.01e-3, "nothing adds up"
    longer, _, _ = readings(3000, {**EXACT, "flow_scale_error": 0.02})
    np.testing.assert_allclose(longer[:, :2], 1.02 * exact[:, :2], rtol=1e-9)
    _, dropped, _ = readings(20000, {"flow_drop_probability": 0.2})
    assert set(dropped) == {0, 8, 15}
    assert np.count_nonzero(dropped == 8) / np.count_nonzero(dropped) == pytest.approx(0.2, abs=0.04)
    _, without, _ = readings(100, {"flow_turns": 0})
    assert set(without) == {0, 11}


def test_off_it_changes_nothing() -> None:
    scenario = replace(load_scenario("demo"), duration_s=5.0)
    plain = run_in_process(scenario)
    with_sensor = replace(scenario, world={**scenario.world, "flow_rate_Hz": 50.0})
    assert (run_in_process(with_sensor).record == plain.record).all()


@pytest.mark.parametrize("seed", range(4))
def test_without_fixes_the_errors_are_at_most_a_third_of_the_wheels_alone(seed: int) -> None:
    """Slip to 10 %, as in the demo: the last position and the worst one, and the heading."""
    errors = {}
    for name in ("no_fixes", "flow_no_fixes"):
        run = run_in_process(replace(load_scenario(name).with_seed(seed), duration_s=40.0))
        off = (run.record["estimate"] - run.record["truth"])[100:]  # it is told where it stands at first
        assert not faults_seen(run)[0]
        assert "floor motion" not in faults_seen(run)[1]
        errors[name] = np.array([np.hypot(off[:, 0], off[:, 1]).max(), np.abs(off[:, 2]).max()])
    assert (errors["flow_no_fixes"] < errors["no_fixes"] / 3.0).all()


def test_a_pose_that_is_set_forgets_how_readings_have_moved_the_one_of_before() -> None:
    scenario = load_scenario("flow_no_fixes")
    world = new_world(scenario).c
    config = core.robot_config(scenario.parameter_values(), scenario.robot.table, 0)
    run, why = ffi.new("hil_run_t *"), ffi.new("char[]", 160)
    assert lib.hil_run_init(run, ffi.addressof(world, "config"), config, why, len(why)) == lib.HIL_OK
    lib.hil_run_advance(run, 10)
    corrections = run.robot.estimator.flow.accumulated_correction
    corrections[0], corrections[1], corrections[2] = 0.3, -0.2, 0.1
    run.inputs.pose.x, run.inputs.pose.y, run.inputs.pose.theta = 1.0, 2.0, 0.5
    run.inputs.events |= lib.OMNI_EVENT_SET_POSE
    lib.hil_run_advance(run, 1)
    assert list(corrections) == [0.0, 0.0, 0.0]


ASKEW = tuple(each for each in flow_figures.SETTINGS if each.title.startswith("no fixes, mounted"))
ICE = tuple(each for each in flow_figures.SETTINGS if " ice " in each.title)


@pytest.mark.full
@pytest.mark.parametrize(
    "setting", [each for each in flow_figures.SETTINGS if each not in ASKEW + ICE], ids=lambda each: each.title
)
def test_it_is_better_and_as_sure_as_it_says(setting: flow_figures.Setting) -> None:
    seeds = range(8 if setting.gyro or "30 %" in setting.title else 3)
    short = replace(setting, seconds=20)
    old, new = (flow_figures.measure(short, seeds, flow) for flow in (False, True))
    assert new.rms_position < (0.6 if setting.title.startswith("no fixes") else 0.95) * old.rms_position
    assert new.rms_heading < 1.05 * old.rms_heading
    assert new.warned == 0
    if "scale" not in setting.title:  # an error that stays is not in the filter's picture
        assert float(np.mean(new.nees_position)) < 1.6
        assert float(np.mean(new.nees_heading)) < 1.6


@pytest.mark.full
@pytest.mark.parametrize("setting", ICE[:2], ids=lambda each: each.title)
def test_on_ice_a_sensor_that_has_been_right_leads(setting: flow_figures.Setting) -> None:
    """The fast robot's wheels spin for seconds, each time it is on the left half of the floor."""
    short = replace(setting, seconds=15)
    old, new = (flow_figures.measure(short, range(3), flow) for flow in (False, True))
    assert old.rms_position > 0.3
    assert new.rms_position < 0.025
    assert new.rms_heading < 0.03
    assert new.warned == 0
    assert float(np.mean(new.nees_position)) < 5.0


@pytest.mark.full
def test_the_robot_says_that_it_leads_on_ice_and_nowhere_else() -> None:
    run, _config = start_run(flow_figures.scenario_of(ICE[0], 2000, True), ICE[0].title)
    told = []
    for _ in range(15000):
        lib.hil_run_advance(run, 1)
        told.append((run.world.pose[0] < 0.02, bool(run.outputs.flow_overriding)))
    on_ice, leads = np.array(told).T
    assert leads[on_ice].mean() > 0.1
    assert not leads[~on_ice].any()


def test_on_ice_from_the_start_it_is_refused_and_said() -> None:
    """Nobody knows yet where it points. It does no harm to speak of beside what the wheels do."""
    short = replace(ICE[2], seconds=10)
    old, new = (flow_figures.measure(short, range(3), flow) for flow in (False, True))
    assert new.warned == 3
    assert new.rms_position < 1.6 * old.rms_position


@pytest.mark.full
@pytest.mark.parametrize("angle_rad", [0.2, 0.35, 0.45, 0.55, 0.8])
@pytest.mark.parametrize("world", [{}, {"slip_max": 0.3}, {"slip_max": 0.3, "slip_time_s": 0.5}], ids=str)
def test_one_that_points_elsewhere_costs_little_more_than_having_none(
    angle_rad: float, world: dict[str, float]
) -> None:
    askew = replace(ASKEW[-1], world=world, sensor={"flow_angle_rad": angle_rad}, seconds=40)
    old, new = (flow_figures.measure(askew, range(3), flow) for flow in (False, True))
    assert new.warned == 3
    assert new.rms_position < 1.6 * old.rms_position + 0.02
    assert new.rms_heading < 1.6 * old.rms_heading + 0.05


@pytest.mark.parametrize("angle_deg", [90.0, 180.0])
def test_a_mount_that_is_not_told_is_said_and_once_told_is_fine(angle_deg: float) -> None:
    scenario = replace(load_scenario("flow"), duration_s=8.0)
    scenario = replace(scenario, world={**scenario.world, "flow_angle_rad": math.radians(angle_deg)})
    wrong = run_in_process(scenario)
    right = run_in_process(replace(scenario, parameters={**scenario.parameters, "FLOW_ANGLE": angle_deg}))
    assert "floor motion" in faults_seen(wrong)[1]
    assert "floor motion" not in faults_seen(right)[1]
    for run, most in ((wrong, 0.01), (right, 0.005)):
        off = (run.record["estimate"] - run.record["truth"])[100:]
        assert np.hypot(off[:, 0], off[:, 1]).max() < most


@pytest.mark.full
@pytest.mark.parametrize("setting", flow_figures.SETTINGS[:1], ids=lambda each: each.title)
def test_the_page_says_what_the_figures_command_says(setting: flow_figures.Setting) -> None:
    page = (ROOT / "docs" / "guides" / "floor-motion.md").read_text(encoding="utf-8")
    assert flow_figures.row(setting, flow_figures.SEEDS) in page.splitlines()


@pytest.mark.nightly
@pytest.mark.parametrize("setting", flow_figures.SETTINGS[1:], ids=lambda each: each.title)
def test_the_page_says_all_that_the_figures_command_says(setting: flow_figures.Setting) -> None:
    test_the_page_says_what_the_figures_command_says(setting)


@pytest.mark.full
def test_eight_runs_at_once_give_the_bits_of_single_ones() -> None:
    """Among these one uses a reading that the others refuse; they used to count it as theirs."""
    assert_the_same_without_lanes(load_scenario("flow"), 41, 8)
