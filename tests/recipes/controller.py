# SPDX-License-Identifier: MIT
"""docs/how-to-add/controller.md, followed word by word, gives a controller that drives."""

from __future__ import annotations

from tests.recipes.recipe import Scratch

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


def check(copy: Scratch) -> None:
    """Drive with it."""
    run = copy.drive(SCENARIO)
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
