# SPDX-License-Identifier: MIT
"""The Teensy's encoder and I2C code on a fake chip, compiled for this machine."""

from __future__ import annotations

import ctypes
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.native import ROOT, build_library

BOARD = ROOT / "firmware" / "boards" / "teensy40"
HERE = Path(__file__).parent
MAX_READ = 28
START, STOP, NACK, BY_CHIP = 0x1000, 0x2000, 0x100, 0x200
NOTHING, SDA, SCL = range(3)
FOR_EVER = 1 << 30
COUNTERS = (
    *("batches", "nacks", "arbitration_losses", "timeouts", "recoveries"),
    *("scl_stuck", "sda_stuck", "last_us", "longest_us"),
)


def write_wiring_header(out: Path, robot: Path) -> Path:
    """Generate the header of this robot's pins; return the folder to include."""
    generator = ROOT / "shared" / "generate" / "generate.py"
    command = [sys.executable, str(generator), "--out", str(out), "--part", "wiring", "--robot", str(robot)]
    subprocess.run(command, check=True)
    return out / "include"


def build(out: Path, flags: Sequence[str] = ()) -> ctypes.CDLL:
    """Compile the board's inputs and bus, the PWM chip's driver and the fakes."""
    wiring = write_wiring_header(out, ROOT / "shared" / "robots" / "three_wheel.toml")
    sources = [
        *sorted(BOARD.glob("encoders*.cpp")),
        *sorted(BOARD.glob("i2c*.cpp")),
        BOARD / "motor_stop.cpp",
        ROOT / "firmware/app/drivers/pca9685.cpp",
        *(ROOT / "shared" / "core" / "src" / name for name in ("actuate/bridge.c", "math/math.c", "tick/loop.c")),
        ROOT / "hil_sim" / "src" / "pca9685.c",
        *sorted((HERE / "fakes_io").glob("*.cpp")),
        HERE / "io_shim.cpp",
    ]
    includes = [HERE / "fakes_io", wiring, ROOT / "hil_sim" / "include"]
    library = ctypes.CDLL(str(build_library(out, "teensy_io", sources, includes, flags=flags)))
    for name in ("i2c_submit", "driver_tick", "driver_tick_scattered", "motor_stop_step"):
        getattr(library, name).restype = ctypes.c_bool
    library.chip_duty.restype = ctypes.c_double
    library.batch_ns.restype = ctypes.c_uint64
    library.bus_events.restype = ctypes.c_size_t
    library.pin_level.argtypes = [ctypes.c_uint8, ctypes.c_bool]
    return library


@dataclass(frozen=True)
class Transaction:
    """A write, then a read."""

    address: int
    write: bytes = b""
    read: int = 0

    def packed(self) -> bytes:
        return bytes([self.address, len(self.write), self.read]) + self.write

    def events(self, answer: bytes = b"") -> list[int]:
        """Return what should be on the wire if all is acknowledged; ``answer``: the chip's bytes."""
        out: list[int] = []
        if self.write or not self.read:
            out += [START, self.address << 1, *self.write]
        if self.read:
            out += [START, self.address << 1 | 1]
            out += [byte | BY_CHIP for byte in answer[:-1]] + [answer[-1] | BY_CHIP | NACK]
        return out


class Bus:
    """The I2C master and what is on its wires."""

    def __init__(self, library: ctypes.CDLL, speed_hz: int = 1_000_000) -> None:
        self.c = library
        library.chip_reset()
        library.i2c_begin(speed_hz)
        self.read = (ctypes.c_uint8 * MAX_READ)()

    def submit(self, *batch: Transaction) -> bool:
        return bool(self.c.i2c_submit(b"".join(t.packed() for t in batch), len(batch)))

    def poll(self) -> str:
        return ("idle", "busy", "done", "nack", "stuck")[self.c.i2c_poll(self.read)]

    def tick(self, us: int = 1000) -> str:
        self.c.bus_advance_us(us)
        return self.poll()

    def finish(self, ticks: int = 30) -> str:
        """Let time pass until the batch has ended; return how."""
        return next((status for _ in range(ticks) if (status := self.tick()) != "busy"), "busy")

    def events(self) -> list[int]:
        out = (ctypes.c_uint16 * 4096)()
        return list(out[: self.c.bus_events(out, 4096)])

    def counter(self, name: str) -> int:
        out = (ctypes.c_uint32 * len(COUNTERS))()
        self.c.i2c_counters(out)
        return int(out[COUNTERS.index(name)])

    def drive(self, now_us: int, duty: Sequence[float] | None) -> bool:
        """A tick of the motor driver with a duty per wheel; None: off. Return whether it is ready."""
        duties = None if duty is None else (ctypes.c_float * 3)(*duty)
        return bool(self.c.driver_tick(ctypes.c_uint64(now_us), duties))
