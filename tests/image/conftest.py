# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from hil_sim.image_file import Image, read_image
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel.robots import read_robot
from tests.image.assembly import Program
from tests.image.chip import Chip, parked, parked_program

WorldMaker = Callable[..., World]
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """A program that waits in RAM."""
    return parked_program(tmp_path_factory.mktemp("parked"))


@pytest.fixture
def chip(program: Program) -> Iterator[Chip]:
    """A chip that waits in RAM, nothing wired to it."""
    with parked(program) as chip:
        yield chip


@pytest.fixture(scope="session")
def make_world() -> WorldMaker:
    """Build a world of a robot, without a pose sensor."""

    def make(robot: str = "three_wheel", **options: object) -> World:
        return World(world_config(read_robot(robot), pose_sensor=NO_POSE_SENSOR, **options))

    return make


@pytest.fixture(scope="session")
def image() -> Image:
    """The image of the three-wheel robot, as ``make firmware`` leaves it; ``OMNI_TEST_IMAGE`` names another one."""
    path = Path(os.environ.get("OMNI_TEST_IMAGE", ROOT / ".pio" / "build" / "three_wheel" / "firmware.elf"))
    if not path.exists():
        message = f"there is no image {path}: make firmware builds it"
        if os.environ.get("CI") == "true":
            pytest.fail(message)
        pytest.skip(message)
    return read_image(path)
