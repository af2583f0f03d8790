# SPDX-License-Identifier: MIT
"""The pages of docs/how-to-add, followed word by word in a copy of the repository: what each costs, and that it works.

All of them are followed in one copy, so that it is built once, with the example of a controller outside the tree.
Somebody has added one of each kind there before.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.recipes import (
    board,
    controller,
    gyro_chip,
    message,
    motor_driver,
    out_of_tree,
    parameter,
    plant,
    sensor,
    trajectory,
)
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
OTHERS: dict[str, dict[str, str]] = {
    "parameter": {"MOT_K_SCALE": "MOT_K_OTHER"},
    "message": {"OMNI_SLIP": "OMNI_GRIP", '"Slip"': '"Grip"'},
    "controller": {"straight": "direct", "STRAIGHT": "DIRECT"},
    "trajectory": {"eight": "nine"},
    "plant": {"smooth": "sleek"},
    "sensor": {"spin": "whirl", "SPIN": "WHIRL"},
    "motor-driver": {"antiphase": "otherphase", "Antiphase": "Otherphase", "ANTIPHASE": "OTHERPHASE"},
    "gyro-chip": {"mpu6050": "mpu6051", "MPU6050": "MPU6051", "MPU-6050": "MPU-6051"},
}
"""Names of what somebody has added before. Of a parameter and a sensor that is what declares them, not their use."""
DECLARING = (
    "shared/params.toml",
    "shared/world.toml",
    "hil_sim/src/sensor_whirl.c",
    "firmware/boards/teensy40/whirl.cpp",
)
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


def additions_of_others() -> list[Edit]:
    """Return the steps of all pages for things of other names."""
    edits = [(page, edit.renamed(names)) for page, names in OTHERS.items() for edit in steps(page)]
    return [edit for page, edit in edits if page not in ("parameter", "sensor") or edit.path in DECLARING]


def steps(page: str) -> list[Edit]:
    edits = read_page((PAGES / f"{page}.md").read_text(encoding="utf-8"))
    # The page about messages also shows what a program of the host's could do with one.
    return [edit for edit in edits if edit.path.startswith("shared/")] if page == "message" else edits


@pytest.mark.full
@pytest.mark.timeout(900)
def test_each_page_costs_few_files_and_what_they_add_works(tmp_path: Path) -> None:
    copy = Scratch(tmp_path / "copy", controller=out_of_tree.copied_to(tmp_path))
    copy.follow(additions_of_others())
    copy.begin()
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
    for check in (*CHECKS.values(), out_of_tree.check):
        check(copy)
