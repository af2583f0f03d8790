# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hil_sim.image_file import Image, read_image
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel.robots import read_robot
from tests.image import flashed
from tests.image.assembly import Program
from tests.image.chip import Chip, parked, parked_program

WorldMaker = Callable[..., World]


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
def image() -> Path:
    """Path of the image that `make firmware` linked; skips without it."""
    path = flashed.image_path()
    flashed.need(flashed.missing_image(path))
    return path


@pytest.fixture(scope="session")
def flashed_image(image: Path) -> Image:
    """The same, read."""
    return read_image(image)
