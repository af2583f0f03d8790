# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from hil_sim.world import IDEAL_WHEELS, NO_POSE_SENSOR, World, world_config
from omni_schema import Robot, load_parameters, load_robot
from tests.firmware.client import load_dialect
from tests.hil_sim.echo_robot import Bench

SHARED = Path(__file__).parents[2] / "shared"

WorldMaker = Callable[..., World]


@pytest.fixture(scope="session")
def robots() -> dict[str, Robot]:
    """The robot files of the repository by name."""
    table = load_parameters(SHARED / "params.toml")
    return {path.stem: load_robot(path, table) for path in (SHARED / "robots").glob("*.toml")}


@pytest.fixture(params=["three_wheel", "four_wheel"])
def any_robot(request: pytest.FixtureRequest, robots: dict[str, Robot]) -> Robot:
    return robots[request.param]


@pytest.fixture
def make_world(robots: dict[str, Robot]) -> WorldMaker:
    """Build a world of a robot by name or object: no pose sensor and ideal wheels unless others are given."""

    def make(robot: str | Robot = "three_wheel", **options: Any) -> World:
        numbers = {"pose_sensor": NO_POSE_SENSOR, **IDEAL_WHEELS, **options}
        return World(world_config(robots[robot] if isinstance(robot, str) else robot, **numbers))

    return make


@pytest.fixture(scope="session")
def dialect() -> ModuleType:
    """The generated dialect, loaded from its file."""
    return load_dialect()


@pytest.fixture(params=["looks", "asleep"])
def bench(dialect: ModuleType, request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Both ends of a lockstep link, which waits in either way."""
    made = Bench(dialect, looks=request.param == "looks")
    yield made
    made.close()
