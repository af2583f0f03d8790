# SPDX-License-Identifier: MIT
"""Counts read while the wheels are fast are of this very moment, not of the reading before."""

from __future__ import annotations

import math
from itertools import pairwise

from emulated_teensy.machine import Options
from hil_sim.fault_cases import Kind
from image_check.bench import CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.drive import ask_encoders, encoder_driver
from image_check.edges import EDGES_HZ
from image_check.fault_drive import install

QUICK = 20
"""Time of an instruction [ns]: a tick still ends within its millisecond."""
LATER_S = 0.0006
"""From one reading to the next: 24 edges, and no tick in between."""
SAME = 8
"""Counts between two readings that follow each other: what the reading takes, at this slow an emulated processor."""


def read_twice(context: Context) -> list[str]:
    """Two readings one after the other, each of them of its own moment: the second is of later edges, or of none."""
    with context.bench(options=Options(instruction_ns=QUICK, seed=context.seed)) as bench:
        bench.machine.power_on()
        bench.advance(0.6)
        wheels = context.scenario.robot.wheels
        speed = 2.0 * math.pi * EDGES_HZ / float(bench.world.c.config.counts_per_revolution)
        hands = [Kind("wheel_turned", wheel + 1, speed) for wheel in range(wheels)]
        install(bench, hands, float(bench.world.c.time_us) * 1e-6, 1.0)
        bench.advance(0.2)
        driver = encoder_driver(bench)
        bench.advance(LATER_S)
        counts = [ask_encoders(bench, driver) for _ in range(3)]
    between = [
        abs(later - earlier) for first, second in pairwise(counts) for earlier, later in zip(first, second, strict=True)
    ]
    if max(between) > SAME:
        raise CheckError(f"counts read one right after the other: {counts}; the first are of an earlier moment")
    return [f"read one right after the other: at most {max(between)} counts apart"]


CHECKS = (Check("encoder-moment", "a count is of the moment at which it is read", read_twice, (CI, NIGHTLY)),)
