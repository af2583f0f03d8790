# SPDX-License-Identifier: MIT
"""docs/how-to-add/controller.md, followed word by word, gives a controller that drives, and a test that it passes."""

from __future__ import annotations

from tests.recipes.drive import CIRCLE, OWN_PACKAGES, drive, run_program, scenario
from tests.recipes.recipe import Scratch

_PYTEST = (
    OWN_PACKAGES
    + """
import pytest
folder, test = sys.argv[2:]
sys.exit(pytest.main([test, "-q", "-p", "no:cacheprovider", "--noconftest", "--rootdir", folder, "-c", "/dev/null"]))
"""
)


def check(copy: Scratch) -> None:
    """Drive with it, and run the page's test of it."""
    assert "1 passed" in run_program(copy, _PYTEST, str(copy.root), str(copy.root / "tests/core/test_straight.py"))
    run = drive(copy, scenario(f'{CIRCLE}\nCTL_MODE = "straight"'))
    assert run["faults"] == []
    assert run["farthest_m"] > 0.2
    assert run["rmse_m"] < 0.005
