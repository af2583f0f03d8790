# SPDX-License-Identifier: MIT
"""The output-enable pin from the reset on, looked at after each instruction that could let the bridges on."""

from __future__ import annotations

from emulated_teensy.machine import FindingKind, Options, Stop
from image_check.bench import BOOT_LIMIT_S, CheckError, Context
from image_check.check import Check

FUNCTIONS = ("startup_middle_hook", "_ZN4omni20Teensy40OutputEnable5beginEv")
"""Those that set the pin up: one soon after the reset, one in the program's own start."""
INSTRUCTIONS = 200
DRIVEN_S = 0.1
"""From power-on. The boot ROM takes 55 ms of it, and until then nothing but the pull-up holds the pin."""


def never_low(context: Context) -> list[str]:
    """Never low for a single instruction while it is set up; and driven early, not only pulled."""
    pin = context.scenario.robot.board.output_enable_pin
    if pin is None:
        return ["this robot has no output-enable pin"]
    options = Options(exact=True, seed=context.seed)
    with context.bench(options=options) as bench:
        machine = bench.machine
        machine.power_on()
        for function in FUNCTIONS:
            machine.break_at(function)
            stop = machine.run(BOOT_LIMIT_S)
            machine.clear_breaks()
            if stop != Stop.BREAK:
                raise CheckError(f"{function} does not run: {stop.name} {machine.why}")
            begin_ns = machine.time_ns
            for instruction in range(INSTRUCTIONS):
                machine.run_until_ns(begin_ns + instruction * options.instruction_ns)
                if machine.pin(pin) != 1:
                    raise CheckError(f"the output-enable pin is low {instruction} instructions into {function}")
    return [f"high after each of {INSTRUCTIONS} instructions of {len(FUNCTIONS)} set-ups", _driven(context, pin)]


def _driven(context: Context, pin: int) -> str:
    """Hold the pin down, as some boards do: the model objects as soon as the processor holds it up."""
    with context.bench(expected=frozenset({FindingKind.PINS})) as bench:
        bench.machine.power_on()
        bench.machine.drive_pin(pin, 0)
        while not bench.findings():
            if bench.clock_s() > DRIVEN_S:
                raise CheckError(f"{DRIVEN_S:g} s after power-on only its pull-up holds the output-enable pin")
            bench.advance(0.001)
        return f"driven high {bench.clock_s():.3f} s after power-on"


CHECKS = (Check("enable-pin", "the output-enable pin is driven high early and never low at a start", never_low),)
