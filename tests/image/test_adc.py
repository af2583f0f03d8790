# SPDX-License-Identifier: MIT
"""Analog-digital converters: calibration and conversions take their time, and show the battery behind its divider."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.machine import Wiring
from omniwheel._core import lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked
from tests.image.conftest import WorldMaker

ADC1, ADC2 = 0x400C4000, 0x400C8000
HC0, HS, R0, CFG, GC, GS = 0, 0x20, 0x24, 0x44, 0x48, 0x4C
CAL, AVERAGE = 1 << 7, 1 << 5
PIN_14_CHANNEL, PIN_26_CHANNEL = 7, 3
PAD_14, PAD_26 = 0x401F8204 + 4 * (58 + 2), 0x401F8204 + 4 * (58 + 14)
CORE_CFG = {8: 0x0723, 10: 0x0637, 12: 0x073B}
"""MODE, ADSTS, ADLSMP as [core] analog.c chooses them, asynchronous clock / 2, high speed."""
BATTERY_V, DIVIDER = 12.0, 5.7


def open_gates(chip: Chip) -> None:
    chip.open_gates(1, 4, 8)


@pytest.fixture
def converters(chip: Chip) -> Chip:
    """Both converters with a clock."""
    open_gates(chip)
    return chip


@pytest.fixture
def measuring(program: Program, make_world: WorldMaker) -> Iterator[Chip]:
    """A chip with the world's battery at pin 14, the pad's keeper off."""
    world = make_world()
    world.c.supply_V = BATTERY_V
    with parked(program, wiring=Wiring(battery_pin=14, battery_divider=DIVIDER), world=world) as chip:
        open_gates(chip)
        chip.write(PAD_14, 0)
        world.c.supply_V = BATTERY_V
        yield chip


def converted(chip: Chip, channel: int, base: int = ADC1) -> int:
    chip.write(base + HC0, channel)
    assert not chip.read(base + HS) & 1
    assert chip.read(base + GS) & 1
    chip.wait(50_000)
    assert chip.read(base + HS) & 1
    return chip.read(base + R0)


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_the_battery_behind_its_divider(measuring: Chip, bits: int) -> None:
    measuring.write(ADC1 + CFG, CORE_CFG[bits])
    assert converted(measuring, PIN_14_CHANNEL) == int(BATTERY_V / DIVIDER / 3.3 * 2**bits)
    assert not measuring.read(ADC1 + HS) & 1  # reading the result takes the flag away


def test_too_much_voltage_is_full_scale(program: Program, make_world: WorldMaker) -> None:
    with parked(program, wiring=Wiring(battery_pin=14, battery_divider=1.0), world=make_world()) as chip:
        open_gates(chip)
        chip.write(PAD_14, 0)
        chip.write(ADC1 + CFG, CORE_CFG[12])
        assert converted(chip, PIN_14_CHANNEL) == 4095


@pytest.mark.parametrize(("averaged", "microseconds"), [(False, 5.0), (True, 20.0)])
def test_a_conversion_takes_its_time(measuring: Chip, averaged: bool, microseconds: float) -> None:
    """12 bits: 25 cycles and 25 of sampling of the 10 MHz that ADACK / 2 gives, four times if averaged."""
    measuring.write(ADC1 + CFG, CORE_CFG[12])
    measuring.write(ADC1 + GC, AVERAGE if averaged else 0)
    measuring.write(ADC1 + HC0, PIN_14_CHANNEL)
    measuring.wait((microseconds - 0.2) * 1000)
    assert not measuring.read(ADC1 + HS) & 1
    measuring.wait(300)
    assert measuring.read(ADC1 + HS) & 1


def test_calibration_ends(converters: Chip) -> None:
    converters.write(ADC1 + CFG, CORE_CFG[10])
    converters.write(ADC1 + GC, CAL | AVERAGE)
    assert converters.read(ADC1 + GC) == CAL | AVERAGE
    converters.wait(2_000_000)
    assert converters.read(ADC1 + GC) == AVERAGE
    assert converters.read(ADC1 + GS) == 0


def test_a_conversion_during_calibration_is_refused(converters: Chip) -> None:
    converters.write(ADC1 + GC, CAL)
    assert "calibration" in converters.refuses(ADC1 + HC0, 0)


def test_the_second_converter_has_pads_of_its_own(converters: Chip) -> None:
    converters.write(ADC2 + CFG, CORE_CFG[12])
    converters.write(PAD_26, 0)
    converters.drive(26, 1)
    assert converted(converters, PIN_26_CHANNEL, ADC2) == 4095
    assert converted(converters, 4, ADC2) == 0


def test_a_keeper_at_the_measured_pin_is_found(measuring: Chip) -> None:
    measuring.write(PAD_14, 0x10B0)
    converted(measuring, PIN_14_CHANNEL)
    assert "keeper" in measuring.found(lib.RT1062_FINDING_PINS)[0]


@pytest.mark.parametrize(("register", "value"), [(HC0, 0x80), (HC0, 16), (CFG, 1 << 13), (GC, 1 << 6), (0x50, 0)])
def test_what_is_not_modelled_is_refused(converters: Chip, register: int, value: int) -> None:
    assert converters.refuses(ADC1 + register, value)
