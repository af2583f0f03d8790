# SPDX-License-Identifier: MIT
"""How the image starts: motors off first, then the PWM chip, the encoders, the links."""

from __future__ import annotations

from hil_sim.image_check.bench import BOOT_LIMIT_S, CheckError, Context, boot
from hil_sim.image_check.check import Check
from hil_sim.rt1062 import Channel

ALL_LED_OFF_LIMIT_S = 0.6
"""From power-on to the first write that stops the motors; docs/teensy.md promises about 0.3 s after the reset."""


def motors_off_first(context: Context) -> list[str]:
    """The output-enable pin never lets go, and the chip is told to stop before anything else."""
    with context.bench() as bench:
        bench.machine.power_on()
        stop_s = None
        while bench.machine.time_s < BOOT_LIMIT_S:
            bench.advance(0.001)
            if bench.powered:
                raise CheckError(f"a bridge input is high {bench.machine.time_s:.3f} s after power-on")
            if stop_s is None and bench.world.c.chip.registers[0xFD] & 0x10:
                stop_s = bench.machine.time_s
        return [f"no bridge input high in {BOOT_LIMIT_S:g} s from power-on"]


def serves_usb(context: Context) -> list[str]:
    """A host enumerates it and gets a heartbeat."""
    with context.bench() as bench:
        boot(bench)
        ready_s = bench.machine.time_s
        robot = bench.connect(Channel.USB)
        robot.pump(1.5)
        version = robot.version
        return [f"serial port {ready_s:.3f} s after power-on", f"answers as {version}"]


CHECKS = (
    Check("motors-off", "from power-on the motors have no power", motors_off_first),
    Check("usb", "the USB link comes up and answers", serves_usb),
)
