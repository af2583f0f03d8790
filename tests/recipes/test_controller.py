# SPDX-License-Identifier: MIT
"""docs/how-to-add/controller.md, followed word by word, gives a controller that drives."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.recipes.recipe import PAGES, Scratch, read_page

SCENARIO = """
[scenario]
name = "recipe"
description = "a circle with the new controller"
robot = "three_wheel"
seed = 1
duration_s = 8.0

[parameters]
CTL_MODE = "straight"
TRJ_TYPE = "circle"
TRJ_SIZE = 0.3
TRJ_PERIOD = 10.0
EKF_MODE = "odometry"

[[event]]
at_s = 0.5
command = "trajectory_start"

[[event]]
at_s = 0.5
command = "arm"
"""


@pytest.mark.slow
def test_three_files_make_a_controller_that_drives(tmp_path: Path) -> None:
    copy = Scratch(tmp_path / "copy")
    copy.follow(read_page((PAGES / "controller.md").read_text()))
    assert len(copy.touched()) == 3, copy.touched()
    run = copy.drive(SCENARIO)
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
