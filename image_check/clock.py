# SPDX-License-Identifier: MIT
"""The image's clock: over the wrap of the cycle counter, and read while the tick reads it, too."""

from __future__ import annotations

from emulated_teensy.machine import Options, Stop
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context, boot
from image_check.check import CI, NIGHTLY, Check
from image_check.storage import TICK
from omniwheel.robot import Robot
from omniwheel.telemetry import Status

NOW = "_ZN4omni13Teensy40Clock6now_usEv"
WRAP_S = 2**32 / 600e6
"""The cycle counter has 32 bits and counts 600 million a second."""
RUN = 50
"""Time of an instruction [ns]: a tick still ends within its millisecond, and seconds cost few of them."""
PASS_ns = 900_000
"""Time of a pass of the main loop, which then costs few instructions, too."""
STEP_S = 0.25
DRIFT_S = 0.002
APART_US = 3
"""Between the clock read twice and the machine's own time: what the reading takes, and rounding."""
CALL_LIMIT_S = 0.01
ANSWER_S = 0.1
PERIOD_ns = 1_000_000
INSTRUCTIONS = 80
"""So many, back from the tick: the whole of the reading is among them."""


def wrap(context: Context) -> list[str]:
    """The robot's time goes on with the machine's while the cycle counter begins anew; no tick finds a fault in it."""
    with context.bench(options=Options(instruction_ns=RUN, pause_ns=PASS_ns, seed=context.seed)) as bench:
        boot(bench)
        robot = bench.connect()
        robot.pump(0.5)
        offset_s = _told_s(bench, robot) - bench.clock_s()
        worst_s = 0.0
        while bench.clock_s() < WRAP_S + 2 * STEP_S:
            robot.pump(STEP_S)
            worst_s = max(worst_s, abs(_told_s(bench, robot) - bench.clock_s() - offset_s))
            if worst_s > DRIFT_S:
                raise CheckError(
                    f"{bench.clock_s():.2f} s after power-on the robot's clock is {worst_s:.3f} s off; "
                    f"the cycle counter begins anew every {WRAP_S:.2f} s"
                )
    return [f"{WRAP_S + 2 * STEP_S:.1f} s, over the wrap of the cycle counter: at most {1e3 * worst_s:.1f} ms off"]


def _told_s(bench: Bench, robot: Robot) -> float:
    """Ask the robot what time it is."""
    robot.commands.request_message(Status.message, ANSWER_S)
    status = robot.status.safety
    if status is None:
        raise CheckError(f"{bench.clock_s():.2f} s after power-on the robot does not send its time")
    return status.time_s


def read_while_ticking(context: Context) -> list[str]:
    """The background reads the clock; the tick, which reads it, too, comes before each instruction in turn."""
    options = Options(exact=True, seed=context.seed)
    with context.bench(options=options) as bench:
        boot(bench)
        machine = bench.machine
        _stop_at(bench, TICK)
        clock = _stop_at(bench, NOW)
        _stop_at(bench, TICK)
        tick_ns = machine.time_ns
        machine.run_until_ns(tick_ns + PERIOD_ns // 4)
        quiet_us = _read_us(bench, clock) - machine.time_ns // 1000
        before = machine.snapshot()
        for instruction in range(0, INSTRUCTIONS, context.pick(4, 1, 1)):
            machine.restore(before)
            machine.run_until_ns(tick_ns + PERIOD_ns - instruction * options.instruction_ns)
            _read_us(bench, clock)
            machine.run_until_ns(machine.time_ns + PERIOD_ns // 4)  # no tick comes into the second reading
            off_us = _read_us(bench, clock) - machine.time_ns // 1000 - quiet_us
            if abs(off_us) > APART_US:
                raise CheckError(f"a tick in the middle of reading the clock: it is {off_us} us off from then on")
    return [f"a tick before each of {INSTRUCTIONS} instructions of the reading: never off by more than {APART_US} us"]


def _stop_at(bench: Bench, function: str) -> int:
    """Run until the processor comes to a function; return its first argument. Raises CheckError."""
    machine = bench.machine
    machine.break_at(function)
    stop = machine.run(BOOT_LIMIT_S)
    machine.clear_breaks()
    if stop != Stop.BREAK:
        raise CheckError(f"{function} does not run: {stop.name} {machine.why}")
    return machine.register(0)


def _read_us(bench: Bench, clock: int) -> int:
    return bench.machine.call(NOW, (clock,), limit_s=CALL_LIMIT_S)


CHECKS = (
    Check("clock-wrap", "the clock over the wrap of the cycle counter", wrap, (CI, NIGHTLY)),
    Check("clock-read", "the clock read while a tick comes in between", read_while_ticking, (CI, NIGHTLY)),
)
