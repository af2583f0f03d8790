# SPDX-License-Identifier: MIT
"""``omni stop`` says what matters first: before it has heard the robot."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from omniwheel.dialect import mavlink
from omniwheel.errors import LinkTimeoutError
from omniwheel.robot import connect
from tests.firmware.fake_robot import ESTOP, RADIO, USB, FakeRobot


class Ear:
    """A link that takes what is sent and brings nothing back; its clock goes on while it is read."""

    url = "one way"

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take = take
        self.now_s = 0.0

    def read(self, timeout_s: float) -> bytes:
        """Let time pass."""
        self.now_s += max(timeout_s, 0.001)
        return b""

    def write(self, data: bytes) -> None:
        """Bring it to the robot."""
        self._take(data)

    def close(self) -> None:
        """Do nothing."""


@pytest.mark.parametrize("port", [USB, RADIO])
def test_a_robot_that_is_not_heard_is_stopped(port: int) -> None:
    robot = FakeRobot()
    robot.driving(port)
    assert robot.enabled()

    def take(data: bytes) -> None:
        robot.send(port, data)
        robot.tick()

    ear = Ear(take)
    with pytest.raises(LinkTimeoutError, match="no data"):
        connect(ear, timeout_s=0.1, clock=lambda: ear.now_s, stop_at_once=True)
    assert not robot.enabled()
    assert robot.state() == ESTOP
    robot.close()


def test_the_stop_is_the_first_thing_that_is_sent_and_is_said_until_somebody_answers() -> None:
    sent: list[bytes] = []
    ear = Ear(sent.append)
    with pytest.raises(LinkTimeoutError):
        connect(ear, timeout_s=2.0, clock=lambda: ear.now_s, stop_at_once=True)
    messages = mavlink.MAVLink(None).parse_buffer(b"".join(sent))
    assert messages[0].get_type() == "COMMAND_LONG"
    stops = [message for message in messages if message.get_type() == "COMMAND_LONG"]
    assert len(stops) == 8  # each quarter of a second
    assert {(stop.command, stop.param1, stop.target_system) for stop in stops} == {(mavlink.MAV_CMD_OMNI_ESTOP, 1.0, 0)}


def test_without_it_nothing_but_heartbeats_is_said_to_a_robot_that_is_not_heard() -> None:
    sent: list[bytes] = []
    ear = Ear(sent.append)
    with pytest.raises(LinkTimeoutError):
        connect(ear, timeout_s=2.0, clock=lambda: ear.now_s)
    assert {message.get_type() for message in mavlink.MAVLink(None).parse_buffer(b"".join(sent))} == {"HEARTBEAT"}
