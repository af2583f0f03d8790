# SPDX-License-Identifier: MIT
"""Commands over a link whose answers come late, twice or not at all: what the host believes is so."""

from __future__ import annotations

import random
from collections.abc import Iterator

import pytest

from omniwheel.bringup.other_stops import safety_of
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkTimeoutError
from omniwheel.robot import Robot, connect
from tests.radio.memory_robot import USB, MemoryLink, MemoryRobot

COMMAND_LONG, COMMAND_ACK = mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_ACK
HEADER, CHECKSUM = 10, 2


def frames(data: bytes) -> Iterator[bytes]:
    """Cut whole MAVLink 2 frames without signature apart."""
    while data:
        length = HEADER + data[1] + CHECKSUM
        yield data[:length]
        data = data[length:]


def id_of(frame: bytes) -> int:
    return int.from_bytes(frame[7:10], "little")


class LateAnswers(MemoryLink):
    """Delays and repeats COMMAND_ACKs, and loses commands."""

    def __init__(self, robot: MemoryRobot, seed: int) -> None:
        super().__init__(robot, USB)
        self.rng = random.Random(seed)
        self.held: list[tuple[float, bytes]] = []
        self.lost = self.late = 0
        self.loss = 0.3

    def read(self, timeout_s: float) -> bytes:
        now = self.clock_s()
        out = b""
        for frame in frames(super().read(timeout_s)):
            if id_of(frame) == COMMAND_ACK:
                self.held += [
                    (now + self.rng.choice((0.0, 0.3, 1.5, 2.5)), frame) for _ in range(self.rng.choice((1, 2)))
                ]
            else:
                out += frame
        due = sorted((when, frame) for when, frame in self.held if when <= now)
        self.late += sum(1 for when, _ in due if when > now - 0.01)
        self.held = [(when, frame) for when, frame in self.held if when > now]
        return out + b"".join(frame for _, frame in due)

    def write(self, data: bytes) -> None:
        if id_of(data) == COMMAND_LONG and self.rng.random() < self.loss:
            self.lost += 1
        else:
            super().write(data)


def armed(robot: Robot) -> bool:
    return safety_of(robot).state == "armed"


@pytest.mark.full
@pytest.mark.parametrize("seed", range(4))
def test_the_robot_is_armed_exactly_when_the_host_was_told_so(seed: int) -> None:
    with MemoryRobot() as memory:
        link = LateAnswers(memory, seed)
        with connect(link, clock=link.clock_s) as robot:
            robot.pump(1.0)
            for _ in range(10):
                robot.arm()
                assert armed(robot)
                robot.disarm()
                assert not armed(robot)
        assert link.lost > 5
        assert link.late > 5


def test_an_answer_to_arm_does_not_confirm_a_disarm_that_never_came(monkeypatch: pytest.MonkeyPatch) -> None:
    with MemoryRobot() as memory:
        link = LateAnswers(memory, 1)
        link.loss = 0.0
        with connect(link, clock=link.clock_s) as robot:
            robot.pump(1.0)
            robot.arm()
            link.held.clear()
            answer = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 12345, 255, 190)
            frame = answer.pack(mavlink.MAVLink(None, 1, 1))
            link.loss = 1.0
            link.held = [(link.clock_s() + 0.2 * n, frame) for n in range(20)]  # late ones of arm
            monkeypatch.setattr("omniwheel.commands.TRIES", 2)
            with pytest.raises(LinkTimeoutError):
                robot.disarm()
            assert robot.armed_here  # so that the end of the program tries again
            link.loss = 0.0
            assert armed(robot)
            robot.disarm()
            assert not armed(robot)
