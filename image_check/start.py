# SPDX-License-Identifier: MIT
"""How the image starts: motors off first, then the PWM chip, the encoders, the links."""

from __future__ import annotations

from emulated_teensy.machine import Channel
from image_check.bench import BOOT_LIMIT_S, CheckError, Context, boot
from image_check.check import SHORT, Check


def motors_off_first(context: Context) -> list[str]:
    """The output-enable pin never lets go, and no bridge gets anything."""
    pin = context.scenario.robot.board.output_enable_pin
    end_s = context.pick(1, 2, 2) * BOOT_LIMIT_S / 2
    with context.bench() as bench:
        bench.machine.power_on()
        while bench.machine.time_s < end_s:
            bench.advance(0.001)
            if bench.powered:
                raise CheckError(f"a bridge input is high {bench.machine.time_s:.3f} s after power-on")
            if pin is not None and bench.machine.pin(pin) == 0:
                raise CheckError(f"the output-enable pin is on {bench.machine.time_s:.3f} s after power-on")
    figures = [f"no bridge input high in {end_s:g} s from power-on"]
    return [*figures, f"output-enable off on pin {pin}" if pin is not None else "this robot has no output-enable pin"]


def serves_usb(context: Context) -> list[str]:
    """A host enumerates it and gets a heartbeat."""
    with context.bench(options=context.options(words=context.depth != SHORT)) as bench:
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
