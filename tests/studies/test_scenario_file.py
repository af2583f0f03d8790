# SPDX-License-Identifier: MIT
"""A written scenario reads back as the same one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from hil_sim.scenario import Scenario, load_scenario, scenario_names
from hil_sim.scenario_file import write_scenario
from omniwheel.robots import new_robot_file


def same(written: Scenario, original: Scenario) -> bool:
    return replace(written, source="", robot=original.robot, world_robot=original.world_robot) == replace(
        original, source=""
    )


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_of_the_package(name: str, tmp_path: Path) -> None:
    original = load_scenario(name).with_seed(2**53 + 1).with_world({"slip_max": 0.1})
    write_scenario(original, tmp_path / "copy.toml", "a copy")
    written = load_scenario(tmp_path / "copy.toml")
    assert same(written, original)
    assert written.robot == original.robot


def test_a_robot_of_the_users_own_comes_along(tmp_path: Path) -> None:
    home, other = tmp_path / "home", tmp_path / "other"
    home.mkdir()
    other.mkdir()
    robot = new_robot_file("mine", "four_wheel", home)
    original = load_scenario("four_wheel", robot=str(robot), world_robot=str(robot))
    write_scenario(original, other / "copy.toml", "a copy")
    robot.unlink()
    written = load_scenario(other / "copy.toml")
    assert written.robot.name == "mine"
    assert same(written, original)
    assert replace(written.robot, source="") == replace(original.robot, source="")
