# SPDX-License-Identifier: MIT
"""A firmware and a bare MAVLink client for it: what the tests here share.

The firmware is the PC's process, or the same on the emulated Cortex-M7 while :func:`on_board` says so.
"""

from __future__ import annotations

import json
import math
import os
import select
import socket
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from omniwheel.emulated_firmware import EmulatedFirmware
from omniwheel.paths import dialect_dir, firmware_path
from tests.waiting import Deadline

WAIT_S = 10.0
GCS = 255
REAL32 = 9
ALL_WHEELS = 0b1111
PCA9685 = 0x40
COUNTS_PER_RAD = 10000 / math.tau  # three_wheel.toml


def load_dialect() -> ModuleType:
    """Return the generated Python dialect."""
    spec = spec_from_file_location("omni_dialect", dialect_dir() / "omni.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


mav = load_dialect()


BOARDS = ("pc", "emulated")
DIRECT = ("direct",)
_board = ["pc"]


@contextmanager
def on_board(name: str) -> Iterator[None]:
    """Run what starts a firmware in here on one of BOARDS."""
    _board.append(name)
    try:
        yield
    finally:
        _board.pop()


@dataclass
class Firmware:
    """A running firmware and where it listens: as a process of this PC, or emulated."""

    own: subprocess.Popen[str] | None
    links: list[str]
    emulated: EmulatedFirmware | None = None

    @property
    def process(self) -> subprocess.Popen[str]:
        """The process on this PC."""
        assert self.own is not None, "this is about the PC firmware: mark the test pc_only"
        return self.own

    def address(self, link: int = 0) -> tuple[str, int]:
        """Return host and port of a TCP link."""
        _, host, port = self.links[link].split(":")
        return host, int(port)


@contextmanager
def firmware(*arguments: str, links: Sequence[str] = ("tcp:127.0.0.1:0",)) -> Iterator[Firmware]:
    """Run omni-firmware and end it at the end, whatever happens."""
    if _board[-1] == "emulated":
        with _emulated(arguments, links) as running:
            yield Firmware(None, list(running.links), running)
        return
    options = [text for link in links for text in ("--link", link)]
    program = os.environ.get("OMNI_FIRMWARE_PC") or str(firmware_path())
    process = subprocess.Popen(
        [program, *options, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        if not line:
            raise AssertionError(f"the firmware did not start: {process.communicate()[1]}")
        yield Firmware(process, json.loads(line)["links"])
    finally:
        process.terminate()
        process.communicate(timeout=WAIT_S)


def _emulated(arguments: Sequence[str], links: Sequence[str]) -> EmulatedFirmware:
    words = iter(arguments)
    options: dict[str, Any] = {"links": links, "program": os.environ.get("OMNI_FIRMWARE_EMULATED")}
    for word in words:
        if word == "--lockstep":
            options["lockstep"] = True
            options["links"] = links if len(links) > 1 else DIRECT
        else:
            assert word == "--storage", f"{word} is not an option of the emulated firmware here"
            options["storage"] = next(words)
    return EmulatedFirmware(**options)


@dataclass
class Tick:
    """What one lockstep tick answered."""

    actuators: Any
    others: list[Any]

    @property
    def i2c(self) -> list[tuple[int, bytes, int]]:
        """The tick's I2C transactions: address, bytes written, count of bytes read."""
        return list(split_i2c(bytes(self.actuators.i2c[: self.actuators.i2c_length])))


def split_i2c(data: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Split the coding of OMNI_HIL_ACTUATORS.i2c."""
    at = 0
    while at < len(data):
        address, count = data[at], data[at + 1]
        yield address, data[at + 2 : at + 2 + count], data[at + 2 + count]
        at += 3 + count


@dataclass
class Client:
    """A ground station of a few lines. In lockstep it is the world too."""

    socket: socket.socket
    inbox: list[Any] = field(default_factory=list)
    time_us: int = 0
    sequence: int = 0
    registers: bytearray = field(default_factory=lambda: bytearray(256))
    read: bytes = b""
    angles: list[float] = field(default_factory=lambda: [0.0] * 4)

    def __post_init__(self) -> None:
        self.mav = mav.MAVLink(self, srcSystem=GCS, srcComponent=190)
        self.mav.robust_parsing = True

    def write(self, data: bytes) -> None:
        """Send raw bytes (pymavlink calls this too)."""
        self.socket.sendall(data)

    def pump(self, timeout_s: float = WAIT_S) -> bool:
        """Take what has arrived. Return False after a silent time-out."""
        if not select.select([self.socket], [], [], timeout_s)[0]:
            return False
        data = self.socket.recv(65536)
        if not data:
            raise ConnectionError("the firmware closed the connection")
        for message in self.mav.parse_buffer(data) or []:
            self.inbox.append(message)
        return True

    def wait(self, *types: str, **fields: Any) -> Any:
        """Return the next message of one of the types with these field values; earlier others stay in the inbox."""

        def wanted(message: Any) -> bool:
            values = message.to_dict()
            return message.get_type() in types and all(values[k] == v for k, v in fields.items())

        return self.wait_for(wanted, f"no {types} with {fields}")

    def wait_for(self, wanted: Callable[[Any], bool], what: str) -> Any:
        """Return the next message that is wanted; earlier others stay in the inbox."""
        deadline = Deadline(lambda: f"{what}; got {[m.get_type() for m in self.inbox]}")
        while True:
            for i, message in enumerate(self.inbox):
                if wanted(message):
                    return self.inbox.pop(i)
            self.pump(deadline.left_s())

    def command(self, command: int, *parameters: float) -> int:
        """Send COMMAND_LONG and return the result of its acknowledgement."""
        padded = [*parameters, *[0.0] * (7 - len(parameters))]
        self.mav.command_long_send(1, 1, command, 0, *padded)
        return int(self.wait("COMMAND_ACK", command=command).result)

    def heartbeat(self) -> None:
        """Show that a ground station is there."""
        self.mav.heartbeat_send(mav.MAV_TYPE_GCS, mav.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def get(self, name: str) -> float:
        """Read a parameter."""
        self.mav.param_request_read_send(1, 1, name.encode(), -1)
        return float(self.wait("PARAM_VALUE", param_id=name).param_value)

    def set(self, name: str, value: float, kind: int = REAL32) -> float:
        """Set a parameter and return the value that the robot answers."""
        self.mav.param_set_send(1, 1, name.encode(), value, kind)
        return float(self.wait("PARAM_VALUE", param_id=name).param_value)

    def texts(self) -> list[str]:
        """Take the status texts out of the inbox."""
        texts = [m.text for m in self.inbox if m.get_type() == "STATUSTEXT"]
        self.inbox = [m for m in self.inbox if m.get_type() != "STATUSTEXT"]
        return texts

    def tick(
        self,
        *,
        counts: Sequence[int] | None = None,
        valid: int = ALL_WHEELS,
        battery_v: float = 12.0,
        nack: bool = False,
        step_us: int = 1000,
    ) -> Tick:
        """Run one lockstep tick: the chip keeps what is written; without ``counts`` the wheels do as they are told."""
        self.time_us += step_us
        self.sequence += 1
        read = self.read.ljust(8, b"\0")
        turned = [int(angle * COUNTS_PER_RAD) for angle in self.angles] if counts is None else list(counts)
        self.mav.omni_hil_sensors_send(
            self.time_us, self.sequence, turned, battery_v, valid, int(nack), len(self.read), list(read)
        )
        actuators = self.wait("OMNI_HIL_ACTUATORS", sequence=self.sequence)
        others, self.inbox = self.inbox, []
        tick = Tick(actuators, others)
        self._store(tick)
        wanted = actuators.wheel_reference
        self.angles = [a + w * step_us * 1e-6 for a, w in zip(self.angles, wanted, strict=True)]
        return tick

    def _store(self, tick: Tick) -> None:
        self.read = b""
        for address, data, count in tick.i2c:
            assert address == PCA9685 or not data  # a scan asks every address
            for offset, byte in enumerate(data[1:]):
                self.registers[data[0] + offset] = byte
            if count:
                self.read = bytes(self.registers[data[0] : data[0] + count])

    def ticks(self, count: int, **sensors: Any) -> list[Tick]:
        """Run several ticks."""
        return [self.tick(**sensors) for _ in range(count)]

    def armed(self) -> Client:
        """Bring a fresh robot in lockstep to the armed state."""
        self.heartbeat()
        self.ticks(20)
        assert self.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mav.MAV_RESULT_ACCEPTED
        assert self.tick().actuators.state == 2
        return self

    def channel(self, number: int) -> int:
        """Return for how many of 4096 steps a PWM channel is high."""
        at = 6 + 4 * number
        _, on_high, off_low, off_high = self.registers[at : at + 4]
        if off_high & 0x10:
            return 0
        return 4096 if on_high & 0x10 else off_low | off_high << 8


def connect(robot: Firmware, link: int = 0) -> Client:
    """Connect to a TCP link, or to a direct one."""
    if robot.emulated is not None and robot.links[link] == DIRECT[0]:
        direct = robot.emulated.open_link(link)
        return Client(socket.socket(fileno=os.dup(direct.fileno())))
    connection = socket.create_connection(robot.address(link), timeout=WAIT_S)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return Client(connection)


@contextmanager
def lockstep_robot(*arguments: str) -> Iterator[Client]:
    """Run a firmware in lockstep and a client for it."""
    with firmware("--lockstep", *arguments) as robot:
        client = connect(robot)
        try:
            yield client
        finally:
            client.socket.close()


def storage_arguments(path: Path) -> tuple[str, str]:
    """Return the options that keep stored parameters in a file."""
    return "--storage", str(path)
