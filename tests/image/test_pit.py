# SPDX-License-Identifier: MIT
"""The interval timers: 24 MHz as the core sets them, periods, flags, the interrupt."""

from __future__ import annotations

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from omniwheel._core import lib
from tests.image.chip import Chip

PIT = 0x40084000
MCR, LDVAL, CVAL, TCTRL, TFLG = 0, 0x100, 0x104, 0x108, 0x10C
CSCMR1 = 0x400FC01C
ENABLE, INTERRUPT = 1, 2
IRQ_PIT = 122
COUNT_NS = 1e9 / 24e6


@pytest.fixture
def timer(chip: Chip) -> Chip:
    """The timers from the 24 MHz crystal, on ([core] startup.c)."""
    chip.open_gates(1, 6)
    chip.write(CSCMR1, chip.read(CSCMR1) & ~0x3F | 1 << 6)
    chip.write(PIT + MCR, 1)
    return chip


@pytest.mark.parametrize("channel", range(4))
def test_a_period_is_one_count_more_than_its_load(timer: Chip, channel: int) -> None:
    base = PIT + 0x10 * channel
    timer.write(base + LDVAL, 23_999)
    timer.write(base + TCTRL, ENABLE)
    begin_ns = timer.now_ns
    for number in range(1, 4):
        timer.wait(begin_ns + number * 1_000_000 - 500 - timer.now_ns)
        assert timer.read(base + TFLG) == 0
        timer.wait(1_000)
        assert timer.read(base + TFLG) == 1
        timer.write(base + TFLG, 1)
        assert timer.read(base + TFLG) == 0


def test_periods_do_not_drift(timer: Chip) -> None:
    timer.write(PIT + LDVAL, 6)
    timer.write(PIT + TCTRL, ENABLE)
    begin_ns = timer.now_ns
    timer.wait(10_000_000)
    left = timer.read(PIT + CVAL)
    passed = (timer.now_ns - begin_ns) / COUNT_NS
    assert left == pytest.approx(6 - passed % 7, abs=1.5)


def test_a_new_load_waits_for_the_end_of_the_period(timer: Chip) -> None:
    timer.write(PIT + LDVAL, 2_399)
    timer.write(PIT + TCTRL, ENABLE)
    timer.write(PIT + LDVAL, 239)
    timer.wait(95_000)
    assert timer.read(PIT + TFLG) == 0
    timer.wait(6_000)
    timer.write(PIT + TFLG, 1)
    timer.wait(11_000)
    assert timer.read(PIT + TFLG) == 1


def test_the_interrupt_follows_flag_and_enable(timer: Chip) -> None:
    timer.write(PIT + LDVAL, 239)
    timer.write(PIT + TCTRL, ENABLE)
    timer.wait(12_000)
    assert not timer.pending(IRQ_PIT)
    timer.write(PIT + TCTRL, ENABLE | INTERRUPT)
    assert timer.pending(IRQ_PIT)


def test_a_disabled_module_does_not_count(chip: Chip) -> None:
    chip.open_gates(1, 6)
    chip.write(PIT + LDVAL, 23)
    chip.write(PIT + TCTRL, ENABLE)
    chip.wait(10_000)
    assert chip.read(PIT + TFLG) == 0


def test_chained_channels_are_refused(timer: Chip) -> None:
    assert timer.refuses(PIT + TCTRL, 4)


def test_a_gated_clock_is_found(timer: Chip) -> None:
    timer.write(0x400FC06C, timer.read(0x400FC06C) & ~(3 << 12))
    timer.write(PIT + LDVAL, 1)
    assert timer.found(lib.RT1062_FINDING_CLOCK) == ["PIT is used while its clock is off"]
