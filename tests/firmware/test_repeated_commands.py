# SPDX-License-Identifier: MIT
"""A command whose answer got lost comes again. It is answered again, and not done twice."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import ARM as NOW_ARM
from tests.firmware.fake_robot import DISARM, EMERGENCY, HEARTBEAT, RELEASE, USB, FakeRobot, frame
from tests.firmware.test_trial import BEGIN, KEEP, TRIAL

ARM, ESTOP = mav.MAV_CMD_COMPONENT_ARM_DISARM, mav.MAV_CMD_OMNI_ESTOP
ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
OTHER = 7
"""System of another ground station on the same link."""
WATCHER = USB + 2
"""A link of its own: asking for the state is a command, too."""
Ask = Callable[..., int]


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    made = FakeRobot()
    made.send(USB, HEARTBEAT)
    made.tick(1500)
    yield made
    made.close()


@pytest.fixture
def ask(robot: FakeRobot) -> Ask:
    """Return what sends a numbered command for the n-th time and returns the result."""

    def send(command: int, first: float, number: int, confirmation: int = 0, system: int = 255) -> int:
        params = (first, 0.0, 0.0, 0.0, float(number), 0.0, 0.0)
        robot.look()
        robot.said[USB].clear()
        robot.send(USB, HEARTBEAT, frame("command_long", 1, 1, command, confirmation, *params, system=system))
        robot.tick(3)
        robot.look()
        acks = [entry for entry in robot.said[USB] if entry.get_type() == "COMMAND_ACK"]
        assert [ack.command for ack in acks] == [command]
        return int(acks[0].result)

    return send


def test_what_is_kept_may_be_kept_again(ask: Ask) -> None:
    assert ask(TRIAL, BEGIN, 1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2) == ACCEPTED
    assert ask(TRIAL, KEEP, 2, confirmation=1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2, confirmation=9) == ACCEPTED


def test_only_the_very_same_command_of_the_same_sender_was_done(ask: Ask) -> None:
    assert ask(TRIAL, BEGIN, 1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2) == ACCEPTED
    assert ask(TRIAL, KEEP, 2, confirmation=1, system=OTHER) == DENIED
    assert ask(TRIAL, KEEP, 2, confirmation=1) == DENIED  # another sender's command came meanwhile


@pytest.mark.parametrize(("number", "confirmation"), [(3, 1), (2, 0), (0, 1)])
def test_another_number_or_a_first_time_is_another_command(number: int, confirmation: int, ask: Ask) -> None:
    assert ask(TRIAL, BEGIN, 1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2) == ACCEPTED
    assert ask(TRIAL, KEEP, number, confirmation) == DENIED


def test_what_was_refused_is_tried_again(ask: Ask) -> None:
    assert ask(TRIAL, KEEP, 1) == DENIED
    assert ask(TRIAL, KEEP, 1, confirmation=1) == DENIED
    assert ask(TRIAL, BEGIN, 2) == ACCEPTED
    assert ask(TRIAL, BEGIN, 2, confirmation=1) == ACCEPTED


@pytest.mark.parametrize("stop", [[DISARM], [EMERGENCY, RELEASE]], ids=["disarm", "emergency"])
def test_an_old_command_to_arm_does_not_arm_after_a_stop(stop: list[bytes], robot: FakeRobot, ask: Ask) -> None:
    """The stop came from elsewhere; the repeated command was on its way."""
    assert ask(ARM, 1.0, 1) == ACCEPTED
    assert robot.state(WATCHER) == 2
    for part in stop:
        robot.send(USB + 1, part)
        robot.tick(5)
    assert robot.state(WATCHER) == 1
    assert ask(ARM, 1.0, 1, confirmation=1) == ACCEPTED
    assert robot.state(WATCHER) == 1
    assert ask(ARM, 1.0, 2) == ACCEPTED
    assert robot.state(WATCHER) == 2


@pytest.mark.parametrize(("command", "first", "state"), [(ARM, 0.0, 1), (ESTOP, 1.0, 4)])
def test_a_stop_is_done_every_time(command: int, first: float, state: int, robot: FakeRobot, ask: Ask) -> None:
    assert ask(ARM, 1.0, 1) == ACCEPTED
    assert ask(command, first, 2) == ACCEPTED
    for part in (HEARTBEAT, RELEASE, NOW_ARM):
        robot.send(USB + 1, part)
        robot.tick(5)
    assert robot.state(WATCHER) == 2
    assert ask(command, first, 2, confirmation=1) == ACCEPTED
    assert robot.state(WATCHER) == state
