# SPDX-License-Identifier: MIT
"""docs/how-to-add/plant.md, followed word by word, gives a plant that the robot drives on."""

from __future__ import annotations

from tests.recipes.drive import drive, scenario
from tests.recipes.recipe import Scratch


def check(copy: Scratch) -> None:
    """Drive on it."""
    run = drive(copy, scenario(more='[world]\nplant = "smooth"'))
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
