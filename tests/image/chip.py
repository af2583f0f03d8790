# SPDX-License-Identifier: MIT
"""The emulated chip with a processor that does nothing, to look at one peripheral register by register."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from emulated_teensy.machine import NOTHING_WIRED, Wiring
from hil_sim.world import World
from omniwheel._core import ffi, lib
from tests.image.assembly import Program, assemble
from tests.image.bare import Bare, running

_PARK_IN_RAM = """
main:
    ldr r0, =0x20000100
    movw r1, #0xE7FE            @ b .
    strh r1, [r0]
    orr r0, #1
    bx r0
"""
"""An endless loop in memory that stays readable whatever the flash chip does."""

_PARK_IN_FLASH = """
main: b done
"""


@dataclass
class Chip(Bare):
    """A chip whose registers are accessed from outside."""

    def read(self, address: int, size: int = 4) -> int:
        """Return a register."""
        return int(lib.rt1062_bus_read(self.c, address, size))

    def write(self, address: int, value: int, size: int = 4) -> None:
        """Write a register that there must be."""
        assert lib.rt1062_bus_write(self.c, address, size, value), self.why

    def refuses(self, address: int, value: int, size: int = 4) -> str:
        """Write what the model must refuse; return what it says."""
        assert not lib.rt1062_bus_write(self.c, address, size, value)
        return self.why

    @property
    def now_ns(self) -> int:
        """Return the time since power-on."""
        return int(lib.rt1062_time_ns(self.c))

    def wait(self, nanoseconds: float) -> int:
        """Let time pass; return why it stopped."""
        return int(lib.rt1062_run(self.c, self.now_ns + int(nanoseconds)))

    def open_gates(self, register: int, *gates: int) -> None:
        """Let clocks through: gates CGm of CCM_CCGRn."""
        address = 0x400FC068 + 4 * register
        self.write(address, self.read(address) | sum(3 << 2 * gate for gate in gates))

    def pin(self, teensy_pin: int) -> int:
        """Return a pin's level; -1: nothing drives or pulls it."""
        return int(lib.rt1062_pin(self.c, teensy_pin))

    def drive(self, teensy_pin: int, level: int) -> None:
        """Drive a pin from outside; -1: let it go."""
        lib.rt1062_drive_pin(self.c, teensy_pin, level)

    def pending(self, irq: int) -> bool:
        """Return whether an interrupt waits; it never does once the processor has it."""
        return bool(self.read(0xE000E200 + irq // 32 * 4) >> irq % 32 & 1)

    def flash(self, offset: int, count: int) -> bytes:
        """Return what the flash chip holds."""
        return bytes(ffi.buffer(lib.rt1062_flash(self.c) + offset, count))

    def memory(self, address: int, count: int) -> bytes:
        """Return bytes of memory."""
        data = ffi.new("uint8_t[]", count)
        assert lib.rt1062_read(self.c, address, data, count)
        return bytes(data)

    def put(self, address: int, data: bytes) -> None:
        """Write bytes into memory."""
        assert lib.rt1062_write(self.c, address, data, len(data))

    def put_words(self, address: int, *words: int) -> None:
        """Write words into memory."""
        self.put(address, struct.pack(f"<{len(words)}I", *words))

    def found(self, kind: int) -> list[str]:
        """Return the findings of one kind."""
        every = [lib.rt1062_finding(self.c, number) for number in range(lib.rt1062_findings(self.c))]
        return [str(ffi.string(finding.text).decode()) for finding in every if finding.kind == kind]


def parked_program(folder: Path, *, in_flash: bool = False) -> Program:
    """Return a program that only waits."""
    return assemble(_PARK_IN_FLASH if in_flash else _PARK_IN_RAM, folder)


@contextmanager
def parked(
    program: Program, *, seed: int = 1, wiring: Wiring = NOTHING_WIRED, world: World | None = None
) -> Iterator[Chip]:
    """Power the chip on and let the program come to its loop."""
    with running(program, seed=seed, wiring=wiring, world=world) as bare:
        chip = Chip(bare.c, bare.program, bare.begin_ns)
        assert chip.wait(100_000) == lib.RT1062_STOP_TIME, chip.why
        yield chip
