# SPDX-License-Identifier: MIT
"""The image hangs or faults while the robot drives: the motors lose their power, and the next start says why."""

from __future__ import annotations

import struct
from collections.abc import Callable

from emulated_teensy.machine import MAIN_LOOP, FindingKind, Options, Stop
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check
from image_check.stops import driving
from image_check.storage import TICK
from omniwheel.telemetry import Health

BRANCH_TO_ITSELF = struct.pack("<H", 0xE7FE)
UNDEFINED = struct.pack("<H", 0xDE00)
NOWHERE = struct.pack("<4H", 0x2003, 0x0700, 0x3001, 0x4700)
"""movs r0, #3; lsls r0, r0, #28; adds r0, #1; bx r0: a jump to 0x30000000, where there is nothing."""
NULL_POINTER = struct.pack("<3H", 0x2000, 0x6800, 0xE7FE)
"""movs r0, #0; ldr r0, [r0]: the memory protection unit forbids it."""
STRAY_INTERRUPT = 54
"""An interrupt that the firmware does not use: the debug controller's."""
SET_ENABLE, SET_PENDING = 0xE000E100, 0xE000E200
"""NVIC_ISER0 and NVIC_ISPR0 (Armv7-M architecture reference manual)."""
WATCHDOG_S = 0.2
WATCHDOG_EARLY_S = 0.01
"""Its clock is 2.4 % fast, and the last time that both ran may be a tick and a pass of the main loop ago."""
TICK_S = 0.001
OFF_INSTRUCTIONS = 20
"""From the bad code to the output-enable pin: in the handler's first instructions, says docs/guides/bring-up.md."""
PINS_LOW_S = 0.002
SAID_S = 0.8
HANG = 20
"""Time of an instruction [ns]: a tick still ends within its millisecond."""

PLACES = {"tick": TICK, "background": MAIN_LOOP}


def _stop_at(bench: Bench, function: str) -> int:
    """Run until the processor comes to a function, and return its address. Raises CheckError."""
    machine = bench.machine
    machine.break_at(function)
    stop = machine.run(5 * TICK_S)
    machine.clear_breaks()
    if stop != Stop.BREAK:
        raise CheckError(f"{function} does not run: {stop.name} {machine.why}")
    return machine.address_of(function)


def _until_reset(bench: Bench, begin_s: float, what: str) -> str:
    """Run until the chip is reset and its boot ROM has run; say how long after ``begin_s``. Raises CheckError."""
    machine = bench.machine
    machine.stop_on(Stop.RESET)
    stop = machine.run(begin_s + 2 * WATCHDOG_S - machine.time_s)
    machine.stop_on()
    if stop != Stop.RESET:
        raise CheckError(f"{what}: no reset within {2e3 * WATCHDOG_S:g} ms: {stop.name} {machine.why}")
    gone_s = machine.time_s - begin_s
    if not WATCHDOG_S - WATCHDOG_EARLY_S <= gone_s <= WATCHDOG_S + TICK_S:
        raise CheckError(f"{what}: started anew after {1e3 * gone_s:.1f} ms, the limit is {1e3 * WATCHDOG_S:g} ms")
    return f"{what}: started anew after {1e3 * gone_s:.1f} ms"


def _says(bench: Bench, wanted: tuple[str, ...], cause: str, what: str) -> None:
    """From the reset on no bridge has power, and the robot says why it restarted. Raises CheckError."""

    def stays_off() -> None:
        if bench.powered:
            raise CheckError(f"{what}: a bridge has power after the reset")

    stays_off()
    with bench.watched(stays_off):
        bench.until(lambda: bench.machine.usb_ready, BOOT_LIMIT_S, f"{what}: USB serial port after the reset")
        robot = bench.connect()
        robot.pump(SAID_S)
        texts = [text.text for text in robot.texts.all]
        told = robot.wait_for(Health).reset_cause
    for words in wanted:
        if not any(words in text for text in texts):
            raise CheckError(
                f'{what}: the robot does not send "{words}" after it, but: {"; ".join(texts) or "nothing"}'
            )
    if told != cause:
        raise CheckError(f"{what}: the robot gives {told} as the cause of its start, not {cause}")
    if robot.status.armed:
        raise CheckError(f"{what}: the robot is armed after it")


