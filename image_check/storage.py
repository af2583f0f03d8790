# SPDX-License-Identifier: MIT
"""What the image stores: saves, called inside the image, each read back as the next start would."""

from __future__ import annotations

import random

from emulated_teensy.machine import Machine, Options, Stop
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context
from image_check.check import Check

BEGIN = "_ZN4omni8FlashLog5beginEv"
READ = "_ZN4omni8FlashLog4readEjPhj"
TICK = "_ZN4omni3App4tickEv"
WRITE = "_ZN4omni8FlashLog5writeEjPKhj"
CAPACITY = 2048
"""Bytes that the store keeps (``firmware/boards/teensy40/flash_log.h``)."""
BUFFER = 0x2027D000
"""Memory that the image leaves alone: the end of its heap."""
FAST = 500
"""Time of an instruction [ns] where no tick runs: what waits for the flash chip then costs few of them."""
TICKING = 20
"""The same where ticks run: they still end within their millisecond."""
RESIDUES = 32
"""Lengths and places modulo this are all tried: the unit that the driver programs at once."""
SAVES_BETWEEN_STARTS = 16
BETWEEN_S = 0.002
"""From one save to the next while the robot ticks: its own background runs, too, and feeds the watchdog."""
SAVE_LIMIT_S = 5.0
START_LIMIT_S = 30.0


class Store:
    """The image's store, with its functions called inside the image.

    The machine is switched on and stands where the image's start calls ``FlashLog::begin``: no tick runs yet.
    Raises CheckError.
    """

    def __init__(self, bench: Bench) -> None:
        self.machine: Machine = bench.machine
        self.machine.power_on()
        self.machine.break_at(BEGIN)
        stop = self.machine.run(BOOT_LIMIT_S)
        self.machine.clear_breaks()
        if stop != Stop.BREAK:
            raise CheckError(f"the start does not open the store: {stop.name} {self.machine.why}")
        self.this = self.machine.register(0)
        self._at_start = self.machine.snapshot()

    def run_on(self) -> None:
        """Let the start go on until the ticks run. Raises CheckError."""
        self.machine.restore(self._at_start)
        self.machine.break_at(TICK)
        stop = self.machine.run(BOOT_LIMIT_S)
        self.machine.clear_breaks()
        if stop != Stop.BREAK:
            raise CheckError(f"no tick runs: {stop.name} {self.machine.why}")

    def start(self, flash: bytes | None = None, *, cut: tuple[int, float] | None = None) -> Stop | None:
        """Begin as at a start, with these or the present bytes in flash memory; return what stopped it, if it was.

        ``cut``: the flash command, and the share of it, at which the power is cut.
        """
        flash = self.machine.storage if flash is None else flash
        self.machine.restore(self._at_start)
        self.machine.storage = flash
        if cut is not None:
            self.machine.cut_power_at(*cut)
        result = self.machine.attempt(BEGIN, (self.this,), limit_s=START_LIMIT_S)
        return result if isinstance(result, Stop) else None

    def content(self) -> bytes:
        """Return all that is stored."""
        if not self.machine.call(READ, (self.this, 0, BUFFER, CAPACITY), limit_s=SAVE_LIMIT_S):
            raise CheckError(f"the store does not give its {CAPACITY} bytes")
        return self.machine.read(BUFFER, CAPACITY)

    def save(self, offset: int, data: bytes) -> bool | Stop:
        """Store bytes; return whether it says that it did, or what stopped it."""
        self.machine.write(BUFFER, data)
        result = self.machine.attempt(WRITE, (self.this, offset, BUFFER, len(data)), limit_s=SAVE_LIMIT_S)
        return result if isinstance(result, Stop) else result & 0xFF != 0

    def change(self, draw: random.Random, length: int, offset: int = 0) -> None:
        """Store other bytes than the ones that are there. Raises CheckError if it does not say that it did."""
        done = self.save(offset, other_bytes(draw, self.content()[offset : offset + length]))
        if done is not True:
            raise CheckError(f"a save of {length} bytes at {offset}: {done} {self.machine.why}")


