# SPDX-License-Identifier: MIT
"""A robot on a cable, a hub on it, and a folder of this test's own where programs find each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from omniwheel.robot import connect
from tests.hub.parts import Cable, omni


@pytest.fixture
def own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no other program's hub be found, and no other program find one of these."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


@pytest.fixture(scope="module")
def running_robot() -> Iterator[tuple[list[str], dict[str, float]]]:
    """Run a robot in its world with two links, as `omni sitl` does; return them and the robot's parameters."""
    with omni("sitl", "--link", "tcp:127.0.0.1:0", "--link", "tcp:127.0.0.1:0", "--json") as (_, ready):
        with connect(ready["links"][1]) as robot:
            parameters = robot.parameters.download()
        yield ready["links"], parameters


@pytest.fixture
def robot_urls(running_robot: tuple[list[str], dict[str, float]]) -> Iterator[list[str]]:
    """Both links of a robot that is as it was when it started."""
    urls, parameters = running_robot
    yield urls
    with connect(urls[1]) as robot:
        robot.disarm()
        robot.estop_clear()
        robot.parameters.download()
        robot.parameters.set_many({name: old for name, (_, old) in robot.parameters.diff(parameters).items()})


@pytest.fixture
def cable(own_places: None, robot_urls: list[str], tmp_path: Path) -> Iterator[Cable]:
    """The first link of the robot behind a cable."""
    cable = Cable(robot_urls[0], tmp_path / "robot")
    yield cable
    cable.close()


@pytest.fixture
def hub_url(cable: Cable) -> Iterator[str]:
    """A hub as `omni link` starts it, and where it listens."""
    with omni("link", "--link", str(cable.path), "--listen", "tcp:127.0.0.1:0", "--json") as (_, ready):
        yield ready["listen"][0]