def watchdog(context: Context) -> list[str]:
    """An endless loop in the tick, then in the main loop, of a driving robot."""
    figures = []
    expected = frozenset({FindingKind.WATCHDOG})
    with context.bench(options=Options(instruction_ns=HANG, seed=context.seed), expected=expected) as bench:
        boot(bench)
        driving(bench)
        before = bench.machine.snapshot()
        for name, function in PLACES.items():
            bench.machine.restore(before)
            what = f"endless loop in the {name}"
            bench.machine.write(_stop_at(bench, function), BRANCH_TO_ITSELF)
            figures.append(_until_reset(bench, bench.machine.time_s, what))
            _says(bench, ("restarted by the watchdog",), "watchdog", what)
    return [*figures, "no bridge has power from then on, and the robot says why it restarted"]


FAULTS: dict[str, tuple[bytes, Callable[[int], int]]] = {
    "undefined instruction": (UNDEFINED, lambda address: address),
    "null pointer": (NULL_POINTER, lambda address: address + 2),
    "jump to nowhere": (NOWHERE, lambda address: 0x30000000),
}
"""Code, and the address that the crash report names, given the code's."""


def crash(context: Context) -> list[str]:
    """Faults in the tick and in the main loop of a driving robot, and an unexpected interrupt."""
    figures = []
    expected = frozenset({FindingKind.FAULT, FindingKind.WATCHDOG})
    # Not exact, a handler without a branch counts as a whole.
    options = Options(instruction_ns=HANG, exact=True, seed=context.seed)
    with context.bench(options=options, expected=expected) as bench:
        boot(bench)
        driving(bench)
        before = bench.machine.snapshot()
        faults = list(FAULTS.items())
        # How the handler ends does not depend on where the fault was: of the second place, one is enough each time.
        counts = (context.pick(1, 3, 3), context.pick(1, 1, 3))
        for (place, function), count in zip(PLACES.items(), counts, strict=True):
            for name, (code, crash_address) in faults[:count]:
                bench.machine.restore(before)
                address = _stop_at(bench, function)
                bench.machine.write(address, code)
                says = f"crash at 0x{crash_address(address):08X}"
                figures.append(_crash(bench, f"{name} in the {place}", says))
        bench.machine.restore(before)
        _stop_at(bench, MAIN_LOOP)
        for register in (SET_ENABLE, SET_PENDING):
            bench.machine.write_register(register + STRAY_INTERRUPT // 32 * 4, 1 << STRAY_INTERRUPT % 32)
        figures.append(_crash(bench, "stray interrupt", f"unexpected interrupt {STRAY_INTERRUPT}"))
        bench.machine.forget_findings()
    return figures


def _crash(bench: Bench, what: str, says: str) -> str:
    begin_s = bench.machine.time_s
    figure = _output_off(bench, what)
    _until_reset(bench, begin_s, what)
    _says(bench, ("restarted after a crash", says), "crash", what)
    return figure


def _output_off(bench: Bench, what: str) -> str:
    """Count the instructions from a fault to the output-enable pin's release. Raises CheckError."""
    machine, pin = bench.machine, bench.scenario.robot.board.output_enable_pin
    if pin is None and bench.scenario.robot.board.motor_pins:
        bench.advance(PINS_LOW_S)
        if bench.powered:
            raise CheckError(f"{what}: a motor's pin is still high {1e3 * PINS_LOW_S:g} ms later")
        return f"{what}: the motors' pins are low within {1e3 * PINS_LOW_S:g} ms"
    if pin is None:
        return f"{what}: no output-enable pin is wired"
    if machine.pin(pin) != 0:
        raise CheckError(f"{what}: the output-enable pin was not on before")
    begin = machine.instructions
    while machine.pin(pin) == 0 and machine.instructions - begin <= OFF_INSTRUCTIONS:
        if machine.run_until_ns(machine.time_ns + 1) != Stop.TIME:
            raise CheckError(f"{what}: {machine.why}")
    executed = machine.instructions - begin
    if machine.pin(pin) == 0 or executed > OFF_INSTRUCTIONS:
        raise CheckError(f"{what}: the output-enable pin is on for {executed} instructions, {OFF_INSTRUCTIONS} at most")
    bench.advance(TICK_S)
    if bench.powered:
        raise CheckError(f"{what}: a bridge has power although the output-enable pin is off")
    return f"{what}: output-enable off after {executed} instructions"


CHECKS = (
    Check("watchdog", "the tick or the main loop of a driving robot hangs", watchdog, (CI, NIGHTLY)),
    Check("crash", "the tick or the main loop of a driving robot faults", crash),
)
