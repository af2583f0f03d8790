# SPDX-License-Identifier: MIT
"""A small robot made of pymavlink, for the lockstep runner over a socket pair."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable
from types import ModuleType
from typing import Any

from hil_sim.record import Record
from hil_sim.world import World
from omniwheel._core import ffi, lib

WAKE = bytes([0x40, 2, 0x00, 0x21, 0])
NO_FAULT = 0


class EchoRobot:
    """Answers every OMNI_HIL_SENSORS from a thread; subclass hooks by passing `respond`."""

    def __init__(self, dialect: ModuleType, sock: socket.socket, respond: Callable[[EchoRobot, Any], None]) -> None:
        self.dialect = dialect
        self.sock = sock
        self.mav = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        self.respond = respond
        self.seen: list[Any] = []
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self) -> None:
        with contextlib.suppress(ConnectionError):  # the test may end before the last answer
            while data := self.sock.recv(4096):
                for message in self.mav.parse_buffer(data) or []:
                    self.seen.append(message)
                    if message.get_type() == "OMNI_HIL_SENSORS":
                        self.respond(self, message)

    def answer_bytes(self, sensors: Any, i2c: bytes = WAKE, sequence: int | None = None) -> bytes:
        message = self.dialect.MAVLink_omni_hil_actuators_message(
            sensors.time_us,
            sensors.sequence if sequence is None else sequence,
            [1.0, 2.0, 3.0],
            [4.0, 5.0, 6.0],
            [7.0, 8.0, 9.0, 0.0],
            0.5,
            0.25,
            NO_FAULT,
            17,
            2,
            1,
            len(i2c),
            1,
            list(i2c) + [0] * (128 - len(i2c)),
        )
        return bytes(message.pack(self.mav))

    def heartbeat_bytes(self) -> bytes:
        return bytes(self.dialect.MAVLink_heartbeat_message(10, 0, 0, 0, 3, 3).pack(self.mav))

    def of_type(self, name: str) -> list[Any]:
        return [message for message in self.seen if message.get_type() == name]


def answer(robot: EchoRobot, sensors: Any) -> None:
    robot.sock.sendall(robot.answer_bytes(sensors))


class Bench:
    """Both ends of a link with an echo robot on one of them."""

    def __init__(self, dialect: ModuleType, *, looks: bool = True) -> None:
        self.dialect = dialect
        self.ours, self.theirs = socket.socketpair()
        self.link: Any = ffi.new("hil_lockstep_t *")
        lib.hil_lockstep_init(self.link, self.ours.fileno(), 255, 190)
        lib.hil_waiting_init(ffi.addressof(self.link, "waiting"), looks)
        self.link.timeout_s = 20.0
        self.done = ffi.new("uint64_t *")
        self.robots: list[EchoRobot] = []

    def robot(self, respond: Callable[[EchoRobot, Any], None] = answer) -> EchoRobot:
        self.robots.append(EchoRobot(self.dialect, self.theirs, respond))
        return self.robots[-1]

    def close(self) -> None:
        self.ours.close()
        for robot in self.robots:
            robot.thread.join()
        self.theirs.close()

    def run(self, world: World, ticks: int, record: Record | None = None) -> int:
        target = ffi.NULL if record is None else record.c
        return int(lib.hil_lockstep_run(self.link, world.c, ticks, target, self.done))
