# SPDX-License-Identifier: MIT
from __future__ import annotations

import ctypes
import random

import pytest

WRAP = 1 << 32


@pytest.mark.parametrize("cycles_per_us", [600, 528, 24, 1])
def test_time_follows_the_cycle_counter_over_its_wraps(chip: ctypes.CDLL, cycles_per_us: int) -> None:
    rng = random.Random(cycles_per_us)
    now = rng.randrange(WRAP)
    first = now
    chip.time_begin(cycles_per_us, now % WRAP)
    for _ in range(3000):
        now += rng.choice([0, 1, rng.randrange(1000), rng.randrange(10**6), rng.randrange(WRAP)])
        assert chip.time_us(now % WRAP) == (now - first) // cycles_per_us
        assert abs(chip.time_ns(now % WRAP) - (now - first) * 1000 // cycles_per_us) <= 1
    assert now - first > 100 * WRAP


def test_a_week_of_ticks_at_600_mhz_does_not_drift(chip: ctypes.CDLL) -> None:
    chip.time_begin(600, WRAP - 1)
    cycles = WRAP - 1
    step = 4_100_000_077  # nearly a whole wrap
    total = 0
    while total < 7 * 86_400 * 600_000_000:
        cycles += step
        total += step
        us = chip.time_us(cycles % WRAP)
    assert us == total // 600


def test_the_board_clock_counts_from_boot_and_goes_on_without_interrupts(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    before = chip.board_now_us()
    chip.fake_cycles((600 * 400_000) % WRAP)  # a 400 ms erase: no SysTick, no tick
    assert chip.board_now_us() - before == pytest.approx(400_000, abs=1)
