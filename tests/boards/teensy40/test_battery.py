# SPDX-License-Identifier: MIT
from __future__ import annotations

import ctypes

import pytest

FULL_SCALE = 4095


@pytest.mark.full
@pytest.mark.parametrize(("pin", "converter", "channel"), [(14, 1, 7), (25, 1, 2), (26, 2, 3), (27, 2, 4)])
def test_each_pin_is_converted_by_its_own_converter(chip: ctypes.CDLL, pin: int, converter: int, channel: int) -> None:
    chip.battery_begin(pin, 1.0)
    assert chip.fake_converting(converter) == channel
    chip.fake_conversion(converter, FULL_SCALE)
    assert chip.battery_sample() == pytest.approx(3.3)
    assert chip.fake_converting(converter) == channel  # the next one is under way


@pytest.mark.full
def test_it_never_waits_for_a_conversion_and_knows_nothing_before_the_first(chip: ctypes.CDLL) -> None:
    chip.battery_begin(14, 5.0)
    chip.fake_converting(1)
    for _ in range(10):
        assert chip.battery_sample() == 0.0


def test_the_first_conversion_counts_wholly_and_noise_is_smoothed(chip: ctypes.CDLL) -> None:
    chip.battery_begin(14, 5.0)
    volts = []
    for number in range(200):
        chip.fake_conversion(1, 3000 + (40 if number % 2 else -40))
        volts.append(chip.battery_sample())
    assert volts[0] == pytest.approx(2960 * 5 * 3.3 / FULL_SCALE)
    steady = 3000 * 5 * 3.3 / FULL_SCALE
    assert max(abs(v - steady) for v in volts[100:]) < 0.02


def test_a_drop_below_the_limit_shows_well_within_the_time_that_the_fault_takes(chip: ctypes.CDLL) -> None:
    chip.battery_begin(14, 5.0)
    for _ in range(50):
        chip.fake_conversion(1, 2978)  # 12 V
        chip.battery_sample()
    volts = []
    for _ in range(12):  # ms; the fault takes 50
        chip.fake_conversion(1, 1985)  # 8 V
        volts.append(chip.battery_sample())
    assert volts[0] > 9.0
    assert volts[-1] < 9.0
