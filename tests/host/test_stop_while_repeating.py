# SPDX-License-Identifier: MIT
"""Another station stops the robot while a command is repeated here: the stop stands, and the program learns of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from omniwheel.dialect import mavlink
from omniwheel.errors import ArmingRefusedError, CommandRefusedError
from omniwheel.link import Link, open_link
from omniwheel.robot import Robot, connect
from tests.firmware.client import Firmware, firmware
from tests.firmware.fake_robot import frame
from tests.host.conftest import FakeRobot

ARM, ESTOP = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_OMNI_ESTOP
START, HOLD = mavlink.MAV_CMD_OMNI_TRAJECTORY_START, mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP
BUSY = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
OTHER = 254


class SharedRadio:
    """A link that loses the first answer to one command, when another station on it says something to the robot."""

    def __init__(self, link: Link, command: int, says: bytes) -> None:
        self.url = link.url
        self._link, self._command, self._says = link, command, says
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self.wanted = True

    def write(self, data: bytes) -> None:
        self._link.write(data)

    def read(self, timeout_s: float) -> bytes:
        frames = self._parser.parse_buffer(self._link.read(timeout_s)) or []
        return b"".join(bytes(message.get_msgbuf()) for message in frames if not self._is_lost(message))

    def _is_lost(self, message: Any) -> bool:
        lost = self.wanted and message.get_type() == "COMMAND_ACK" and message.command == self._command
        if lost and message.target_system != OTHER:
            self.wanted = False
            self._link.write(self._says)
        return bool(lost)

    def close(self) -> None:
        self._link.close()


def said_by_other(command: int, first: float) -> bytes:
    return frame("command_long", 1, 1, command, 0, first, 0, 0, 0, 9, 0, 0, system=OTHER)


@pytest.fixture
def running() -> Iterator[Firmware]:
    with firmware() as robot:
        yield robot


Connect = Callable[[int, bytes], Robot]


@pytest.fixture
def robot_on(running: Firmware) -> Iterator[Connect]:
    robots = []

    def connected(command: int, says: bytes) -> Robot:
        link = SharedRadio(open_link(running.links[0]), command, says)
        robots.append(connect(link))
        return robots[-1]

    yield connected
    for robot in robots:
        robot.close()


@pytest.mark.parametrize("stop", [(ARM, 0.0), (ESTOP, 1.0)], ids=["disarm", "e-stop"])
def test_a_repeated_arm_leaves_the_stop_of_another_station(robot_on: Connect, stop: tuple[int, float]) -> None:
    robot = robot_on(ARM, said_by_other(*stop))
    with pytest.raises(ArmingRefusedError):
        robot.arm()
    assert not robot.armed_here
    robot.pump(1.5)
    assert robot.status.safety is not None
    assert robot.status.safety.state == ("disarmed" if stop[0] == ARM else "estop")


def test_a_repeated_release_leaves_a_newer_emergency_stop(robot_on: Connect) -> None:
    robot = robot_on(ESTOP, said_by_other(ESTOP, 1.0))
    robot.connection.link.wanted = False  # type: ignore[attr-defined]
    robot.estop()
    robot.connection.link.wanted = True  # type: ignore[attr-defined]
    with pytest.raises(CommandRefusedError):
        robot.estop_clear()
    robot.pump(1.5)
    assert robot.status.safety is not None
    assert robot.status.safety.state == "estop"


def test_a_repeated_start_leaves_the_hold_of_another_station(robot_on: Connect) -> None:
    robot = robot_on(START, said_by_other(HOLD, 0.0))
    robot.arm()
    with pytest.raises(CommandRefusedError):
        robot.start_trajectory("circle", 1)
    robot.pump(1.5)
    assert robot.status.heartbeat is not None
    assert robot.status.heartbeat.mode == "hold"


# ---- what the library sends


def copies(fake: FakeRobot, command: int, first: float = 1.0) -> list[Any]:
    return [m for m in fake.received if m.get_type() == "COMMAND_LONG" and (m.command, m.param1) == (command, first)]


def test_a_command_that_is_rejected_for_now_keeps_its_number_and_says_that_it_comes_again(
    fake: Any, robot: Robot
) -> None:
    fake.command_results[ARM] = BUSY
    with pytest.raises(ArmingRefusedError):
        robot.arm()
    sent = copies(fake, ARM)
    assert len({m.param5 for m in sent}) == 1
    assert [m.confirmation for m in sent] == [min(number, 255) for number in range(len(sent))]
    with pytest.raises(ArmingRefusedError):
        robot.arm()
    assert copies(fake, ARM)[-1].param5 != sent[0].param5


def test_two_programs_that_follow_each_other_use_other_numbers(fake: Any) -> None:
    for _ in range(2):
        with connect(fake, clock=fake.clock) as robot:
            robot.arm()
    first, second = copies(fake, ARM)
    assert first.param5 != second.param5


@pytest.mark.parametrize("result", [None, BUSY], ids=["no answer", "rejected for now"])
@pytest.mark.parametrize("said", ["stopped by station 254/190 on link 1", "hub: stopped by omni stop (7)"])
def test_arming_is_given_up_when_another_station_or_program_stops_the_robot(
    fake: Any, robot: Robot, said: str, result: int | None
) -> None:
    answer = fake._answer

    def stopped(message: Any) -> None:
        if message.get_type() != "COMMAND_LONG" or (message.command, message.param1) != (ARM, 1.0):
            answer(message)
            return
        fake.say(said)
        if result is not None:
            fake.send(mavlink.MAVLink_command_ack_message(ARM, result))

    fake._answer = stopped
    with pytest.raises(ArmingRefusedError) as caught:
        robot.arm()
    assert said in caught.value.reasons
    assert len(copies(fake, ARM)) == 1
    assert copies(fake, ARM, 0.0), "its copy may still be on its way"
    assert not robot.armed_here


def test_a_late_answer_to_an_earlier_copy_does_not_hide_that_the_robot_armed(fake: Any, robot: Robot) -> None:
    """Three copies come to it while it is busy; each answer takes 1.5 s."""
    late: list[tuple[float, int]] = []
    answer, read = fake._answer, fake.read

    def answer_late(message: Any) -> None:
        if message.get_type() != "COMMAND_LONG" or message.command != ARM:
            answer(message)
            return
        busy = len(copies(fake, ARM)) < 5
        late.append((fake.now_s + 1.5, BUSY if busy else mavlink.MAV_RESULT_ACCEPTED))

    def read_late(timeout_s: float) -> bytes:
        while late and late[0][0] <= fake.now_s:
            fake.send(mavlink.MAVLink_command_ack_message(ARM, late.pop(0)[1]))
        return bytes(read(timeout_s))

    fake._answer, fake.read = answer_late, read_late
    robot.arm()
    assert robot.armed_here
