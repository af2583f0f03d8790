# SPDX-License-Identifier: MIT
"""Sensors that a robot file names are in the simulated world, as the file says that they are."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import world_config
from omniwheel._core import lib
from omniwheel.robots import read_robot

SENSORS = """
[gyro]
chip = "ICM-42688-P"
axis = -3

[flow]
chip = "OTOS"
"""
PLACE = "FLOW_X = 0.05\nFLOW_Y = -0.02\nFLOW_ANGLE = 90.0\nFLOW_SCALE = 1.05\nGYRO_SCALE = 0.98\n"


def file_with(path: Path, sections: str, parameters: str = "") -> str:
    """Write a copy of the fast robot's file with more in it."""
    text = Path(read_robot("fast_three_wheel").source).read_text()
    assert text.count("[parameters]\n") == 1
    path.write_text(text.replace("[parameters]\n", f"[parameters]\n{parameters}") + sections)
    return str(path)


def seen_with(scenario: Scenario, robot: str) -> int:
    """Return the warnings of a short run."""
    run = run_in_process(replace(scenario, robot=read_robot(robot), duration_s=8.0))
    return int(run.record["faults"][500:].max()) & int(lib.OMNI_WARN_MASK)


def test_the_world_has_what_the_file_names(tmp_path: Path) -> None:
    robot = read_robot(file_with(tmp_path / "mine.toml", SENSORS, PLACE))
    config = world_config(robot)
    assert (config.gyro_rate_Hz, config.gyro_axis, config.flow_rate_Hz) == (1000.0, -3, 50.0)
    assert config.gyro_noise_density == pytest.approx(math.radians(robot.table.gyro_chips["ICM-42688-P"].noise_dps))
    assert (config.flow_x_m, config.flow_y_m) == pytest.approx((0.05, -0.02))
    assert config.flow_angle_rad == pytest.approx(math.pi / 2)
    assert (1.0 + config.flow_scale_error) * 1.05 == pytest.approx(1.0)
    assert (1.0 + config.gyro_scale_error) * 0.98 == pytest.approx(1.0)


def test_a_pinpoint_has_the_steps_of_its_wheels(tmp_path: Path) -> None:
    wheels = '\n[flow]\nchip = "Pinpoint"\nsteps_per_mm = 20.0\n'
    config = world_config(read_robot(file_with(tmp_path / "mine.toml", wheels)))
    assert (config.flow_step_m, config.flow_turn_step_rad) == (5e-5, 0.0)


def test_what_a_scenario_says_counts_more(tmp_path: Path) -> None:
    robot = read_robot(file_with(tmp_path / "mine.toml", SENSORS))
    config = world_config(robot, flow_rate_Hz=0.0, gyro_rate_Hz=500.0)
    assert (config.flow_rate_Hz, config.gyro_rate_Hz) == (0.0, 500.0)


def test_a_robot_without_has_none() -> None:
    config = world_config(read_robot("fast_three_wheel"))
    assert (config.flow_rate_Hz, config.gyro_rate_Hz) == (0.0, 0.0)


def test_a_robot_file_with_sensors_drives_without_a_warning_of_them(tmp_path: Path) -> None:
    scenario = load_scenario("fast")
    with_sensors = seen_with(scenario, file_with(tmp_path / "mine.toml", SENSORS, PLACE))
    assert with_sensors & (lib.OMNI_WARN_GYRO | lib.OMNI_WARN_FLOW) == 0
