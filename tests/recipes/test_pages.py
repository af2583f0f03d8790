# SPDX-License-Identifier: MIT
"""The pages of docs/how-to-add, followed word by word in a copy of the repository: what each costs, and that it works.

All of them are followed in one copy, so that it is built once.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.recipes import board, controller, gyro_chip, message, motor_driver, parameter, plant, sensor, trajectory
from tests.recipes.recipe import PAGES, Edit, Scratch, read_page

FILES = {
    "parameter": 2,
    "message": 2,
    "controller": 3,
    "trajectory": 3,
    "plant": 3,
    "sensor": 5,
    "motor-driver": 2,
    "gyro-chip": 5,
    "board": 2,
}
"""How many files, docs and tests apart, an extension may cost at most."""
CHECKS: dict[str, Callable[[Scratch], None]] = {
    "parameter": parameter.check,
    "message": message.check,
    "controller": controller.check,
    "trajectory": trajectory.check,
    "plant": plant.check,
    "sensor": sensor.check,
    "motor-driver": motor_driver.check,
    "gyro-chip": gyro_chip.check,
    "board": board.check,
}


def steps(page: str) -> list[Edit]:
    edits = read_page((PAGES / f"{page}.md").read_text(encoding="utf-8"))
    # The page about messages also shows what a program of the host's could do with one.
    return [edit for edit in edits if edit.path.startswith("shared/")] if page == "message" else edits


@pytest.mark.full
def test_each_page_costs_few_files_and_what_they_add_works(tmp_path: Path) -> None:
    copy = Scratch(tmp_path / "copy")
    for page, most in FILES.items():
        edits = steps(page)
        copy.follow(edits)
        touched = {edit.path for edit in edits if not edit.path.startswith(("docs/", "tests/"))}
        assert 0 < len(touched) <= most, (page, touched)
        if page == "board":
            assert len({Path(path).parent for path in touched}) == 1, touched
    assert set(copy.touched()) == {
        edit.path for page in FILES for edit in steps(page) if not edit.path.startswith(("docs/", "tests/"))
    }
    for check in CHECKS.values():
        check(copy)
