# SPDX-License-Identifier: MIT
"""The stop button wired to a pin: an emergency stop from the first open sample on, latched like every other."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    ARMED,
    CRASH,
    DISARMED,
    EMERGENCY,
    ESTOP,
    HEARTBEAT,
    HIL_ON,
    PORTS,
    RADIO,
    RELEASE,
    SOFTWARE,
    USB,
    WATCHDOG,
    FakeRobot,
    velocity,
)
from tests.firmware.latched import check_only_a_release_leads_out
from tests.firmware.stop_latency import MOMENTS, MOMENTS_IN_LOOP

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
SAYS = "stop button open: pressed, or its wire is cut"
NOT_RELEASED = "not released: the stop button is still open"


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot()
    yield one
    one.close()


@pytest.mark.parametrize("moment", MOMENTS)
def test_the_first_open_sample_stops_in_its_tick_and_one_is_enough(robot: FakeRobot, moment: str) -> None:
    MOMENTS[moment](robot)
    robot.press()
    robot.bare_tick()  # the background does nothing for it
    assert not robot.enabled()
    assert not robot.has_duty()
    robot.press(False)
    for _ in range(50):
        robot.send(USB, HEARTBEAT, velocity(0.1))
        robot.tick()
        assert not robot.driven()
    check_only_a_release_leads_out(robot)


def test_the_simulated_robot_has_one_too(robot: FakeRobot) -> None:
    MOMENTS_IN_LOOP["in the loop"](robot)
    robot.press(hil=True)
    robot.hil_tick(RADIO)
    assert not robot.enabled(hil=True)
    assert not robot.has_duty(hil=True)
    assert robot.ask(RADIO, RELEASE) == DENIED
    assert NOT_RELEASED in robot.texts(RADIO)
    robot.press(False, hil=True)
    robot.hil_tick(RADIO, 3)
    assert robot.state(RADIO) == ESTOP
    assert robot.ask(RADIO, RELEASE) == ACCEPTED
    robot.hil_tick(RADIO, 3)
    assert robot.state(RADIO) == DISARMED


def test_the_real_button_stops_the_simulated_robot_as_well(robot: FakeRobot) -> None:
    MOMENTS_IN_LOOP["in the loop"](robot)
    robot.press()
    robot.hil_tick(RADIO)
    assert not robot.enabled(hil=True)
    assert robot.ask(RADIO, RELEASE) == DENIED


def test_a_host_in_the_loop_that_is_silent_does_not_keep_the_button_from_stopping(robot: FakeRobot) -> None:
    MOMENTS_IN_LOOP["in the loop"](robot)
    robot.press()
    robot.tick(10)
    robot.press(False)
    robot.tick(990)
    assert not robot.driven()
    robot.tick(10)
    check_only_a_release_leads_out(robot)


def test_a_release_while_it_is_open_is_refused_and_says_why(robot: FakeRobot) -> None:
    robot.driving()
    robot.press()
    robot.tick(3)
    assert robot.ask(RADIO, RELEASE) == DENIED
    assert NOT_RELEASED in robot.texts(RADIO)
    robot.tick(3)
    assert robot.state() == ESTOP
    robot.press(False)
    check_only_a_release_leads_out(robot)


def test_a_release_in_one_tick_with_the_button_loses(robot: FakeRobot) -> None:
    robot.driving()
    robot.ask(USB, EMERGENCY)
    robot.tick(3)
    assert robot.ask(USB, RELEASE) == ACCEPTED
    robot.press()
    robot.tick(3)
    assert robot.state() == ESTOP
    assert SAYS in robot.texts()


def test_an_arm_command_in_one_tick_with_the_button_loses(robot: FakeRobot) -> None:
    robot.ready()
    assert robot.ask(USB, ARM) == ACCEPTED
    robot.press()
    robot.tick(3)
    assert robot.state() == ESTOP


def test_everybody_hears_once_that_it_was_the_button(robot: FakeRobot) -> None:
    robot.driving()
    robot.look()
    for opened in (True, False, True, False, True):  # a contact that bounces
        robot.press(opened)
        robot.tick(2)
    robot.tick(2000)
    for port in range(PORTS):
        assert robot.texts(port).count(SAYS) == 1


def test_a_glitch_of_one_sample_is_said_too(robot: FakeRobot) -> None:
    robot.driving()
    robot.press()
    robot.bare_tick()
    robot.press(False)
    robot.bare_tick()
    robot.tick(3)
    assert robot.texts().count(SAYS) == 1
    check_only_a_release_leads_out(robot)


def test_who_comes_later_hears_it_and_the_others_not_again(robot: FakeRobot) -> None:
    robot.port(RADIO, connection=0)
    robot.driving()
    robot.press()
    robot.tick(3)
    robot.port(RADIO, connection=2)
    robot.tick(3)
    assert [robot.texts(port).count(SAYS) for port in range(PORTS)] == [1] * PORTS


def test_the_next_press_is_said_again(robot: FakeRobot) -> None:
    for number in (1, 2, 3):
        robot.ready()
        robot.press()
        robot.tick(600)
        assert robot.texts().count(SAYS) == number
        robot.press(False)
        robot.tick()
        robot.send(USB, RELEASE)
        robot.tick(600)
        assert robot.state() == DISARMED


@pytest.mark.parametrize("cause", [WATCHDOG, SOFTWARE, CRASH])
@pytest.mark.parametrize("power", [True, False])
@pytest.mark.parametrize("still_open", [True, False])
def test_every_restart_comes_up_stopped(robot: FakeRobot, cause: int, power: bool, still_open: bool) -> None:
    robot.driving()
    robot.press()
    robot.tick(2)
    robot.press(still_open)
    robot.reset(cause, power)
    robot.ready()
    assert robot.state() == ESTOP
    assert robot.texts().count(SAYS) == (1 if still_open else 0)
    assert "stopped since before the restart: release it" in robot.texts()
    robot.press(False)
    robot.tick()
    check_only_a_release_leads_out(robot)


def test_open_at_the_start_it_starts_stopped_and_keeps_that(robot: FakeRobot) -> None:
    robot.press()
    robot.reset()
    robot.background()
    assert robot.state() == ESTOP, "before the first tick"
    robot.tick(3)
    assert robot.texts().count(SAYS) == 1
    assert robot.ask(USB, HIL_ON) == DENIED
    robot.press(False)
    robot.reset()
    robot.ready()
    check_only_a_release_leads_out(robot)


def test_a_closed_button_disturbs_nobody(robot: FakeRobot) -> None:
    robot.driving()
    for _ in range(30):
        robot.send(USB, HEARTBEAT, velocity(0.0, 0.0, 0.5))
        robot.tick(10)
    assert robot.state() == ARMED
    assert SAYS not in robot.texts()
