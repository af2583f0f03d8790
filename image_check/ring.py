# SPDX-License-Identifier: MIT
"""A store whose sectors are all in use: erases while the robot ticks, and a start that has many to erase."""

from __future__ import annotations

import random

from emulated_teensy.i2c_wave import STOP, Edge, read_wave
from emulated_teensy.machine import Options
from image_check.bench import CheckError, Context
from image_check.bus import ALL_LED_OFF, OFF_LIMIT_S
from image_check.check import CI, NIGHTLY, Check
from image_check.storage import FAST, TICKING, Store

SECTOR = 4096
LONG = 1500
"""Two saves of this length do not fit into one sector's log."""
ERASES = 6
"""A sector takes 45 to 400 ms: of so many some take longer than the watchdog waits otherwise."""
REST_S = 0.02
USED = b"\0" * SECTOR


def erase_while_ticking(context: Context) -> list[str]:
    """Every save that needs a new sector must erase it first; meanwhile no tick runs, and the watchdog must bear it."""
    draw = random.Random(context.seed)
    with context.bench(options=Options(instruction_ns=TICKING, seed=context.seed)) as bench:
        store = Store(bench)
        store.run_on()
        machine = store.machine
        store.change(draw, 1)
        machine.storage = machine.storage[:SECTOR] + USED * (len(machine.storage) // SECTOR - 1)
        longest_s = 0.0
        for _ in range(2 * ERASES):
            begin_s = machine.time_s
            store.change(draw, LONG)
            longest_s = max(longest_s, machine.time_s - begin_s)
            bench.advance(REST_S)
    return [f"{2 * ERASES} saves over used sectors while the robot ticks; the longest took {longest_s:.2f} s"]


def off_before_erases(context: Context) -> list[str]:
    """At a start with used sectors the motors are told to stop before seconds go by in erasing."""
    draw = random.Random(context.seed)
    with context.bench(options=Options(instruction_ns=FAST, seed=context.seed)) as quick:
        store = Store(quick)
        store.start()
        store.change(draw, LONG)
        used = store.machine.storage[:SECTOR] + USED * (len(store.machine.storage) // SECTOR - 1)
    with context.bench() as bench:
        bench.machine.storage = used
        bench.machine.power_on()
        edges: list[Edge] = []
        while STOP not in read_wave(edges).events:
            if bench.machine.time_s > OFF_LIMIT_S:
                raise CheckError(f"nothing on the bus within {OFF_LIMIT_S:g} s of a start with sectors to erase")
            bench.advance(0.005)
            edges += bench.machine.i2c_edges()
        if read_wave(edges).bytes[1:3] != ALL_LED_OFF or edges[-1].time_ns * 1e-9 > OFF_LIMIT_S:
            raise CheckError("at a start with sectors to erase ALL_LED_OFF is not the first on the bus")
        stopped_s = edges[-1].time_ns * 1e-9
    return [f"a start with sectors to erase: ALL_LED_OFF {stopped_s:.3f} s after power-on"]


CHECKS = (
    Check("late-erases", "saves that must erase a sector while the robot ticks", erase_while_ticking, (CI, NIGHTLY)),
    Check("off-before-erases", "motors off before a start erases sectors", off_before_erases, (CI, NIGHTLY), chip=True),
)
