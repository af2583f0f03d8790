# SPDX-License-Identifier: MIT
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omni_schema import Robot, load_parameters, load_robot

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
    """Build a world of a robot by name or object, without a pose sensor unless one is given."""

    def make(robot: str | Robot = "three_wheel", **options: Any) -> World:
        options.setdefault("pose_sensor", NO_POSE_SENSOR)
        return World(world_config(robots[robot] if isinstance(robot, str) else robot, **options))

    return make
