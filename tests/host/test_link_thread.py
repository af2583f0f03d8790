# SPDX-License-Identifier: MIT
"""A thread serves the link: the program may sleep and compute, and several threads may use one robot."""

from __future__ import annotations

import errno
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

import omniwheel
from omniwheel.callbacks import WAITING
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkLostError, LinkTimeoutError, StoppedError
from omniwheel.robot import Robot
from omniwheel.simulation import SimulatedRobot
from omniwheel.telemetry import Heartbeat, StatusText, Tracking
from tests.host.conftest import FakeRobot
from tests.waiting import LONGEST_S, pass_time, wait_until

PATIENCE_S = 3.0
"""A setpoint is lost after so long."""


class PatientRobot(FakeRobot):
    """The robot made of Python, on a link that waits by the wall clock, as real ones do."""

    def __init__(self) -> None:
        super().__init__()
        self._turn = threading.RLock()
        self.unplugged = False

    def read(self, timeout_s: float) -> bytes:
        if self.unplugged:
            raise LinkLostError("lost the serial port")
        with self._turn:
            data = super().read(timeout_s)
        if not data:
            pass_time(min(timeout_s, 0.005))
        return data

    def write(self, data: bytes) -> None:
        with self._turn:
            super().write(data)

    def send(self, message: Any) -> None:
        with self._turn:
            super().send(message)


@pytest.fixture
def fake() -> PatientRobot:
    return PatientRobot()


@pytest.fixture
def robot(fake: PatientRobot) -> Iterator[Robot]:
    with omniwheel.connect(fake) as robot:
        yield robot


@pytest.fixture
def driven() -> Iterator[SimulatedRobot]:
    with omniwheel.simulate() as robot:
        robot.parameters.set_many({"SAFE_CMD_TO": PATIENCE_S, "SAFE_LINK_TO": LONGEST_S})  # on a busy computer, too
        robot.arm()
        yield robot


def test_heartbeats_go_out_while_the_program_does_something_else(robot: Robot, fake: PatientRobot) -> None:
    def beats() -> int:
        return sum(message.get_type() == "HEARTBEAT" for message in fake.received)

    before = beats()
    wait_until(lambda: beats() >= before + 2, "two heartbeats")


def test_what_the_robot_says_is_known_without_asking(robot: Robot, fake: PatientRobot) -> None:
    fake.say("hello")
    wait_until(lambda: any(text.text == "hello" for text in robot.texts.all), "the text")


def test_many_threads_get_their_own_answers(robot: Robot, fake: PatientRobot) -> None:
    names = list(fake.values)[:24]

    def write_and_read(name: str) -> float:
        robot.parameters[name] = fake.values[name]
        return robot.parameters.read(name)

    with ThreadPoolExecutor(8) as threads:
        values = list(threads.map(write_and_read, names))
        downloads = [threads.submit(robot.parameters.download) for _ in range(3)]
    assert values == [fake.values[name] for name in names]
    assert all(download.result() == fake.values for download in downloads)


def test_a_lost_link_is_raised_by_what_waits_and_by_what_sends(robot: Robot, fake: PatientRobot) -> None:
    fake.unplugged = True
    with pytest.raises(LinkLostError):
        robot.wait_for(Tracking, timeout_s=LONGEST_S)
    with pytest.raises(LinkLostError):
        robot.set_velocity(0.0, 0.0, 0.0)


def test_waits_have_an_end(robot: Robot) -> None:
    with pytest.raises(LinkTimeoutError):
        robot.wait_for(Tracking, timeout_s=0.1)


def test_callbacks_may_use_the_robot_and_their_errors_are_heard(robot: Robot, fake: PatientRobot) -> None:
    seen: list[float] = []
    name = next(iter(fake.values))
    remove = robot.on(StatusText, lambda text: seen.append(robot.parameters.read(name)))
    fake.say("one")
    wait_until(lambda: seen == [fake.values[name]], "the callback")
    remove()
    robot.on(StatusText, lambda text: 1 / 0)
    fake.say("two")
    with pytest.raises(ZeroDivisionError):
        robot.sleep(LONGEST_S)


