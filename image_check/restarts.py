# SPDX-License-Identifier: MIT
"""Whole restarts after the power was cut at random moments: the robot comes up with an old or a new parameter set."""

from __future__ import annotations

import random
import struct
from collections import Counter

from emulated_teensy.machine import Channel, Machine, Options, Stop
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context
from image_check.check import Check
from image_check.storage import BUFFER, TICK

LOAD = "_ZN4omni10ParamStore4loadEPf"
SAVE = "_ZN4omni10ParamStore4saveEPKfS2_"
OK = 0
"""``StoreResult::ok`` (``firmware/app/storage/param_store.h``)."""
QUICK = 40
"""Time of an instruction [ns]: a tick still ends within its millisecond, and a start costs fewer of them."""
BOOT_S = 0.4
"""Cuts during a start are drawn from this time."""
SAVE_S = 0.04
"""And those during a save from this."""
MOST_COMMANDS = 30
SAVES = 2
"""At most so many saves come before the one that is cut."""
LINK_LIMIT_S = 0.5
CUT_IN_START, CUT_IN_ERASE, CUT_IN_COMMAND, CUT_IN_SAVE, CUT_IN_STOP = (
    "starts",
    "erases of a start",
    "flash commands of a save",
    "saves at any time",
    "stops that a start in doubt writes",
)

Values = tuple[float, ...]


def _run_to(machine: Machine, function: str | int, what: str) -> bool:
    """Run until a function is called; return False if the power was cut before. Raises CheckError."""
    machine.break_at(function)
    stop = machine.run(BOOT_LIMIT_S)
    machine.clear_breaks()
    if stop not in (Stop.BREAK, Stop.POWER):
        raise CheckError(f"{what}: {stop.name} {machine.why}")
    return stop == Stop.BREAK


class _Lives:
    """One robot, switched on and off."""

    def __init__(self, bench: Bench, draw: random.Random) -> None:
        self.bench = bench
        self.machine = bench.machine
        self.draw = draw
        self.table = bench.scenario.robot.table
        self.cuts: Counter[str] = Counter()
        self.starts = 0
        self.kept: Counter[str] = Counter()
        self._old: Values = ()
        self._new: Values = ()
        self._in_doubt = False
        """The last write may have been cut short: a start comes up stopped, and writes that."""

    def live(self) -> None:
        """Switch on, check, save, be cut off. Raises CheckError."""
        machine, draw = self.machine, self.draw
        cut = draw.choice((CUT_IN_START, CUT_IN_ERASE, CUT_IN_COMMAND, CUT_IN_SAVE))
        if not self._old:
            cut = CUT_IN_COMMAND
        machine.cut_power_at(1 if cut == CUT_IN_ERASE else 0, draw.random())
        machine.power_on()
        self.starts += 1
        if cut == CUT_IN_START:
            machine.run(draw.uniform(0.0, BOOT_S))
            self.cuts[cut] += 1
            return
        if not self._started():
            self.cuts[cut] += 1
            return
        if not self._serves():
            self.cuts[CUT_IN_STOP] += 1
            return
        for _ in range(draw.randint(0, SAVES)):
            if not self._save(CUT_IN_ERASE if cut == CUT_IN_ERASE else ""):
                return
        self._save(cut)

    def _started(self) -> bool:
        """Return whether the start came as far as the parameters, and look at them."""
        if not _run_to(self.machine, LOAD, "the start does not load parameters"):
            return False
        self._this, place, back = (self.machine.register(number) for number in (0, 1, 14))
        self._place = place
        self._own = self._values(place)
        if not _run_to(self.machine, back, "loading parameters does not end"):
            return False
        loaded = self._values(place)
        if not self._old:
            self._old = self._own
        if loaded not in (self._old, self._new or self._old):
            raise CheckError(f"start {self.starts}: the parameters are neither the old nor the new set")
        self.kept["new" if loaded == self._new else "old"] += bool(self._new)
        self._old, self._new = loaded, ()
        return True

    def _serves(self) -> bool:
        """Return whether it ticks and sends: False if the power was cut while a stop in doubt was written."""
        if not _run_to(self.machine, TICK, f"start {self.starts}: no tick runs"):
            if self._in_doubt:
                return False
            raise CheckError(f"start {self.starts}: flash memory is erased or programmed after the start's beginning")
        self.bench.take(Channel.UART)
        self.bench.until(lambda: bool(self.bench.take(Channel.UART)), LINK_LIMIT_S, f"start {self.starts}: radio")
        self._in_doubt = False
        return True

    def _save(self, cut: str) -> bool:
        """Save a set, with a cut of this kind; return whether the power is still there afterwards."""
        self._new = self._other_set()
        count = 4 * len(self._new)
        self.machine.write(BUFFER, struct.pack(f"<{len(self._new)}f", *self._new))
        self.machine.write(BUFFER + count, struct.pack(f"<{len(self._own)}f", *self._own))
        limit_s = 1.0
        if cut == CUT_IN_SAVE:
            limit_s = self.draw.uniform(0.0, SAVE_S)
        elif cut == CUT_IN_COMMAND:
            share = self.draw.choice((0.0, self.draw.random(), 1.0))
            self.machine.cut_power_at(self.draw.randint(1, MOST_COMMANDS), share)
        result = self.machine.attempt(SAVE, (self._this, BUFFER, BUFFER + count), limit_s=limit_s)
        if isinstance(result, Stop):
            if self.machine.powered and cut != CUT_IN_SAVE:
                raise CheckError(f"saving parameters does not end: {result.name} {self.machine.why}")
            self.cuts[CUT_IN_SAVE if cut == CUT_IN_SAVE else CUT_IN_COMMAND] += 1
            self._in_doubt = True
            return False
        if result & 0xFF != OK:
            raise CheckError(f"saving parameters fails with StoreResult {result & 0xFF}")
        self._old, self._new = self._new, ()
        return True

    def _values(self, place: int) -> Values:
        count = len(self.table.parameters)
        return struct.unpack(f"<{count}f", self.machine.read(place, 4 * count))

    def _other_set(self) -> Values:
        """Return a set in which each real number may be a little off the robot's own."""
        values = list(self._own)
        share = self.draw.random()
        for parameter in self.table.parameters:
            own = values[parameter.index]
            if parameter.kind == "real" and self.draw.random() < share:
                values[parameter.index] = min(
                    max(own * self.draw.uniform(0.99, 1.01), parameter.minimum), parameter.maximum
                )
        return struct.unpack(f"<{len(values)}f", struct.pack(f"<{len(values)}f", *values))


def reboots(context: Context) -> list[str]:
    """Cut the power again and again: in starts, in their erases, in saves."""
    draw = random.Random(context.seed)
    count = context.pick(8, 30, 2000)
    with context.bench(options=Options(instruction_ns=QUICK, seed=context.seed)) as bench:
        lives = _Lives(bench, draw)
        while lives.starts < count:
            lives.live()
            if bench.findings():
                raise CheckError(f"start {lives.starts}: {bench.findings()[0]}")
    where = ", ".join(f"{number} in {cut}" for cut, number in sorted(lives.cuts.items()))
    kept = f"the old set {lives.kept['old']} times, the new one {lives.kept['new']} times"
    return [f"{lives.starts} starts; power cuts: {where}", f"after a save cut short there was {kept}"]


CHECKS = (Check("reboots", "power cuts at random moments, each followed by a whole start", reboots),)
