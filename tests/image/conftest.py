# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel.robots import read_robot
from tests.image import flashed
from tests.needs import need

if TYPE_CHECKING:  # these need the emulator, which other tests of this folder do without
    from emulated_teensy.image_file import Image
    from tests.image.assembly import Program
    from tests.image.chip import Chip

WorldMaker = Callable[..., World]


@pytest.fixture(scope="session")
def image() -> Path:
    """Path of the image that `make firmware` linked; skips without it."""
    need("image")
    return flashed.image_path()


@pytest.fixture(scope="session")
def flashed_image(image: Path) -> Image:
    """The same, read."""
    from emulated_teensy.image_file import read_image

    return read_image(image)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """A program that waits in RAM."""
    from tests.image.chip import parked_program

    return parked_program(tmp_path_factory.mktemp("parked"))


@pytest.fixture
def chip(program: Program) -> Iterator[Chip]:
    """A chip that waits in RAM, nothing wired to it."""
    from tests.image.chip import parked

    with parked(program) as chip:
        yield chip


@pytest.fixture(scope="session")
def make_world() -> WorldMaker:
    """Build a world of a robot, without a pose sensor."""

    def make(robot: str = "three_wheel", **options: Any) -> World:
        return World(world_config(read_robot(robot), pose_sensor=NO_POSE_SENSOR, **options))

    return make
