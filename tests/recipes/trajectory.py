# SPDX-License-Identifier: MIT
"""docs/how-to-add/trajectory.md, followed word by word, gives a path that the robot drives."""

from __future__ import annotations

from tests.recipes.recipe import Scratch

SCENARIO = """
[scenario]
name = "recipe"
description = "a lap of the new path"
robot = "three_wheel"
seed = 1
duration_s = "until_done"

[parameters]
TRJ_TYPE = "eight"
TRJ_SIZE = 0.3
TRJ_PERIOD = 12.0
TRJ_LAPS = 1.0
TRJ_ROT = "fixed"
EKF_MODE = "odometry"

[[event]]
at_s = 0.5
command = "trajectory_start"

[[event]]
at_s = 0.5
command = "arm"
"""


def check(copy: Scratch) -> None:
    """Drive it."""
    run = copy.drive(SCENARIO)
    assert run["done"]
    assert run["faults"] == []
    assert 0.29 < run["farthest_m"] < 0.31
    assert run["rmse_m"] < 0.005
