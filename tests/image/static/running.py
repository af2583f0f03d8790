# SPDX-License-Identifier: MIT
"""What the emulated chip shows of a running image: its interrupts with their priorities, its stack, its calls."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from emulated_teensy.image_file import read_image
from emulated_teensy.machine import Channel, Machine, Options, Stop
from hil_sim.scenario import load_scenario
from image_check.bench import Bench, Context

VTOR = 0xE000ED08
ENABLED, PRIORITY = 0xE000E100, 0xE000E400
SYSTEM_PRIORITIES = 0xE000ED18
VECTORS = 176
FIRST_INTERRUPT = 16
ALWAYS_ON = range(2, FIRST_INTERRUPT)
FIXED = {2: -2, 3: -1}
"""Priorities of the non-maskable interrupt and of the hard fault (Armv7-M architecture reference manual, B1.5.4)."""
PAINT = struct.pack("<I", 0xC5C5C5C5)
GUARD = 32
"""As in firmware/boards/teensy40/memory.cpp."""
LINK_REGISTER, PROGRAM_COUNTER = 14, 15
BREAK_POINTS = 8
EXCEPTION_RETURN = 0xFFFFFF00


@dataclass(frozen=True)
class Interrupt:
    """An interrupt that can come: its vector, its priority (smaller numbers first), and its function."""

    vector: int
    priority: int
    function: int


@contextmanager
def running(elf_file: Path, robot: str, seed: int = 1) -> Iterator[Bench]:
    """Boot an image with both links in use. Raises what the bench raises."""
    context = Context(read_image(elf_file), load_scenario("stand", robot), seed=seed)
    with context.bench(options=Options(instruction_ns=10, seed=seed)) as bench:
        bench.machine.power_on()
        bench.machine.usb_cable(True)
        bench.until(lambda: bench.machine.usb_ready, 2.0, "USB serial port")
        yield bench


def interrupts(machine: Machine) -> list[Interrupt]:
    """Return what may interrupt the program, as the processor's own registers say."""
    table = struct.unpack(f"<{VECTORS}I", machine.read(machine.read_register(VTOR), 4 * VECTORS))
    found = []
    for vector, entry in enumerate(table):
        number = vector - FIRST_INTERRUPT
        if number >= 0:
            if machine.read_register(ENABLED + number // 32 * 4) >> number % 32 & 1:
                found.append(Interrupt(vector, machine.read_register(PRIORITY + number, 1), entry & ~1))
        elif vector in ALWAYS_ON:
            priority = FIXED[vector] if vector in FIXED else machine.read_register(SYSTEM_PRIORITIES + vector - 4, 1)
            found.append(Interrupt(vector, priority, entry & ~1))
    return found


def used_stack(machine: Machine) -> int:
    """Return how much of the stack has ever been used since the program painted it, in bytes."""
    lowest = machine.address_of("_ebss") + GUARD
    top = machine.address_of("_estack")
    memory = machine.read(lowest, top - lowest)
    at = next(at for at in range(0, len(memory), 4) if memory[at : at + 4] != PAINT)
    return len(memory) - at


def work(bench: Bench) -> None:
    """Drive on a path with telemetry on both links, save, scan, read all parameters: what reaches deep."""
    robot, radio = bench.connect(), bench.connect(Channel.UART)
    robot.pump(1.0)
    robot.parameters.download()
    robot.store()
    robot.arm()
    for _ in range(5):
        robot.drive_duty([0.3] * bench.scenario.robot.wheels, 0.05, stop=False)
        radio.pump(0.05)
    robot.disarm()
    robot.store()


def calls_seen(bench: Bench, functions: Sequence[int], time_s: float, most: int) -> set[tuple[int, int]]:
    """Return (address after the call, function called) as they happen.

    Functions are watched a few at a time, each few for ``time_s`` of the robot's time or ``most`` calls.
    """
    machine = bench.machine
    seen: set[tuple[int, int]] = set()
    for at in range(0, len(functions), BREAK_POINTS):
        for start in functions[at : at + BREAK_POINTS]:
            machine.break_at(start)
        end_s = machine.time_s + time_s
        for _ in range(most):
            if machine.time_s >= end_s or machine.run(end_s - machine.time_s) != Stop.BREAK:
                break
            back = machine.register(LINK_REGISTER)
            if back < EXCEPTION_RETURN:
                seen.add((back & ~1, machine.register(PROGRAM_COUNTER) & ~1))
        machine.clear_breaks()
    return seen
