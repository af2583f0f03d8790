# SPDX-License-Identifier: MIT
"""The processor gets too hot while the robot drives; and what is said of that is said once."""

from __future__ import annotations

from emulated_teensy.machine import FindingKind, Options, Stop
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check
from image_check.stops import driving
from omniwheel.telemetry import Health

HOT_degC, COOL_degC = 95.0, 40.0
"""Teensyduino takes 90 degrees for a fault."""
SLOW = 20
"""Time of an instruction [ns]: a tick still ends within its millisecond."""
PASS_ns = 900_000
"""Time of a pass of the main loop, which then costs few instructions, too."""
OFF_LIMIT_S = 0.002
"""The sensor measures when it likes; then the pin goes with the handler's first instructions."""
RESET_LIMIT_S = 1.0
SAID_S = 0.8
GONE_S = 0.05
"""After a reset: the USB port is gone by then, and not there again yet."""
RESETS = (
    (0x100, "over-temperature", "too hot"),
    (0x80, "watchdog", "watchdog"),
    (0x2, "software", ""),
)
"""Bits of SRC_SRSR, what the robot gives as the cause, and a word of what it says."""


def too_hot(context: Context) -> list[str]:
    """Above the limit the bridges lose their power at once, and the next start says why."""
    expected = frozenset({FindingKind.FAULT, FindingKind.WATCHDOG})
    options = Options(instruction_ns=SLOW, pause_ns=PASS_ns, seed=context.seed)
    with context.bench(options=options, expected=expected) as bench:
        boot(bench)
        driving(bench)
        machine = bench.machine
        machine.stop_on(Stop.RESET)
        machine.set_temperature(HOT_degC)
        begin_s = bench.clock_s()
        bench.until(lambda: not bench.powered, OFF_LIMIT_S, "too hot: bridges off")
        off_s = bench.clock_s() - begin_s
        if machine.run(RESET_LIMIT_S) != Stop.RESET:
            raise CheckError(f"too hot: no restart within {RESET_LIMIT_S:g} s {machine.why}")
        machine.stop_on()
        machine.set_temperature(COOL_degC)
        _says(bench, "over-temperature", "too hot")
    return [f"too hot: bridges off after {1e3 * off_s:.1f} ms, and the next start says so"]


def causes(context: Context) -> list[str]:
    """Resets of several kinds one after the other: each start gives its own cause, and no earlier one's."""
    with context.bench(options=Options(instruction_ns=SLOW, pause_ns=PASS_ns, seed=context.seed)) as bench:
        boot(bench)
        for flags, cause, word in RESETS:
            bench.machine.reset(flags)
            bench.advance(GONE_S)
            _says(bench, cause, word)
    return [f"{', '.join(cause for _, cause, _ in RESETS)}, each told once"]


def _says(bench: Bench, cause: str, word: str) -> None:
    bench.until(lambda: bench.machine.usb_ready, BOOT_LIMIT_S, f"{cause}: USB serial port after the reset")
    robot = bench.connect()
    robot.pump(SAID_S)
    texts = [text.text for text in robot.texts.all]
    told = robot.wait_for(Health).reset_cause
    if told != cause:
        raise CheckError(f"after a reset by {cause} the robot gives {told} as its cause")
    said = [text for text in texts if "restarted" in text]
    if bool(word) != bool(said) or any(word not in text for text in said):
        raise CheckError(f"after a reset by {cause} the robot says {said or 'nothing'}")


CHECKS = (
    Check("too-hot", "the processor gets too hot while the robot drives", too_hot, (CI, NIGHTLY)),
    Check("reset-causes", "each start gives the cause of its own reset", causes, (CI, NIGHTLY)),
)