def test_an_error_in_a_callback_keeps_no_robot_from_being_disarmed(fake: PatientRobot) -> None:
    called = threading.Event()

    def fail(_: StatusText) -> None:
        called.set()
        raise RuntimeError("the program's own")

    with omniwheel.connect(fake) as robot:
        robot.arm()
        robot.on(StatusText, fail)
        fake.say("one")
        assert called.wait(LONGEST_S)
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    assert [first for command, first in fake.commands() if command == arm] == [1.0, 0.0]


def test_an_error_in_a_condition_is_the_callers(robot: Robot) -> None:
    with pytest.raises(ZeroDivisionError):
        robot.wait_until(lambda status: status.mode != "unknown" and 1 / 0 > 0, LONGEST_S, "anything")
    assert robot.wait_for(Heartbeat, timeout_s=LONGEST_S) is not None


def test_the_thread_ends_with_the_connection(fake: PatientRobot) -> None:
    with omniwheel.connect(fake) as robot:
        robot.on(Heartbeat, lambda _: None)
    assert fake.closed
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("omniwheel")]


def test_leaving_disarms_what_was_armed(fake: PatientRobot) -> None:
    with omniwheel.connect(fake) as robot:
        robot.arm()
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    assert [first for command, first in fake.commands() if command == arm] == [1.0, 0.0]


@pytest.mark.full
def test_a_program_may_sleep_between_its_drives(driven: SimulatedRobot) -> None:
    driven.drive_to(0.2, 0.0)
    pass_time(PATIENCE_S + 1.0)
    assert driven.state == "armed"
    driven.velocity(0.1, 0.0, 0.0)
    pass_time(PATIENCE_S + 1.0)
    assert driven.state == "armed"
    assert driven.pose.x > 0.25
    driven.stop()
    assert driven.drive_to(0.2, 0.0).pose.x == pytest.approx(0.2, abs=0.01)


STOPS: dict[str, Callable[[Robot], object]] = {"stop": lambda robot: robot.stop(), "hold": lambda robot: robot.hold()}


@pytest.mark.full
@pytest.mark.parametrize("stop", STOPS)
def test_another_thread_ends_a_drive(driven: SimulatedRobot, stop: str) -> None:
    with ThreadPoolExecutor(1) as threads:
        drive = threads.submit(driven.drive_to, 3.0, 0.0, speed=0.2)
        wait_until(lambda: driven.pose.x > 0.02, "a moving robot")
        STOPS[stop](driven)
        with pytest.raises(StoppedError):
            drive.result(LONGEST_S)
    assert driven.armed
    assert driven.pose.x < 1.0


def test_a_wait_ends_when_the_program_closes_the_connection(fake: PatientRobot) -> None:
    with ThreadPoolExecutor(1) as threads:
        with omniwheel.connect(fake) as robot:
            waiting = threads.submit(robot.wait_for, Tracking, timeout_s=1e6)
            wait_until(waiting.running, "the waiting thread")
        with pytest.raises(LinkLostError):
            waiting.result(LONGEST_S)


def fail(_: bytes) -> None:
    raise OSError(errno.ENOSPC, "no space left")


def test_a_recorder_that_fails_is_heard_once_and_the_link_goes_on(robot: Robot, fake: PatientRobot) -> None:
    robot.arm()
    robot.connection.recorder = fail
    with pytest.raises(OSError, match="no space left"):
        robot.sleep(LONGEST_S)
    robot.sleep(0.0)
    robot.connection.recorder = fail
    robot.disarm()
    arm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
    assert [first for command, first in fake.commands() if command == arm] == [1.0, 0.0]


def test_dropped_calls_are_told_once(robot: Robot) -> None:
    goes_on = threading.Event()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        robot.on(StatusText, lambda _: None)
        assert robot._callbacks is not None
        robot._callbacks.call(lambda: goes_on.wait(LONGEST_S))
        for _ in range(WAITING + 10):
            robot._callbacks.call(int)
        goes_on.set()
    assert [one.category for one in caught] == [RuntimeWarning]
