# SPDX-License-Identifier: MIT
"""A robot made of Python that answers on a simulated link and clock, and the real PC firmware on real links."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.robot import Robot, connect
from omniwheel.robots import parameter_table
from tests.host import stepped

TICK_S = 0.01


class FakeRobot:
    """A link whose other end is a robot: it knows parameters and commands, loses frames, and owns the clock."""

    url = "fake"

    def __init__(self, *, loss: float = 0.0, seed: int = 1, names: int | None = None) -> None:
        table = parameter_table()
        self.values = dict(list(table.defaults().items())[:names])
        self.limits = {name: (table[name].minimum, table[name].maximum) for name in self.values}
        self.refusals: dict[str, str] = {}
        self.command_results: dict[int, int] = {}
        self.reasons: list[str] = []
        self.received: list[Any] = []
        self.silent = False
        self.garbage = b""
        self.now_s = 0.0
        self.closed = False
        self._loss = loss
        self._random = random.Random(seed)
        self._out = bytearray()
        self._codec = mavlink.MAVLink(self, 7, 1)
        self._codec.robust_parsing = True
        self._next_heartbeat_s = 0.0

    def clock(self) -> float:
        return self.now_s

    def write(self, data: bytes) -> None:
        """Both directions' frames pass here: the codec's own are replies, everything else comes from the host."""
        if self._replying:
            self._out += b"" if self._random.random() < self._loss else bytes(data)
            return
        if self._random.random() >= self._loss:
            for message in self._codec.parse_buffer(data) or ():
                self.received.append(message)
                self._answer(message)

    _replying = False

    def send(self, message: Any) -> None:
        self._replying = True
        self._codec.send(message)
        self._replying = False

    def read(self, timeout_s: float) -> bytes:
        self.now_s += TICK_S
        if self.silent:
            return b""
        if self.now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s += 1.0
            self.heartbeat()
        data, self._out = self.garbage + bytes(self._out), bytearray()
        return data

    def heartbeat(self) -> None:
        self.send(
            mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_GENERIC, 1, 0, 3, 3)
        )

    def say(self, text: str) -> None:
        self.send(mavlink.MAVLink_statustext_message(4, text.encode()))

    def close(self) -> None:
        self.closed = True

    def commands(self) -> list[tuple[int, float]]:
        """Commands received, with their first parameter."""
        return [(m.command, m.param1) for m in self.received if m.get_type() == "COMMAND_LONG"]

    def _answer(self, message: Any) -> None:
        kind = message.get_type()
        if kind == "PARAM_REQUEST_LIST":
            for name in self.values:
                self._send_value(name)
        elif kind == "PARAM_REQUEST_READ":
            known = list(self.values)
            index = message.param_index
            name = message.param_id if index == -1 else known[index] if index < len(known) else ""
            if name in self.values:
                self._send_value(name)
        elif kind == "PARAM_SET":
            self._set(message.param_id, message.param_value)
        elif kind == "COMMAND_LONG":
            result = self.command_results.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
            self.send(mavlink.MAVLink_command_ack_message(message.command, result))
            for reason in self.reasons if result else ():
                self.say(reason)

    def _set(self, name: str, value: float) -> None:
        if name in self.refusals:
            self._send_value(name)
            self.say(self.refusals[name])
        elif name in self.values:
            self.values[name] = value
            self._send_value(name)

    def _send_value(self, name: str) -> None:
        index = list(self.values).index(name)
        self.send(
            mavlink.MAVLink_param_value_message(
                name.encode(), self.values[name], mavlink.MAV_PARAM_TYPE_REAL32, len(self.values), index
            )
        )


@pytest.fixture
def fake_robot() -> Callable[..., FakeRobot]:
    return FakeRobot


@pytest.fixture
def fake() -> FakeRobot:
    return FakeRobot()


@pytest.fixture
def robot(fake: FakeRobot) -> Iterator[Robot]:
    with connect(fake, clock=fake.clock) as connected:
        yield connected


@pytest.fixture
def firmware() -> Iterator[FirmwareProcess]:
    with FirmwareProcess("three_wheel") as process:
        yield process


@pytest.fixture
def url(firmware: FirmwareProcess) -> str:
    return firmware.urls[0]


@pytest.fixture
def robot_file(tmp_path: Path) -> Path:
    from omniwheel.robots import new_robot_file

    return new_robot_file("mine", "three_wheel", tmp_path)


@pytest.fixture
def sitl() -> Iterator[str]:
    """The robot of `omni sitl` in simulated time, for commands in this process: its URL."""
    with stepped.robot(end_s=600.0) as url:
        yield url
