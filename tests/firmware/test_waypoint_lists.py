# SPDX-License-Identifier: MIT
"""A list of waypoints is that of the station that began it: nobody drives a mixture of two."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import ARM, HEARTBEAT, RADIO, USB, FakeRobot, command

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
WAYPOINTS = (mav.MAV_CMD_OMNI_TRAJECTORY_START, 1.0, 1.0)
OTHER = 254


def point(number: int, x: float, y: float = 0.0, **sender: int) -> bytes:
    return command(mav.MAV_CMD_OMNI_WAYPOINT, float(number), x, y, 0.0, **sender)


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    made = FakeRobot().ready()
    yield made
    made.close()


WHERE = [(USB, {"system": OTHER}), (RADIO, {})]


@pytest.mark.parametrize(("port", "sender"), WHERE, ids=["another station on the link", "another link"])
def test_who_goes_on_with_the_list_of_another_is_refused(robot: FakeRobot, port: int, sender: dict[str, int]) -> None:
    robot.armed()
    for number in range(2):
        assert robot.ask(USB, point(number, 0.3 * number)) == ACCEPTED
    for number in (1, 2):
        assert robot.ask(port, point(number, 0.1, **sender)) == DENIED
    assert robot.ask(port, command(*WAYPOINTS, **sender)) == DENIED
    assert robot.ask(USB, command(*WAYPOINTS)) == ACCEPTED, "its own list is as it was"


@pytest.mark.parametrize(("port", "sender"), WHERE, ids=["another station on the link", "another link"])
def test_another_list_takes_the_place_of_the_first_as_a_whole(
    robot: FakeRobot, port: int, sender: dict[str, int]
) -> None:
    robot.armed()
    for number in range(2):
        assert robot.ask(USB, point(number, 0.3 * number)) == ACCEPTED
    for number in range(2):
        assert robot.ask(port, point(number, 0.0, -0.3 * number, **sender)) == ACCEPTED
    assert robot.ask(USB, point(2, 0.3, 0.3)) == DENIED
    assert robot.ask(USB, command(*WAYPOINTS)) == DENIED
    for number in range(2):
        assert robot.ask(USB, point(number, 0.3 * number)) == ACCEPTED
    assert robot.ask(USB, command(*WAYPOINTS)) == ACCEPTED


def test_a_path_that_waits_does_not_start_with_the_points_of_another(robot: FakeRobot) -> None:
    for number in range(2):
        assert robot.ask(USB, point(number, 0.3 * number)) == ACCEPTED
    assert robot.ask(USB, command(*WAYPOINTS)) == ACCEPTED
    for number in range(2):
        assert robot.ask(RADIO, point(number, 0.0, -0.3 * number)) == ACCEPTED
    robot.send(USB, HEARTBEAT)
    assert robot.ask(USB, ARM) == ACCEPTED
    robot.tick(20)
    assert robot.asked("OMNI_TRACKING").phase == 0


def test_a_list_ends_with_the_session_of_its_link(robot: FakeRobot) -> None:
    for number in range(2):
        assert robot.ask(USB, point(number, 0.3 * number)) == ACCEPTED
    robot.port(USB, connection=2)
    robot.tick()
    assert robot.ask(USB, point(2, 0.3)) == DENIED
    robot.armed()
    assert robot.ask(USB, command(*WAYPOINTS)) == DENIED


def test_other_paths_need_no_list(robot: FakeRobot) -> None:
    robot.armed()
    assert robot.ask(RADIO, point(0, 0.1)) == ACCEPTED
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 3.0, 1.0)) == ACCEPTED
