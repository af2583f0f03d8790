# SPDX-License-Identifier: MIT
"""Flash memory that is worn, or must not be touched; and how long its driver waits for the bus."""

from __future__ import annotations

import random
from collections.abc import Iterator
from contextlib import contextmanager

from emulated_teensy.machine import MAIN_LOOP, STORAGE_BEGIN, FindingKind, Machine, Options, Stop
from image_check.bench import CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.ring import SECTOR
from image_check.storage import FAST, TICKING, Store, other_bytes

ERASE = "_ZN4omni13Teensy40Flash5eraseEj"
ERASE_COMMAND = "eepromemu_flash_erase_sector"
FLASH_AT = 4
"""``FlashLog::flash_``, behind the table of virtual functions."""
LONG = 1500
WORN = 64
ROUNDS = 34
"""Saves of this length use every sector of the ring."""
TICK_S = 0.001
BUS_LIMIT_S = 0.0015
"""An update of the PWM chip ends within this, even at 100 kHz; the erase then begins."""
LATEST_S = 0.02


def worn_cells(context: Context) -> list[str]:
    """Cells that keep a 0 where the next record goes: the save goes elsewhere, or says that it failed."""
    draw = random.Random(context.seed)
    expected = frozenset({FindingKind.FLASH})
    with context.bench(options=Options(instruction_ns=FAST, seed=context.seed), expected=expected) as bench:
        store = Store(bench)
        store.start()
        store.change(draw, LONG)
        store.change(draw, WORN)
        flash = bytearray(store.machine.storage)
        free = max(at for at in range(SECTOR) if flash[at] != 0xFF) + 1
        flash[free + WORN : free + 2 * WORN] = bytes(WORN)
        store.machine.storage = bytes(flash)
        before = store.content()
        data = other_bytes(draw, before[: 3 * WORN])
        done = store.save(0, data)
        wanted = data + before[len(data) :] if done is True else before
        stop = store.start()
        if stop is not None or store.content() != wanted:
            raise CheckError(
                f"worn cells: the store says {'stored' if done is True else 'failed'}, and a start finds other bytes"
            )
    return ["cells that cannot be programmed: the save goes to another sector"]


def only_its_own(context: Context) -> list[str]:
    """Saves over the whole ring of sectors change nothing beside it: not the program, not the restore sector."""
    draw = random.Random(context.seed)
    with context.bench(options=Options(instruction_ns=FAST, seed=context.seed)) as bench:
        store = Store(bench)
        store.start()
        with _beside(store.machine):
            for _ in range(ROUNDS):
                store.change(draw, LONG)
    return [f"{ROUNDS} saves, more than once round the ring: nothing beside it changes"]


@contextmanager
def _beside(machine: Machine) -> Iterator[None]:
    """Raise CheckError if flash memory beside the store changes. Its neighbours are filled, so that an erase shows."""
    begin, size = STORAGE_BEGIN, len(machine.storage)
    machine.flash[begin + size : begin + size + SECTOR] = b"\x5a" * SECTOR
    machine.flash[begin - SECTOR : begin] = b"\x5a" * SECTOR
    before = bytes(machine.flash)
    yield
    after = bytes(machine.flash)
    others = (at for at in range(0, len(after), SECTOR) if not begin <= at < begin + size)
    wrong = [at for at in others if after[at : at + SECTOR] != before[at : at + SECTOR]]
    if wrong:
        raise CheckError(f"saving changes flash memory at 0x{wrong[0]:06X}, which is not the store's")


def waits_no_longer(context: Context) -> list[str]:
    """An erase lets the bus's update end first, and begins as soon as it has."""
    with context.bench(options=Options(instruction_ns=TICKING, seed=context.seed)) as bench:
        store = Store(bench)
        store.run_on()
        machine = store.machine
        flash = int.from_bytes(machine.read(store.this + FLASH_AT, 4), "little")
        bench.advance(0.1)
        before = machine.snapshot()
        longest_s = 0.0
        for tenth in range(10):
            machine.restore(before)
            bench.advance(tenth * TICK_S / 10)
            _to_background(machine)
            begin_s = machine.time_s
            machine.break_at(ERASE_COMMAND)
            stop = machine.attempt(ERASE, (flash, 14), limit_s=2 * LATEST_S)
            machine.clear_breaks()
            if stop != Stop.BREAK:
                raise CheckError(f"an erase does not begin within {2 * LATEST_S:g} s: {machine.why}")
            longest_s = max(longest_s, machine.time_s - begin_s)
    if longest_s > BUS_LIMIT_S:
        raise CheckError(f"an erase waits {1e3 * longest_s:.1f} ms for an update that takes less than one")
    return [f"an erase begins at most {1e3 * longest_s:.2f} ms after it is asked for"]


def _to_background(machine: Machine) -> None:
    """Run on to the main loop: what saves is the background, and no tick is under way."""
    machine.break_at(MAIN_LOOP)
    stop = machine.run(LATEST_S)
    machine.clear_breaks()
    if stop != Stop.BREAK:
        raise CheckError(f"the main loop does not run: {stop.name} {machine.why}")


CHECKS = (
    Check("worn-flash", "cells of flash memory that cannot be programmed any more", worn_cells, (CI, NIGHTLY)),
    Check("flash-beside", "saves change nothing beside the store", only_its_own, (CI, NIGHTLY)),
    Check("erase-wait", "an erase waits for the bus, and no longer", waits_no_longer, (CI, NIGHTLY), chip=True),
)
