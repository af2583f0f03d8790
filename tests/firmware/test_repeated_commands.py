# SPDX-License-Identifier: MIT
"""A command whose answer got lost comes again: it is not executed twice, and never undoes a stop that came since."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import ARM as NOW_ARM
from tests.firmware.fake_robot import DISARM, EMERGENCY, HEARTBEAT, RELEASE, USB, FakeRobot, frame
from tests.firmware.test_trial import BEGIN, KEEP, TRIAL

ARM, ESTOP = mav.MAV_CMD_COMPONENT_ARM_DISARM, mav.MAV_CMD_OMNI_ESTOP
TERMINATE, START = mav.MAV_CMD_DO_FLIGHTTERMINATION, mav.MAV_CMD_OMNI_TRAJECTORY_START
REQUEST = mav.MAV_CMD_REQUEST_MESSAGE
ACCEPTED, DENIED, BUSY = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED, mav.MAV_RESULT_TEMPORARILY_REJECTED
CIRCLE = 3.0
"""A TRJ_TYPE."""
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
    return asking(robot)


def asking(robot: FakeRobot) -> Ask:
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


def mode(robot: FakeRobot) -> int:
    """Return what the robot follows, an OMNI_MODE."""
    return int(robot.asked("HEARTBEAT", WATCHER).custom_mode) & 0xFFFF


def reference_speed(robot: FakeRobot) -> float:
    return math.hypot(*robot.asked("OMNI_TRACKING", WATCHER).reference_rate[:2])


def test_what_is_kept_may_be_kept_again(ask: Ask) -> None:
    assert ask(TRIAL, BEGIN, 1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2) == ACCEPTED
    assert ask(TRIAL, KEEP, 2, confirmation=1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2, confirmation=9) == ACCEPTED


def test_only_the_very_same_command_of_the_same_sender_was_done(ask: Ask) -> None:
    assert ask(TRIAL, BEGIN, 1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2) == ACCEPTED
    assert ask(TRIAL, KEEP, 2, confirmation=1, system=OTHER) == DENIED
    assert ask(TRIAL, KEEP, 2, confirmation=1) == ACCEPTED


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
    assert ask(ARM, 1.0, 1, confirmation=1) == DENIED
    assert robot.state(WATCHER) == 1
    assert ask(ARM, 1.0, 2) == ACCEPTED
    assert robot.state(WATCHER) == 2


Stops = dict[str, list[tuple[int, float]]]
STOPS: Stops = {"disarm": [(ARM, 0.0)], "emergency": [(ESTOP, 1.0), (ESTOP, 0.0)], "terminate": [(TERMINATE, 1.0)]}
HOLDS: Stops = {
    "hold": [(mav.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0)],
    "mode": [(mav.MAV_CMD_DO_SET_MODE, 1.0)],
    "excite": [(mav.MAV_CMD_OMNI_EXCITE, 0.0)],
}


@pytest.mark.parametrize("known", [True, False], ids=["answer lost", "command lost"])
@pytest.mark.parametrize("name", STOPS)
def test_a_repeated_arm_does_not_undo_the_stop_of_another_station_on_its_link(
    name: str, known: bool, robot: FakeRobot, ask: Ask
) -> None:
    if known:
        assert ask(ARM, 1.0, 1) == ACCEPTED
    for number, (command, first) in enumerate(STOPS[name], 50):
        assert ask(command, first, number, system=OTHER) == ACCEPTED
    before = robot.state(WATCHER)
    for confirmation in (1, 2, 9):
        assert ask(ARM, 1.0, 1, confirmation) == DENIED
        assert robot.state(WATCHER) == before
    if before == 4:
        assert ask(ESTOP, 0.0, 2) == ACCEPTED
    assert ask(ARM, 1.0, 3) == ACCEPTED
    assert robot.state(WATCHER) == 2


@pytest.mark.parametrize("known", [True, False], ids=["answer lost", "command lost"])
def test_a_repeated_release_does_not_undo_a_newer_emergency_stop(known: bool, robot: FakeRobot, ask: Ask) -> None:
    assert ask(ESTOP, 1.0, 6, system=OTHER) == ACCEPTED
    if known:
        assert ask(ESTOP, 0.0, 40) == ACCEPTED
    assert ask(ESTOP, 1.0, 7, system=OTHER) == ACCEPTED
    assert ask(ESTOP, 0.0, 40, confirmation=1) == DENIED
    assert robot.state(WATCHER) == 4
    assert ask(ESTOP, 0.0, 41) == ACCEPTED
    assert robot.state(WATCHER) == 1


@pytest.mark.parametrize("known", [True, False], ids=["answer lost", "command lost"])
@pytest.mark.parametrize("name", HOLDS)
def test_a_repeated_start_does_not_undo_a_hold(name: str, known: bool, robot: FakeRobot, ask: Ask) -> None:
    assert ask(ARM, 1.0, 1) == ACCEPTED
    if known:
        assert ask(START, CIRCLE, 2) == ACCEPTED
        assert mode(robot) == mav.OMNI_MODE_TRAJECTORY
    for command, first in HOLDS[name]:
        assert ask(command, first, 50, system=OTHER) == ACCEPTED
    held = mode(robot)
    assert ask(START, CIRCLE, 2, confirmation=1) == DENIED
    assert mode(robot) == held
    assert ask(START, CIRCLE, 3) == ACCEPTED
    assert mode(robot) == mav.OMNI_MODE_TRAJECTORY


def test_the_message_that_sets_a_mode_holds_as_the_command_does(robot: FakeRobot, ask: Ask) -> None:
    assert ask(ARM, 1.0, 1) == ACCEPTED
    assert ask(START, CIRCLE, 2) == ACCEPTED
    robot.send(USB + 1, frame("set_mode", 1, 1, 0, system=OTHER))
    robot.tick(3)
    assert ask(START, CIRCLE, 2, confirmation=1) == DENIED
    assert mode(robot) == mav.OMNI_MODE_HOLD


def test_an_arm_command_that_is_tried_again_and_again_ends_with_a_stop() -> None:
    """While it starts up a robot rejects it for the time being, and its sender tries again."""
    fresh = FakeRobot()
    fresh.send(USB, HEARTBEAT)
    fresh.tick(2)
    ask_fresh = asking(fresh)
    assert ask_fresh(ARM, 1.0, 1) == BUSY
    assert ask_fresh(ARM, 0.0, 50, system=OTHER) == ACCEPTED
    fresh.tick(1500)
    assert ask_fresh(ARM, 1.0, 1, confirmation=1) == DENIED
    assert fresh.state(WATCHER) == 1
    assert ask_fresh(ARM, 1.0, 2) == ACCEPTED
    fresh.close()


def test_a_robot_that_was_busy_arms_at_a_repetition_if_no_stop_came() -> None:
    fresh = FakeRobot()
    fresh.send(USB, HEARTBEAT)
    fresh.tick(2)
    ask_fresh = asking(fresh)
    assert ask_fresh(ARM, 1.0, 1) == BUSY
    fresh.tick(1500)
    assert ask_fresh(ARM, 1.0, 1, confirmation=1) == ACCEPTED
    assert fresh.state(WATCHER) == 2
    fresh.close()


def test_an_arm_command_whose_first_copy_was_lost_arms(robot: FakeRobot, ask: Ask) -> None:
    assert ask(ARM, 1.0, 1, confirmation=1) == ACCEPTED
    assert robot.state(WATCHER) == 2
    # Its own stop came before: its messages come in the order in which they were sent.
    assert ask(ARM, 0.0, 2) == ACCEPTED
    assert ask(ARM, 1.0, 3, confirmation=1) == ACCEPTED
    assert robot.state(WATCHER) == 2


def test_a_stop_from_long_before_overtakes_nothing(robot: FakeRobot, ask: Ask) -> None:
    assert ask(ARM, 0.0, 50, system=OTHER) == ACCEPTED
    robot.tick(14_900)
    assert ask(ARM, 1.0, 1, confirmation=1) == DENIED
    robot.tick(200)
    assert ask(ARM, 1.0, 1, confirmation=2) == DENIED, "it is known now: it is the one from before the stop"
    assert ask(ARM, 1.0, 2, confirmation=1) == ACCEPTED
    assert robot.state(WATCHER) == 2


@pytest.mark.parametrize("confirmation", [0, 1])
def test_a_plain_station_arms_after_a_stop_without_numbers(confirmation: int, robot: FakeRobot, ask: Ask) -> None:
    """Some, such as MAVROS, always say 1."""
    assert ask(ARM, 0.0, 0, system=OTHER) == ACCEPTED
    assert ask(ARM, 1.0, 0, confirmation) == ACCEPTED
    assert robot.state(WATCHER) == 2


def test_a_path_is_not_begun_twice_whatever_others_ask_meanwhile(robot: FakeRobot, ask: Ask) -> None:
    assert ask(ARM, 1.0, 1) == ACCEPTED
    assert ask(START, CIRCLE, 2) == ACCEPTED
    for number in range(1, 101):
        ask(REQUEST, 1.0, number, system=OTHER)
        robot.tick(20)
    speed = reference_speed(robot)
    assert speed > 0.02
    assert ask(START, CIRCLE, 2, confirmation=1) == ACCEPTED
    assert reference_speed(robot) >= speed, "a path that begins anew begins slowly"


def test_the_eight_latest_commands_of_a_sender_are_remembered(ask: Ask) -> None:
    assert ask(TRIAL, BEGIN, 1) == ACCEPTED
    assert ask(TRIAL, KEEP, 2) == ACCEPTED
    for number in range(3, 10):
        ask(REQUEST, 1.0, number)
    assert ask(TRIAL, KEEP, 2, confirmation=1) == ACCEPTED
    for number in range(10, 18):
        ask(REQUEST, 1.0, number)
    assert ask(TRIAL, KEEP, 2, confirmation=2) == DENIED, "executed again: no trial goes on"


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
