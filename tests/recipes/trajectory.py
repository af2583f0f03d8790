# SPDX-License-Identifier: MIT
"""docs/how-to-add/trajectory.md, followed word by word, gives a path that the robot drives."""

from __future__ import annotations

from tests.recipes.drive import drive, scenario
from tests.recipes.recipe import Scratch

EIGHT = """\
TRJ_TYPE = "eight"
TRJ_PERIOD = 12.0
TRJ_LAPS = 1.0
TRJ_ROT = "fixed"
"""


def check(copy: Scratch) -> None:
    """Drive it."""
    run = drive(copy, scenario(EIGHT, duration='"until_done"'))
    assert run["done"]
    assert run["faults"] == []
    assert 0.29 < run["farthest_m"] < 0.31
    assert run["rmse_m"] < 0.005
