# SPDX-License-Identifier: MIT
"""Power cuts at every command that a save gives to the flash chip: afterwards the old or the new content is there."""

from __future__ import annotations

import random

from emulated_teensy.machine import Options
from image_check.bench import CheckError, Context
from image_check.check import Check
from image_check.storage import CAPACITY, FAST, RESIDUES, Store, other_bytes, replaced

STEP = 4
"""Records of the log begin at multiples of this."""
FULL = 2000
"""Length of a save that fills most of a sector's log."""
STALE_BANKS = 4
"""Sectors in use, of which a start erases all but the newest two."""
RING = 15
MOST_COMMANDS = 400


class _Cutter:
    """Cuts the power in one save after the other and looks at what is left."""

    def __init__(self, store: Store, draw: random.Random) -> None:
        self.store = store
        self.draw = draw
        self.cuts = 0
        self._known: set[tuple[bytes, bytes, bytes]] = set()

    def in_save(self, flash: bytes, offset: int, length: int, *, at_once: int = 1) -> None:
        """Cut at each command of a save that begins with these contents of flash memory.

        ``at_once`` 2 leaves out every other command. Raises CheckError.
        """
        self._open(flash, "before the cut")
        self._cut(self.store.content(), offset, length, at_once)

    def in_next(self, offset: int, length: int, *, at_once: int = 1) -> None:
        """Cut at each command of a save from where the store stands. Raises CheckError."""
        self._cut(self.store.content(), offset, length, at_once)

    def _cut(self, old: bytes, offset: int, length: int, at_once: int) -> None:
        data = other_bytes(self.draw, old[offset : offset + length])
        new = replaced(old, offset, data)
        before = self.store.machine.snapshot()
        for command in range(1, MOST_COMMANDS, at_once):
            for share in (0.0, self.draw.random(), 1.0):
                self.store.machine.restore(before)
                self.store.machine.cut_power_at(command, share)
                if self.store.save(offset, data) is True:
                    return
                what = f"power cut at share {share:.2f} of command {command} of a save of {length} bytes at {offset}"
                self._require_cut(what)
                self.after(self.store.machine.storage, old, new, what)
        raise CheckError(f"a save of {length} bytes gives the flash chip {MOST_COMMANDS} commands")

    def _require_cut(self, what: str) -> None:
        machine = self.store.machine
        if machine.findings():
            raise CheckError(f"{what}: {machine.findings()[0]}")
        if machine.powered:
            raise CheckError(f"{what}: the save ended before it, and not well: {machine.why}")
        self.cuts += 1

    def after(self, flash: bytes, old: bytes, new: bytes, what: str) -> None:
        """Start again: the old or the new content is there, and the next save works. Raises CheckError."""
        if (flash, old, new) in self._known:
            return
        self._open(flash, what)
        content = self.store.content()
        if content not in (old, new):
            raise CheckError(f"{what}: neither the old nor the new content is there")
        at = self.draw.randrange(CAPACITY - RESIDUES)
        data = other_bytes(self.draw, content[at : at + RESIDUES])
        if self.store.save(at, data) is not True:
            raise CheckError(f"{what}: the next save fails {self.store.machine.why}")
        self._open(self.store.machine.storage, what)
        if self.store.content() != replaced(content, at, data):
            raise CheckError(f"{what}: the next save does not read back")
        self._known.add((flash, old, new))

    def in_start(self, flash: bytes, shares: int) -> None:
        """Cut while sectors are erased in a start: nothing is lost. Raises CheckError."""
        self._open(flash, "before the cut")
        content = self.store.content()
        for command in range(1, RING):
            for share in [0.0, *(self.draw.random() for _ in range(shares)), 1.0]:
                stop = self.store.start(flash, cut=(command, share))
                if stop is None:
                    return
                what = f"power cut at share {share:.2f} of erase {command} of a start"
                self._require_cut(what)
                self.after(self.store.machine.storage, content, content, what)

    def _open(self, flash: bytes, what: str) -> None:
        stop = self.store.start(flash)
        if stop is not None or self.store.machine.findings():
            raise CheckError(f"{what}: the store does not open: {stop} {self.store.machine.why}")


def _logs(store: Store, draw: random.Random) -> dict[int, bytes]:
    """Return flash memory with a log that ends at each place modulo 32 at which it can."""
    logs = {}
    for place in range(0, RESIDUES, STEP):
        store.start(b"\xff" * len(store.machine.storage))
        store.change(draw, 1, 0)
        store.change(draw, RESIDUES + place, 0)
        logs[place] = store.machine.storage
    return logs


def power_cuts(context: Context) -> list[str]:
    """Cut at every page program and every erase of saves, of new sectors and of starts."""
    draw = random.Random(context.seed)
    with context.bench(options=Options(instruction_ns=FAST, seed=context.seed)) as bench:
        store = Store(bench)
        cutter = _Cutter(store, draw)
        logs = _logs(store, draw)
        pairs = [(place, length) for place in logs for length in range(1, RESIDUES + 1)]
        draw.shuffle(pairs)
        saves = pairs[:: context.pick(32, 9, 1)]
        for place, length in saves:
            cutter.in_save(logs[place], draw.randrange(CAPACITY - length), length)
        said = f"{len(saves)} saves, of {len(pairs)} pairs of length and place modulo {RESIDUES}"
        figures = [f"{cutter.cuts} cuts in {said}"]
        figures.append(_new_sector(cutter, context.pick(32, 4, 1)))
        figures.append(_used_ring(cutter, context.pick(32, 12, 1)))
        figures.append(_erases_of_a_start(cutter, context.pick(1, 5, 25)))
    return [*figures, "each left the old or the new content, and the next save worked"]


def _new_sector(cutter: _Cutter, at_once: int) -> str:
    """A save into a full log: the next sector takes all of the content."""
    cuts = cutter.cuts
    cutter.store.start(b"\xff" * len(cutter.store.machine.storage))
    cutter.store.change(cutter.draw, 1, 0)
    cutter.store.change(cutter.draw, FULL, 0)
    cutter.in_save(cutter.store.machine.storage, 7, FULL, at_once=at_once)
    return f"{cutter.cuts - cuts} cuts while a new sector is begun"


def _fill(store: Store, draw: random.Random, banks: int) -> bytes:
    store.start(b"\xff" * len(store.machine.storage))
    for number in range(2 * banks):
        store.change(draw, FULL, number)
    return store.machine.storage


def _used_ring(cutter: _Cutter, at_once: int) -> str:
    """The same where the next sector has to be erased first."""
    cuts = cutter.cuts
    _fill(cutter.store, cutter.draw, RING)
    cutter.in_next(3, FULL, at_once=at_once)
    return f"{cutter.cuts - cuts} cuts while the next sector is erased and begun"


def _erases_of_a_start(cutter: _Cutter, shares: int) -> str:
    cuts = cutter.cuts
    cutter.in_start(_fill(cutter.store, cutter.draw, STALE_BANKS), shares)
    return f"{cutter.cuts - cuts} cuts in erases of a start"


CHECKS = (Check("power-cuts", "power cut at every flash command of saves and starts", power_cuts),)
