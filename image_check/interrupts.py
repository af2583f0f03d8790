# SPDX-License-Identifier: MIT
"""Who may interrupt whom: what ``firmware/boards/teensy40/priorities.h`` promises, asked of the running chip."""

from __future__ import annotations

from emulated_teensy.machine import Stop
from image_check.bench import BOOT_LIMIT_S, CheckError, Context
from image_check.check import Check
from image_check.storage import TICK

PRIORITY = 0xE000E400
"""NVIC_IPR0: a byte for each interrupt (Armv7-M architecture reference manual)."""
ENABLED = 0xE000E100
"""NVIC_ISER0."""
TICK_TIMER, ENCODER_PINS = 122, 157
"""PIT, and GPIO6 to 9 (i.MX RT1060 reference manual, chapter Interrupts)."""
I2C = {"I2C": 28, "the gyro's I2C": 30, "the floor-motion sensor's I2C": 31}
"""LPI2C1, LPI2C3 if there is a gyro, LPI2C4 if there is a sensor of motion over the floor."""
LINKS = {"USB": 113, "the radio": 25}
TICKS = 3


def priorities(context: Context) -> list[str]:
    """Encoder edges before the tick; the tick as the I2C master, so that none sees the other half-way; links last."""
    with context.booted() as bench:
        machine = bench.machine
        machine.break_at(TICK)
        if machine.run(BOOT_LIMIT_S) != Stop.BREAK:
            raise CheckError(f"no tick runs {machine.why}")
        machine.clear_breaks()
        bench.advance(TICKS * 0.001)

        def of(number: int) -> int:
            return machine.read_register(PRIORITY + number, 1)

        def enabled(number: int) -> bool:
            return machine.read_register(ENABLED + number // 32 * 4) >> number % 32 & 1 != 0

        tick = of(TICK_TIMER)
        if enabled(ENCODER_PINS) and of(ENCODER_PINS) >= tick:
            raise CheckError(f"encoder edges (priority {of(ENCODER_PINS)}) can't interrupt the tick ({tick})")
        for name, number in I2C.items():
            if enabled(number) and of(number) != tick:
                raise CheckError(f"{name} (priority {of(number)}) and the tick ({tick}) may interrupt each other")
        for name, number in LINKS.items():
            if enabled(number) and of(number) <= tick:
                raise CheckError(f"the interrupt of {name} (priority {of(number)}) keeps the tick ({tick}) waiting")
        links = ", ".join(f"{name} {of(number)}" for name, number in LINKS.items())
        edges = f"encoder edges {of(ENCODER_PINS)}, " if enabled(ENCODER_PINS) else ""
    return [f"{edges}tick and I2C {tick}, {links}"]


CHECKS = (Check("interrupts", "encoder edges before the tick, the tick with the I2C bus, links last", priorities),)
