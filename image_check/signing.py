# SPDX-License-Identifier: MIT
"""A robot with a signing key stores its clock for a day: sectors used, late erases, ticks."""

from __future__ import annotations

from emulated_teensy.machine import MAIN_LOOP, PROGRAM_COUNTER, Machine, Options, Stop
from image_check.bench import BOOT_LIMIT_S, Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.storage import BUFFER, TICK, TICKING

BOOT = "_ZN4omni7Signing4bootEv"
SET_KEY = "_ZN4omni7Signing7set_keyEPKhy"
ADVANCE = "_ZN4omni7Signing7advanceEy"
STORE_TIME = "_ZN4omni7Signing5storeEy"
ERASE = "eepromemu_flash_erase_sector"
"""Where the erase itself begins: before it the firmware waits for the bus, and a tick may come meanwhile."""
DAY_S = 86400
JUMP_S = 55
"""The clock goes on by so much between its saves: the firmware stores it once it is 50 s ahead."""
STRIDE_us = 5_000_000
"""In steps of so much: a longer one is a jump of the robot's clock, which the signing clock does not follow."""
UNTIL_SAVED_S = 1.0
NO_LATE_ERASE_S = 12 * 3600
"""docs/concepts/teensy.md: some 15 hours use up the sectors that the start has erased."""
TICK_S = 0.001
LATE_S = 0.0005
"""A save starts a tick at most 0.4 ms late (docs/concepts/teensy.md); the next one is on time again."""
ERASE_S = 0.4
"""The longest erase by the flash chip's data sheet."""


class _Clock:
    """The image's signing clock: jumps forward, and what storing it costs."""

    def __init__(self, bench: Bench) -> None:
        self.machine: Machine = bench.machine
        self.saves = 0
        self.erases_s: list[float] = []
        """Day's times of late erases."""
        self.longest_s = 0.0
        self.longest_erase_s = 0.0
        self._last_tick_s = 0.0
        self._erasing = False
        self.machine.power_on()
        self.this = self._stopped_at(BOOT, BOOT_LIMIT_S)
        self._stopped_at(TICK, BOOT_LIMIT_S)
        self.machine.write(BUFFER, bytes(range(1, 33)))
        if self.machine.call(SET_KEY, (self.this, BUFFER, 1, 0)) & 0xFF != 1:
            raise CheckError("the store does not take a signing key")

    def _stopped_at(self, function: str, limit_s: float) -> int:
        self.machine.break_at(function)
        stop = self.machine.run(limit_s)
        self.machine.clear_breaks()
        if stop != Stop.BREAK:
            raise CheckError(f"{function} is not called: {stop.name} {self.machine.why}")
        return self.machine.register(0)

    def jump(self, day_s: float) -> None:
        """Let the clock jump, and look how its save and the ticks get on. Raises CheckError."""
        flash = self.machine.storage
        self._stopped_at(TICK, UNTIL_SAVED_S)
        self._last_tick_s, self._erasing = self.machine.time_s, False
        self._to_main_loop(day_s)  # not while the background itself advances the clock
        time_us = self.machine.time_ns // 1000
        for at_us in range(time_us, time_us + JUMP_S * 1_000_000 + 1, STRIDE_us):
            self.machine.call(ADVANCE, (self.this, 0, at_us & 0xFFFFFFFF, at_us >> 32))
        for function in (TICK, ERASE, STORE_TIME):
            self.machine.break_at(function)
        saves, end_s = self.saves, self.machine.time_s + UNTIL_SAVED_S
        while self.saves == saves and self.machine.time_s < end_s:
            self._step(day_s)
        if self.saves == saves:
            raise CheckError(f"{day_s / 3600:.1f} h: the clock is {JUMP_S} s ahead of the stored one and is not stored")
        self.machine.clear_breaks()
        self._to_main_loop(day_s)
        if self.machine.storage == flash:
            raise CheckError(f"{day_s / 3600:.1f} h: storing the clock changes nothing in flash memory")

    def _to_main_loop(self, day_s: float) -> None:
        for function in (TICK, ERASE, MAIN_LOOP):
            self.machine.break_at(function)
        while self._step(day_s) != self.machine.address_of(MAIN_LOOP):
            pass
        self.machine.clear_breaks()

    def _step(self, day_s: float) -> int:
        """Go on to the next function that is watched, and return its address."""
        stop = self.machine.run(UNTIL_SAVED_S)
        if stop != Stop.BREAK:
            raise CheckError(f"{day_s / 3600:.1f} h, while the clock is stored: {stop.name} {self.machine.why}")
        at = self.machine.register(PROGRAM_COUNTER)
        if at == self.machine.address_of(ERASE):
            self._erasing = True
            self.erases_s.append(day_s)
        elif at == self.machine.address_of(STORE_TIME):
            self.saves += 1
        elif at == self.machine.address_of(TICK):
            self._tick(self._erasing)
            self._erasing = False
        return at

    def _tick(self, erasing: bool) -> None:
        now_s = self.machine.time_s
        gap_s = now_s - self._last_tick_s
        self._last_tick_s = now_s
        if erasing:
            self.longest_erase_s = max(self.longest_erase_s, gap_s)
        else:
            self.longest_s = max(self.longest_s, gap_s)


def signing_clock(context: Context) -> list[str]:
    """The saves of a day, each by the image's own background, with time that jumps from one to the next."""
    day_s = context.pick(3600, DAY_S, 7 * DAY_S)
    with context.bench(options=Options(instruction_ns=TICKING, seed=context.seed)) as bench:
        clock = _Clock(bench)
        for number in range(day_s // JUMP_S):
            clock.jump(number * JUMP_S)
    early = [at_s for at_s in clock.erases_s if at_s < NO_LATE_ERASE_S]
    if early:
        raise CheckError(f"a sector is erased {early[0] / 3600:.1f} h after the start while the robot ticks")
    if clock.longest_s > TICK_S + LATE_S:
        raise CheckError(f"{1e3 * clock.longest_s:.2f} ms from one tick to the next while the clock is stored")
    if clock.longest_erase_s > ERASE_S + 2 * TICK_S:
        raise CheckError(f"{1e3 * clock.longest_erase_s:.0f} ms without a tick in a late erase")
    late = f"{len(clock.erases_s)} late erases"
    if clock.erases_s:
        late += f", the first after {clock.erases_s[0] / 3600:.1f} h"
        late += f", at most {1e3 * clock.longest_erase_s:.0f} ms without a tick"
    return [
        f"{clock.saves} saves in {day_s / 3600:g} h, at most {1e3 * clock.longest_s:.2f} ms from tick to tick",
        late,
    ]


CHECKS = (Check("signing-clock", "the signing clock's saves of a day", signing_clock, (CI, NIGHTLY)),)
