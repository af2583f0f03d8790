# SPDX-License-Identifier: MIT
"""A host in the loop that falls silent, and who may end the loop: in simulated time, on every link."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    ARMED,
    DISARM,
    DISARMED,
    EMERGENCY,
    ESTOP,
    FAILSAFE,
    HEARTBEAT,
    HIL_OFF,
    HIL_ON,
    RADIO,
    REBOOT,
    RELEASE,
    TERMINATE,
    USB,
    FakeRobot,
    velocity,
)

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
TRY_AGAIN = mav.MAV_RESULT_TEMPORARILY_REJECTED
SILENCE_S = 10.0
STOP_SILENCE_S = 1.0
"""Of docs/reference/protocol.md."""
LEFT = "HIL left: no sensor messages"
STOPS = {"disarm": (DISARM, DISARMED), "estop": (EMERGENCY, ESTOP), "terminate": (TERMINATE, ESTOP)}


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot()
    yield one
    one.close()


def in_hil(robot: FakeRobot, port: int = USB) -> bool:
    robot.look()
    robot.said[port].clear()
    robot.tick(1100)
    robot.look()
    beats = [m.base_mode for m in robot.said[port] if m.get_type() == "HEARTBEAT"]
    return not beats or bool(beats[-1] & mav.MAV_MODE_FLAG_HIL_ENABLED)


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("silent_ms", [0, 5, 99, 500, 999, 5000])
@pytest.mark.parametrize("link", [USB, RADIO, 2])
def test_a_stop_over_any_link_is_done_although_the_host_has_fallen_silent(
    robot: FakeRobot, stop: str, silent_ms: int, link: int
) -> None:
    request, state = STOPS[stop]
    robot.in_loop(RADIO)
    robot.tick(silent_ms)
    assert robot.ask(link, request) == ACCEPTED
    assert not robot.driven(), "the motors themselves are off all the time"
    robot.tick(max(0, round(1000 * STOP_SILENCE_S) - silent_ms) + 2)
    assert robot.state(link) == state
    assert not robot.driven()
    assert not in_hil(robot)


@pytest.mark.parametrize("stop", STOPS)
def test_a_host_that_is_late_by_under_a_second_does_the_stop_and_keeps_the_loop(robot: FakeRobot, stop: str) -> None:
    request, state = STOPS[stop]
    robot.in_loop(RADIO)
    assert robot.ask(USB, request) == ACCEPTED
    robot.tick(round(1000 * STOP_SILENCE_S) - 20)
    robot.hil_tick(RADIO, 3)
    assert not robot.driven(hil=True)
    assert LEFT not in robot.texts(USB)
    assert robot.state() == state
    assert in_hil(robot)


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("link", [USB, RADIO, 2])
def test_with_a_host_that_ticks_a_stop_is_done_in_the_next_tick_and_the_loop_goes_on(
    robot: FakeRobot, stop: str, link: int
) -> None:
    request, state = STOPS[stop]
    robot.in_loop(RADIO)
    assert robot.ask(link, request) == ACCEPTED
    robot.hil_tick(RADIO)
    assert not robot.driven(hil=True)
    robot.hil_tick(RADIO, 500)
    assert robot.state(RADIO) == state
    assert robot.ask(RADIO, HIL_ON if stop == "disarm" else HIL_OFF) == ACCEPTED


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("world", [USB, RADIO, 2])
@pytest.mark.parametrize("link", [USB, RADIO, 2])
def test_a_stop_that_was_sent_before_the_sensors_acts_in_their_tick_whatever_links_both_use(
    robot: FakeRobot, stop: str, world: int, link: int
) -> None:
    robot.in_loop(world)
    robot.send(link, STOPS[stop][0])
    robot.hil_tick(world)
    assert not robot.driven(hil=True)


def test_a_silent_host_times_out_and_the_robot_serves_others(robot: FakeRobot) -> None:
    robot.in_loop(RADIO)
    robot.tick(round(1000 * SILENCE_S) - 100)
    assert LEFT not in robot.texts(USB)
    robot.tick(200)
    assert LEFT in robot.texts(USB)
    assert LEFT in robot.texts(RADIO)
    assert robot.state() == DISARMED
    assert not robot.driven()
    robot.driving(USB)


def test_a_host_that_never_sends_sensors_times_out(robot: FakeRobot) -> None:
    robot.ready()
    assert robot.ask(RADIO, HIL_ON) == ACCEPTED
    robot.tick(round(1000 * SILENCE_S) + 200)
    assert LEFT in robot.texts(USB)
    robot.driving(USB)


def test_a_host_that_is_slow_keeps_the_loop(robot: FakeRobot) -> None:
    robot.in_loop(RADIO, drive=False)
    for _ in range(5):
        robot.tick(round(900 * SILENCE_S))
        robot.hil_tick(RADIO)
    assert LEFT not in robot.texts(USB)
    assert in_hil(robot)


def test_in_lockstep_time_stands_still_and_a_host_may_think_for_a_day() -> None:
    robot = FakeRobot(lockstep=True)
    for _ in range(30):
        robot.send(USB, HEARTBEAT)
        robot.hil_tick(USB, timer=False)
    assert robot.ask(USB, ARM) == ACCEPTED
    robot.hil_tick(USB, 3, timer=False)
    robot.wait(86400.0)
    robot.background()
    robot.hil_tick(USB, 3, timer=False)
    assert robot.state() == ARMED
    robot.wait(86400.0)
    assert robot.ask(RADIO, EMERGENCY) == ACCEPTED
    robot.hil_tick(USB, timer=False)
    assert robot.state() == ESTOP
    robot.close()


@pytest.mark.parametrize("drive", [True, False])
@pytest.mark.parametrize("link", [USB, RADIO, 2])
@pytest.mark.parametrize("silent_ms", [0, 1000])
def test_leaving_the_loop_works_over_any_link_at_once(robot: FakeRobot, link: int, drive: bool, silent_ms: int) -> None:
    robot.in_loop(RADIO, drive=drive)
    robot.tick(silent_ms)
    assert robot.ask(link, HIL_OFF) == ACCEPTED
    robot.tick(3)
    assert not robot.driven()
    assert robot.state(link) == DISARMED
    assert not in_hil(robot)
    assert robot.ask(USB, REBOOT) == ACCEPTED
    assert robot.reboots


def test_leaving_what_was_not_entered_changes_nothing(robot: FakeRobot) -> None:
    robot.driving()
    assert robot.ask(RADIO, HIL_OFF) == ACCEPTED
    robot.tick(2)
    assert robot.state() == ARMED


def test_the_motors_themselves_rest_while_a_host_drives_its_own(robot: FakeRobot) -> None:
    robot.in_loop(RADIO)
    for _ in range(100):
        robot.hil_tick(RADIO)
        assert not robot.driven()
    assert robot.driven(hil=True)


@pytest.mark.parametrize("link", [USB, RADIO])
def test_the_loop_is_not_entered_while_the_motors_may_move_or_are_stopped_for_good(robot: FakeRobot, link: int) -> None:
    robot.driving()
    assert robot.ask(link, HIL_ON) == DENIED
    robot.tick(600)
    assert robot.state() == FAILSAFE, "the set-points have stopped"
    assert robot.ask(link, HIL_ON) == DENIED
    assert robot.ask(link, EMERGENCY) == ACCEPTED
    assert robot.ask(link, HIL_ON) == TRY_AGAIN, "the stop is on its way"
    robot.tick(3)
    assert robot.ask(link, HIL_ON) == DENIED
    assert "HIL: release the emergency stop first" in robot.texts(link)
    assert robot.state() == ESTOP
    assert robot.ask(link, RELEASE) == ACCEPTED
    robot.tick(3)
    assert robot.ask(link, HIL_ON) == ACCEPTED


def test_the_loop_is_not_entered_over_an_arming_that_is_on_its_way(robot: FakeRobot) -> None:
    robot.ready()
    assert robot.ask(USB, ARM) == ACCEPTED
    assert robot.ask(RADIO, HIL_ON) == DENIED


def test_another_link_does_not_take_the_loop_over_while_it_is_used(robot: FakeRobot) -> None:
    robot.in_loop(RADIO, drive=False)
    assert robot.ask(USB, HIL_ON) == DENIED
    robot.hil_tick(USB, 3)
    assert robot.state() == DISARMED
    assert robot.ask(USB, HIL_OFF) == ACCEPTED
    robot.tick(3)
    assert robot.ask(USB, HIL_ON) == ACCEPTED


def test_a_host_that_enters_anew_while_it_drives_is_refused_and_stopped_by_its_disarm(robot: FakeRobot) -> None:
    robot.in_loop(RADIO)
    assert robot.ask(RADIO, HIL_ON) == DENIED
    assert robot.ask(RADIO, DISARM) == ACCEPTED
    robot.hil_tick(RADIO, 3)
    assert robot.ask(RADIO, HIL_ON) == ACCEPTED


def test_a_host_whose_link_closes_leaves_a_robot_at_rest(robot: FakeRobot) -> None:
    robot.in_loop(USB)
    robot.port(USB, connection=0)
    robot.tick(2)
    assert robot.state(RADIO) == DISARMED
    assert not robot.driven()


def test_a_station_heard_before_the_loop_takes_no_command_in_it(robot: FakeRobot) -> None:
    """The loop has a clock of its own: who was heard by the other one must be heard again."""
    robot.in_loop(USB)
    for _ in range(150):
        robot.send(USB, HEARTBEAT, velocity(0.0))
        robot.send(RADIO, velocity(0.0, 0.0, 0.5))
        robot.hil_tick(USB, 20)
    assert robot.state(USB) == ARMED
