# SPDX-License-Identifier: MIT
"""An emergency stop outlives everything but a release, and no restart arms a robot: in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    ARMED,
    CRASH,
    DISARM,
    DISARMED,
    EMERGENCY,
    ESTOP,
    HEARTBEAT,
    HIL_OFF,
    HIL_ON,
    OVER_TEMPERATURE,
    PORTS,
    POWER_ON,
    RADIO,
    REBOOT,
    RELEASE,
    SOFTWARE,
    TERMINATE,
    USB,
    WATCHDOG,
    FakeRobot,
    duty,
    velocity,
)
from tests.firmware.latched import check_only_a_release_leads_out

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
CAUSES = {
    "power": POWER_ON,
    "watchdog": WATCHDOG,
    "software": SOFTWARE,
    "crash": CRASH,
    "heat": OVER_TEMPERATURE,
}
RECORD = 12
"""Bytes of the stop record."""
MAGIC = 4
"""Those it begins with, the same in every record."""


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot()
    yield one
    one.close()


def stopped(robot: FakeRobot, request: bytes = EMERGENCY) -> FakeRobot:
    robot.driving()
    assert robot.ask(USB, request) == ACCEPTED
    robot.tick(2)
    assert robot.state() == ESTOP
    return robot


def check_still_stopped(robot: FakeRobot, other: int = RADIO) -> None:
    """Nothing but a release leads out, and that does."""
    robot.ready()
    check_only_a_release_leads_out(robot, other)


@pytest.mark.parametrize("power", [True, False])
@pytest.mark.parametrize("cause", CAUSES)
@pytest.mark.parametrize("request_", [EMERGENCY, TERMINATE])
def test_every_restart_comes_up_stopped(robot: FakeRobot, request_: bytes, cause: str, power: bool) -> None:
    stopped(robot, request_).reset(CAUSES[cause], power)
    check_still_stopped(robot)


def test_it_says_why_on_every_link(robot: FakeRobot) -> None:
    stopped(robot).reset(SOFTWARE, power=False)
    robot.tick(5)
    for port in range(PORTS):
        assert "stopped since before the restart: release it" in robot.texts(port)


def test_many_restarts_and_a_release_in_the_end(robot: FakeRobot) -> None:
    stopped(robot)
    for cause in (*CAUSES.values(), *CAUSES.values()):
        robot.reset(cause)
        robot.tick(3)
        assert robot.state() == ESTOP
    check_still_stopped(robot)
    robot.ask(RADIO, DISARM)
    robot.tick(600)
    robot.reset()
    robot.ready()
    assert robot.state() == DISARMED, "the release was kept, too"


def test_a_stop_and_a_reboot_in_one_breath(robot: FakeRobot) -> None:
    robot.ready()
    robot.send(RADIO, EMERGENCY, REBOOT)
    robot.background()
    assert robot.reboots
    robot.reset(SOFTWARE, power=False)
    check_still_stopped(robot)


def test_a_release_and_a_reboot_in_one_breath(robot: FakeRobot) -> None:
    stopped(robot)
    assert robot.ask(USB, RELEASE) == ACCEPTED
    robot.tick(2)
    robot.send(USB, REBOOT)
    robot.background()
    robot.reset(SOFTWARE, power=False)
    robot.ready()
    assert robot.state() == DISARMED


def test_a_stop_while_the_robot_rests_or_starts_is_kept_as_well(robot: FakeRobot) -> None:
    robot.ready()
    robot.ask(RADIO, EMERGENCY)
    robot.tick()
    robot.reset()
    robot.send(RADIO, EMERGENCY)
    robot.background()
    robot.tick(2)
    check_still_stopped(robot)


def leave_by_command(robot: FakeRobot) -> None:
    assert robot.ask(USB, HIL_OFF) == ACCEPTED


def leave_by_command_of_the_host(robot: FakeRobot) -> None:
    assert robot.ask(RADIO, HIL_OFF) == ACCEPTED


def leave_by_closing(robot: FakeRobot) -> None:
    robot.port(RADIO, connection=0)
    robot.tick()
    robot.port(RADIO, connection=2)


def leave_by_silence(robot: FakeRobot) -> None:
    robot.tick(10200)


def restart_the_loop(robot: FakeRobot) -> None:
    assert robot.ask(RADIO, HIL_ON) == ACCEPTED
    robot.hil_restart()
    robot.hil_tick(RADIO, 5)
    assert robot.state(RADIO) == ESTOP
    leave_by_command(robot)


def restart_the_processor(robot: FakeRobot) -> None:
    robot.reset(CRASH, power=False)


WAYS_OUT = (
    leave_by_command,
    leave_by_command_of_the_host,
    leave_by_closing,
    leave_by_silence,
    restart_the_loop,
    restart_the_processor,
)
WAYS_AT_ONCE = WAYS_OUT[:4]
"""Those possible before a tick has taken the stop."""


@pytest.mark.parametrize(
    ("way", "ticked"), [*((way, True) for way in WAYS_OUT), *((way, False) for way in WAYS_AT_ONCE)]
)
def test_a_stop_in_the_loop_holds_outside(robot: FakeRobot, way: Callable[[FakeRobot], None], ticked: bool) -> None:
    robot.in_loop(RADIO)
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    if ticked:
        robot.hil_tick(RADIO, 2)
    way(robot)
    robot.tick(3)
    check_still_stopped(robot)


def test_entering_the_loop_does_not_lift_a_stop(robot: FakeRobot) -> None:
    stopped(robot)
    for port in (USB, RADIO):
        assert robot.ask(port, HIL_ON) == DENIED
        assert robot.ask(port, HIL_OFF) == ACCEPTED
        robot.tick(3)
    check_still_stopped(robot)


def test_in_lockstep_neither_a_new_start_nor_a_new_host_lifts_a_stop() -> None:
    robot = FakeRobot(lockstep=True)
    robot.hil_tick(USB, 30, timer=False)
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    robot.hil_tick(USB, 1, timer=False)
    for _ in range(2):
        assert robot.ask(USB, HIL_ON) == ACCEPTED
        robot.hil_restart()
        robot.hil_tick(USB, 5, timer=False)
        assert robot.state() == ESTOP
    robot.port(USB, connection=2)
    robot.background()
    robot.hil_restart()
    robot.hil_tick(USB, 5, timer=False)
    assert robot.state() == ESTOP
    assert robot.ask(USB, RELEASE) == ACCEPTED
    assert robot.ask(USB, HIL_ON) == ACCEPTED, "a release that was accepted is done"
    robot.hil_restart()
    robot.hil_tick(USB, 5, timer=False)
    assert robot.state() == DISARMED
    robot.close()


def test_a_release_in_one_tick_with_a_stop_is_not_accepted(robot: FakeRobot) -> None:
    robot.ready()
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    assert robot.ask(USB, RELEASE) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    robot.tick(2)
    assert robot.state() == ESTOP
    assert robot.ask(USB, RELEASE) == ACCEPTED
    robot.tick(2)
    assert robot.state() == DISARMED


def test_arming_right_behind_a_release_is_to_be_tried_again(robot: FakeRobot) -> None:
    """The release is answered before a tick has done it: "estop" would be a wrong reason, and a lasting one."""
    robot.ready()
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    robot.tick(3)
    assert robot.ask(USB, RELEASE) == ACCEPTED
    assert robot.ask(USB, ARM) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    robot.tick(1)
    assert robot.ask(USB, ARM) == ACCEPTED
    robot.tick(3)
    assert robot.state() == ARMED
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    robot.tick(5)
    assert robot.ask(USB, ARM) == mav.MAV_RESULT_DENIED
    assert robot.ask(USB, RELEASE) == ACCEPTED
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    robot.tick(3)
    assert robot.ask(USB, ARM) == mav.MAV_RESULT_DENIED, "a stop behind the release wins"


def stop_and_release(robot: FakeRobot, times: int) -> None:
    """Stop and release so often; each is stored."""
    for _ in range(times):
        robot.ask(USB, EMERGENCY)
        robot.tick(2)
        robot.ask(USB, RELEASE)
        robot.tick(600)


@pytest.mark.parametrize("before", [0, 1, 2, 3])
def test_a_power_cut_at_any_byte_of_the_stop_comes_up_stopped(robot: FakeRobot, before: int) -> None:
    """``before``: stops and releases that have been stored earlier. What changes no byte is before the write."""
    robot.ready()
    stop_and_release(robot, before)
    moment = robot.keep()
    for count in range(1, RECORD + 1):
        robot.go_back(moment)
        robot.storage_fate(count)
        old = robot.storage
        robot.ask(USB, EMERGENCY)
        robot.tick(2)
        if robot.storage == old:
            assert count <= MAGIC
            continue
        robot.storage_fate()
        robot.reset()
        robot.tick(30)
        assert robot.state() == ESTOP, f"cut after {count} bytes"
        robot.ask(USB, RELEASE)
        robot.tick(600)
        robot.reset()
        robot.tick(30)
        assert robot.state() == DISARMED, f"a release after a cut after {count} bytes"


@pytest.mark.parametrize("before", [0, 1, 2])
def test_a_power_cut_at_any_byte_of_the_release_comes_up_stopped(robot: FakeRobot, before: int) -> None:
    robot.ready()
    stop_and_release(robot, before)
    robot.ask(USB, EMERGENCY)
    robot.tick(2)
    moment = robot.keep()
    for count in range(RECORD):
        robot.go_back(moment)
        robot.storage_fate(count)
        robot.ask(USB, RELEASE)
        robot.tick(600)
        robot.storage_fate()
        robot.reset()
        check_still_stopped(robot)


def test_a_memory_that_cannot_be_read_comes_up_stopped_and_can_be_released(robot: FakeRobot) -> None:
    robot.storage_fate(unreadable=True)
    robot.reset()
    robot.tick(30)
    assert robot.state() == ESTOP
    assert "stop memory unreadable: stopped until released" in robot.texts()
    check_still_stopped(robot, USB)  # the signing key cannot be read either: the radio is closed


def test_a_damaged_record_comes_up_stopped(robot: FakeRobot) -> None:
    stopped(robot)
    robot.ask(USB, RELEASE)
    robot.tick(600)
    content = bytearray(robot.storage)
    content[2048 - RECORD + 5] ^= 0x10
    robot.reset()
    robot.storage = bytes(content)
    robot.reset()
    check_still_stopped(robot)


def test_a_stop_in_doubt_is_written_so_that_no_other_write_ends_it(robot: FakeRobot) -> None:
    stopped(robot)
    whole = robot.storage[-RECORD:]
    content = bytearray(robot.storage)
    content[-RECORD + 5] ^= 0x10
    robot.storage = bytes(content)
    robot.reset()
    robot.tick(30)
    assert robot.storage[-RECORD:] == whole


def test_a_memory_that_takes_nothing_is_told(robot: FakeRobot) -> None:
    robot.driving()
    robot.storage_fate(0)
    robot.look()
    robot.ask(USB, EMERGENCY)
    robot.tick(3000)
    assert robot.texts().count("the memory failed: a restart may lift the stop") == 1
    robot.storage_fate()
    robot.tick(1100)
    robot.reset()
    check_still_stopped(robot)


def test_who_stops_and_releases_all_day_does_not_wear_the_memory(robot: FakeRobot) -> None:
    robot.ready()
    before = robot.written
    for _ in range(1000):
        robot.send(USB, EMERGENCY)
        robot.tick(5)
        robot.send(USB, RELEASE)
        robot.tick(5)
    assert robot.written - before == RECORD, "it says stopped all the while"


def test_arming_soon_after_a_release_writes_when_it_is_disarmed_again(robot: FakeRobot) -> None:
    stopped(robot)
    robot.tick(250)  # its wheels come to rest
    robot.ask(USB, RELEASE)
    robot.tick(10)
    assert robot.ask(USB, ARM) == ACCEPTED
    robot.tick(5)
    before = robot.written
    for _ in range(20):
        robot.send(USB, HEARTBEAT)
        robot.tick(100)
    assert robot.state() == ARMED
    assert robot.written == before, "nothing is written while armed"
    robot.ask(USB, DISARM)
    robot.tick(5)
    robot.reset()
    robot.ready()
    assert robot.state() == DISARMED


@pytest.mark.parametrize("power", [True, False])
@pytest.mark.parametrize("cause", CAUSES)
def test_no_restart_arms_or_drives_whatever_goes_on_coming(robot: FakeRobot, cause: str, power: bool) -> None:
    robot.driving()
    robot.reset(CAUSES[cause], power)
    for tick in range(1500):
        for port in range(PORTS):
            if tick % 10 == port:
                robot.send(port, HEARTBEAT, velocity(0.1), duty(0.2))
        robot.tick()
        assert not robot.driven()
    assert robot.state() == DISARMED


def test_a_trajectory_asked_for_before_a_restart_does_not_start_with_the_next_arming(robot: FakeRobot) -> None:
    robot.ready()
    robot.send(USB, HEARTBEAT)
    robot.reset(WATCHDOG)
    robot.armed()
    robot.tick(300)
    assert not robot.driven()
