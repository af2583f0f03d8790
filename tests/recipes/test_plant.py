# SPDX-License-Identifier: MIT
"""docs/how-to-add/plant.md, followed word by word, gives a plant that the robot drives on."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recipes.recipe import PAGES, Scratch, read_page

SCENARIO = """
[scenario]
name = "recipe"
description = "a circle on the new plant"
robot = "three_wheel"
seed = 1
duration_s = 8.0

[parameters]
TRJ_TYPE = "circle"
TRJ_SIZE = 0.3
TRJ_PERIOD = 10.0
EKF_MODE = "odometry"

[world]
plant = "smooth"

[[event]]
at_s = 0.5
command = "trajectory_start"

[[event]]
at_s = 0.5
command = "arm"
"""


@pytest.mark.slow
def test_two_files_make_a_plant_that_the_robot_drives_on(tmp_path: Path) -> None:
    copy = Scratch(tmp_path / "copy")
    copy.follow(read_page((PAGES / "plant.md").read_text()))
    assert copy.touched() == ["hil_sim/src/plant_smooth.c", "shared/world.toml"]
    run = copy.drive(SCENARIO)
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
