# SPDX-License-Identifier: MIT
"""The radio talks on while a save keeps the program busy: nothing that came meanwhile is lost."""

from __future__ import annotations

import random

from emulated_teensy.machine import Channel, Options
from image_check.bench import CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.storage import TICKING, Store, other_bytes
from omniwheel.dialect import mavlink

PINGS = 5
"""130 bytes: more than Teensyduino keeps by itself, and at 9600 baud no more than these saves take."""
LENGTH = 1000
SAVES = 3
ANSWERS_S = 2.0
SETTLE_S = 0.5


def radio_while_saving(context: Context) -> list[str]:
    """Pings over the radio during long saves are answered, each of them."""
    draw = random.Random(context.seed)
    with context.bench(options=Options(instruction_ns=TICKING, seed=context.seed)) as bench:
        store = Store(bench)
        store.run_on()
        bench.advance(SETTLE_S)
        robot = bench.connect(Channel.UART, heartbeat=False)
        content = store.content()
        begin_s = bench.clock_s()
        for number in range(PINGS):
            robot.send(mavlink.MAVLink_ping_message(0, 1000 + number, 0, 0))
        for _ in range(SAVES):
            data = other_bytes(draw, content[:LENGTH])
            if store.save(0, data) is not True:
                raise CheckError(f"a save of {LENGTH} bytes fails: {bench.machine.why}")
            content = data
        busy_s = bench.clock_s() - begin_s
        answered: set[int] = set()
        robot.connection.add_listener(
            lambda message: answered.add(message.seq) if message.get_type() == "PING" else None
        )
        robot.pump(ANSWERS_S)
    if len(answered) < PINGS:
        raise CheckError(
            f"{PINGS - len(answered)} of {PINGS} pings over the radio were lost while saves took {1e3 * busy_s:.0f} ms"
        )
    return [f"{PINGS} pings over the radio during {1e3 * busy_s:.0f} ms of saves: all answered"]


CHECKS = (Check("radio-backlog", "the radio talks on during a save", radio_while_saving, (CI, NIGHTLY)),)
