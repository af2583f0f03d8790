# SPDX-License-Identifier: MIT
"""What a link counts as errors, and how much it may send outside of the loop and in it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import EMERGENCY, HEARTBEAT, RADIO, USB, FakeRobot, command, frame


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().ready()
    yield one
    one.close()


def errors(robot: FakeRobot) -> list[int]:
    robot.look()
    robot.said[USB].clear()
    robot.send(USB, command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_OMNI_HEALTH))
    robot.background()
    robot.look()
    health = [message for message in robot.said[USB] if message.get_type() == "OMNI_HEALTH"][-1]
    return list(health.link_rx_errors)


def test_bytes_of_lines_that_were_asked_for_are_no_errors_and_others_are(robot: FakeRobot) -> None:
    line = b"0.1,-0.2,3e-1*\r\n"
    robot.send(RADIO, line)
    robot.tick(5)
    assert errors(robot) == [0, len(line), 0, 0]
    robot.send(USB, frame("param_set", 1, 1, b"LINK2_LEGACY", 1.0, mav.MAV_PARAM_TYPE_REAL32))
    robot.tick(5)
    robot.send(RADIO, line, line, HEARTBEAT)
    robot.tick(5)
    assert errors(robot) == [0, len(line), 0, 0]
    robot.send(RADIO, b"#!?")
    robot.tick(5)
    assert errors(robot) == [0, len(line) + 3, 0, 0]


def listed(robot: FakeRobot) -> int:
    """Return how many of the parameters come over the radio at once."""
    robot.look()
    robot.said[RADIO].clear()
    robot.send(RADIO, frame("param_request_list", 1, 1))
    for _ in range(60):
        robot.background()
        robot.look()
    return len([message for message in robot.said[RADIO] if message.get_type() == "PARAM_VALUE"])


def test_in_the_loop_no_line_is_slow(robot: FakeRobot) -> None:
    """Simulated time goes as fast as the host's answers come: no budget of real seconds holds it up."""
    outside = listed(robot)
    robot.in_loop(USB, drive=False)
    inside = listed(robot)
    assert 0 < outside < inside / 2


def test_in_lockstep_a_link_has_no_budget() -> None:
    """Time stands still between ticks: what waited for it would never come."""
    robot = FakeRobot(lockstep=True)
    robot.send(USB, frame("param_request_list", 1, 1))
    for _ in range(50):
        robot.background()
        robot.look()
    values = [message for message in robot.said[USB] if message.get_type() == "PARAM_VALUE"]
    assert len(values) == values[0].param_count
    robot.close()


def test_the_answer_to_a_stop_does_not_wait_for_its_turn_on_the_line(robot: FakeRobot) -> None:
    listed(robot)  # what the line may carry in this moment is spent
    assert robot.ask(RADIO, EMERGENCY) == mav.MAV_RESULT_ACCEPTED
