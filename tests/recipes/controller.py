# SPDX-License-Identifier: MIT
"""docs/how-to-add/controller.md, followed word by word, gives a controller that drives."""

from __future__ import annotations

from tests.recipes.drive import CIRCLE, drive, scenario
from tests.recipes.recipe import Scratch


def check(copy: Scratch) -> None:
    """Drive with it."""
    run = drive(copy, scenario(f'{CIRCLE}\nCTL_MODE = "straight"'))
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