def other_bytes(draw: random.Random, old: bytes) -> bytes:
    """Return as many bytes, each other than the one that is there: the store leaves out what does not change."""
    return bytes(byte ^ draw.randint(1, 255) for byte in old)


def replaced(content: bytes, offset: int, data: bytes) -> bytes:
    """Return the content with these bytes in it."""
    return content[:offset] + data + content[offset + len(data) :]


class _Saver:
    """Saves one by one, compared with what was given."""

    def __init__(self, store: Store, reader: Store, draw: random.Random) -> None:
        self.store = store
        self.draw = draw
        self.saves = 0
        self._reader = reader
        self._expected = store.content()

    def save(self, offset: int, length: int) -> None:
        """Save bytes of this length at this place, and now and then compare what is stored. Raises CheckError."""
        machine = self.store.machine
        data = other_bytes(self.draw, self._expected[offset : offset + length])
        done = self.store.save(offset, data)
        what = f"saving {length} bytes at {offset}"
        if machine.findings():
            raise CheckError(f"{what}: {machine.findings()[0]}")
        if isinstance(done, Stop):
            raise CheckError(f"{what} does not end: {done.name} {machine.why}")
        if not done:
            raise CheckError(f"{what}: the store says that it failed")
        self._expected = replaced(self._expected, offset, data)
        self.saves += 1
        if self.saves % SAVES_BETWEEN_STARTS == 0:
            self.compare()

    def compare(self) -> None:
        """Read back what the next start would find in flash memory. Raises CheckError."""
        stop = self._reader.start(self.store.machine.storage)
        if stop is not None:
            raise CheckError(f"the next start can't read the store: {stop.name} {self._reader.machine.why}")
        content = self._reader.content()
        if content != self._expected:
            wrong = [at for at in range(CAPACITY) if content[at] != self._expected[at]]
            raise CheckError(f"after {self.saves} saves {len(wrong)} bytes read back wrong, the first at {wrong[0]}")


def saves(context: Context) -> list[str]:
    """Saves of all or some lengths, then of pairs of length and place modulo 32 while the robot ticks."""
    draw = random.Random(context.seed)
    with context.bench(options=Options(instruction_ns=FAST, seed=context.seed, words=True)) as quick:
        reader = Store(quick)
        return [_lengths(context, reader, draw), _alignments(context, reader, draw)]


def _lengths(context: Context, reader: Store, draw: random.Random) -> str:
    reader.start()
    saver = _Saver(reader, reader, draw)
    # An odd stride meets every length modulo 32.
    lengths = range(1, CAPACITY + 1, context.pick(29, 7, 1))
    for length in lengths:
        saver.save(draw.randint(0, CAPACITY - length), length)
    saver.compare()
    said = f"{saver.saves} saves of {lengths[0]} to {lengths[-1]} bytes, each {lengths.step} longer"
    return f"{said}, before the ticks run"


def _alignments(context: Context, reader: Store, draw: random.Random) -> str:
    pairs = [(length, place) for length in range(1, RESIDUES + 1) for place in range(RESIDUES)]
    draw.shuffle(pairs)
    with context.bench(options=Options(instruction_ns=TICKING, seed=context.seed)) as bench:
        store = Store(bench)
        store.run_on()
        saver = _Saver(store, reader, draw)
        for length, place in pairs[:: context.pick(4, 3, 1)]:
            saver.save(RESIDUES * draw.randrange(CAPACITY // RESIDUES - 1) + place, length)
            bench.advance(BETWEEN_S)
        saver.compare()
        stack = f"at least {bench.machine.stack_left // 1024} KB of stack are left"
    said = f"saves of {saver.saves} of {len(pairs)} pairs of length and place modulo {RESIDUES}"
    return f"{said} while the robot ticks; {stack}"


CHECKS = (Check("saves", "saves of many lengths and places, nightly of all, read back", saves),)
