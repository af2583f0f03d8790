# SPDX-License-Identifier: MIT
"""Clock registers, supply and temperature: what the core waits for, and what the model objects to."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from omniwheel._core import lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked, parked_program

CACRR, CBCDR, CDHIPR, CCGR6 = 0x400FC010, 0x400FC014, 0x400FC048, 0x400FC080
PLL_ARM, PLL_USB1, TEMPSENSE0, TEMPSENSE1, TEMPSENSE2 = 0x400D8000, 0x400D8010, 0x400D8180, 0x400D8190, 0x400D8290
DCDC_REG0, DCDC_REG3, OCOTP_ANA1 = 0x40080000, 0x4008000C, 0x401F44E0
NVIC_PENDING = 0xE000E200
PANIC = 64
LOCK = 1 << 31


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Return a program that waits in RAM."""
    return parked_program(tmp_path_factory.mktemp("parked"))


@pytest.fixture
def chip(program: Program) -> Iterator[Chip]:
    """Return a chip that waits in RAM."""
    with parked(program) as chip:
        yield chip


def test_a_pll_needs_its_time_to_lock(chip: Chip) -> None:
    assert chip.read(PLL_ARM) & LOCK
    chip.write(PLL_ARM, 1 << 12)
    chip.write(PLL_ARM, 1 << 13 | 100)
    assert not chip.read(PLL_ARM) & LOCK
    chip.wait(90_000)
    assert not chip.read(PLL_ARM) & LOCK
    chip.wait(10_000)
    assert chip.read(PLL_ARM) & LOCK


def test_set_clear_and_toggle(chip: Chip) -> None:
    chip.write(PLL_USB1 + 4, 1 << 6)
    assert chip.read(PLL_USB1) & 1 << 6
    chip.write(PLL_USB1 + 8, 1 << 6)
    assert not chip.read(PLL_USB1) & 1 << 6
    chip.write(PLL_USB1 + 12, 1 << 6)
    assert chip.read(PLL_USB1) & 1 << 6


def test_dividers_shake_hands(chip: Chip) -> None:
    chip.write(CACRR, 3)
    assert chip.read(CDHIPR) == 1 << 16
    chip.wait(2000)
    assert chip.read(CDHIPR) == 0
    chip.write(CBCDR, chip.read(CBCDR) | 1 << 25)
    chip.write(CACRR, 1)
    assert any("handshake" in text for text in chip.found(lib.RT1062_FINDING_CLOCK))


@pytest.mark.parametrize(("address", "value"), [(CACRR, 8), (PLL_ARM, 1 << 20), (DCDC_REG3, 1 << 6)])
def test_reserved_bits_are_refused(chip: Chip, address: int, value: int) -> None:
    assert "does not know" in chip.refuses(address, value)


def test_registers_that_are_not_modelled_are_refused(chip: Chip) -> None:
    assert "no such register" in chip.refuses(0x400FC058, 0)
    assert "no such register" in chip.refuses(CACRR, 0, size=2)


def test_the_core_voltage_needs_its_gate_and_its_time(chip: Chip) -> None:
    chip.write(DCDC_REG3, (chip.read(DCDC_REG3) & ~0x1F) | 0x12)
    assert chip.found(lib.RT1062_FINDING_CLOCK) != []
    lib.rt1062_forget_findings(chip.c)
    chip.write(CCGR6, chip.read(CCGR6) | 3 << 6)
    chip.write(DCDC_REG3, chip.read(DCDC_REG3) + 1)
    assert not chip.read(DCDC_REG0) & LOCK
    chip.wait(60_000)
    assert chip.read(DCDC_REG0) & LOCK
    assert chip.found(lib.RT1062_FINDING_CLOCK) == []


def temperature(chip: Chip) -> float:
    """Compute the temperature as the core's tempmon.c does."""
    ana1 = chip.read(OCOTP_ANA1)
    hot, hot_count, room_count = ana1 & 0xFF, ana1 >> 8 & 0xFFF, ana1 >> 20
    count = chip.read(TEMPSENSE0) >> 8 & 0xFFF
    return hot - (count - hot_count) * (hot - 25) / (room_count - hot_count)


def test_measures_the_temperature(chip: Chip) -> None:
    chip.write(TEMPSENSE0, chip.read(TEMPSENSE0) & ~1)
    chip.write(TEMPSENSE1, 3)
    chip.write(TEMPSENSE0, chip.read(TEMPSENSE0) | 2)
    assert not chip.read(TEMPSENSE0) & 4
    chip.wait(200_000)
    assert chip.read(TEMPSENSE0) & 4
    assert temperature(chip) == pytest.approx(40, abs=0.4)
    lib.rt1062_set_temperature(chip.c, 71)
    assert temperature(chip) == pytest.approx(71, abs=0.4)


def test_panics_when_it_is_too_hot(chip: Chip) -> None:
    chip.write(TEMPSENSE0, chip.read(TEMPSENSE0) & ~1)
    at_90_degC = 1195 + round((105 - 90) * (1454 - 1195) / 80)
    chip.write(TEMPSENSE2, at_90_degC << 16)
    chip.write(TEMPSENSE0, chip.read(TEMPSENSE0) | 2)
    lib.rt1062_set_temperature(chip.c, 88)
    pending = NVIC_PENDING + 4 * (PANIC // 32)
    assert not chip.read(pending) & 1 << PANIC % 32
    lib.rt1062_set_temperature(chip.c, 92)
    assert chip.read(pending) & 1 << PANIC % 32


def test_pulse_timers_take_their_setting_up_and_no_more(chip: Chip) -> None:
    """As pwm_init() of the core leaves them; a program that goes on to use them is refused."""
    flexpwm1, timer1, ccgr4 = 0x403DC000, 0x401DC000, 0x400FC078
    chip.write(flexpwm1 + 0x188, 0xF0, size=2)
    assert chip.found(lib.RT1062_FINDING_CLOCK) != []
    lib.rt1062_forget_findings(chip.c)
    chip.write(ccgr4, chip.read(ccgr4) | 3 << 16)
    chip.write(flexpwm1 + 0x188, chip.read(flexpwm1 + 0x188, 2) | 0xF00, size=2)
    assert chip.read(flexpwm1 + 0x188, 2) == 0xF00
    assert chip.found(lib.RT1062_FINDING_CLOCK) == []
    assert "no such register" in chip.refuses(flexpwm1 + 0x182, 0x100, size=2)  # MASK
    assert "no such register" in chip.refuses(timer1 + 0x18, 1, size=2)
