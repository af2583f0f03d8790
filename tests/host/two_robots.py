# SPDX-License-Identifier: MIT
"""Two fake robots on one line, in simulated time: what is for one of them does not reach the other."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import omniwheel.robot
from omniwheel import Robot
from omniwheel.dialect import mavlink
from tests.host.conftest import FakeRobot

FIRST, SECOND = 7, 9


class TwoRobots:
    """A link to robots 7 and 9, whose heartbeats come ``apart_s`` apart. ``tell_time``: they answer TIMESYNC."""

    url = "line"

    def __init__(self, *, apart_s: float = 0.5, tell_time: bool = False) -> None:
        self.robots = {FIRST: FakeRobot(), SECOND: FakeRobot()}
        self.tell_time = tell_time
        self.now_s = 0.0
        self._parser = mavlink.MAVLink(None)
        for system, robot in self.robots.items():
            robot._codec.srcSystem = system
        self.robots[SECOND]._next_heartbeat_s = apart_s

    def clock(self) -> float:
        return self.now_s

    def write(self, data: bytes) -> None:
        for message in self._parser.parse_buffer(data) or ():
            for system, robot in self.robots.items():
                if getattr(message, "target_system", 0) in (0, system):
                    robot.write(bytes(message.get_msgbuf()))
                    self._answer(system, message)

    def _answer(self, system: int, message: Any) -> None:
        """Answer what the fake robots do not."""
        kind, robot = message.get_type(), self.robots[system]
        if kind == "COMMAND_LONG" and message.param1 == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            none = [0] * 8
            robot.send(mavlink.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, none, none, none, 0, 0, system))
        elif kind == "TIMESYNC" and self.tell_time:
            robot.send(mavlink.MAVLink_timesync_message(round(robot.now_s * 1e9) + 1, message.ts1))

    def read(self, timeout_s: float) -> bytes:
        data = b"".join(robot.read(timeout_s) for robot in self.robots.values())
        self.now_s = self.robots[FIRST].now_s
        return data

    def close(self) -> None:
        """The next connection finds it as it is."""

    def commands(self, number: int) -> dict[int, int]:
        """Return how many commands with this number and 1 in its first parameter each robot has received."""
        return {system: robot.commands().count((number, 1.0)) for system, robot in self.robots.items()}


@contextmanager
def everybody_connects_to(line: TwoRobots) -> Iterator[None]:
    """Whoever connects, to whatever link, finds this line."""
    real = omniwheel.robot.connect

    def connect(_url: object, **options: Any) -> Robot:
        return real(line, **{**options, "clock": line.clock})

    with patch("omniwheel.robot.connect", connect):
        yield
