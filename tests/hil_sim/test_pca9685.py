# SPDX-License-Identifier: MIT
"""Register semantics of the PWM chip, from its datasheet."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib

ADDRESS = 0x40
MODE1, MODE2, LED0, ALL_LED, PRESCALE, TESTMODE = 0x00, 0x01, 0x06, 0xFA, 0xFE, 0xFF
RESTART, EXTCLK, AI, SLEEP, ALLCALL = 0x80, 0x40, 0x20, 0x10, 0x01


class Chip:
    def __init__(self, awake: bool = False) -> None:
        self.c: Any = ffi.new("hil_pca9685_t *")
        lib.hil_pca9685_reset(self.c, ADDRESS)
        if awake:
            self.write(MODE1, AI | ALLCALL)

    def write(self, *data: int, address: int = ADDRESS) -> bool:
        return bool(lib.hil_pca9685_write(self.c, address, bytes(data), len(data)))

    def read(self, register: int, count: int = 1) -> list[int]:
        assert self.write(register)
        out = ffi.new("uint8_t[]", count)
        assert lib.hil_pca9685_read(self.c, ADDRESS, out, count)
        return list(out)

    def set(self, channel: int, on: int, off: int) -> None:
        assert self.write(LED0 + 4 * channel, on & 0xFF, on >> 8, off & 0xFF, off >> 8)

    def duty(self, channel: int) -> float:
        return float(lib.hil_pca9685_duty(self.c, channel))


def test_power_up_is_asleep_and_off() -> None:
    chip = Chip()
    assert chip.read(MODE1) == [SLEEP | ALLCALL]
    assert chip.read(MODE2) == [0x04]
    assert chip.read(PRESCALE) == [0x1E]
    chip.write(MODE1, AI)
    assert [chip.duty(channel) for channel in range(16)] == [0.0] * 16


@pytest.mark.full
@given(st.integers(0, 15), st.integers(0, 4095), st.integers(0, 4095))
def test_duty_and_phase(channel: int, on: int, off: int) -> None:
    chip = Chip(awake=True)
    chip.set(channel, on, off)
    assert chip.duty(channel) == ((off - on) % 4096) / 4096
    assert lib.hil_pca9685_phase(chip.c, channel) == on / 4096
    assert sum(chip.duty(other) for other in range(16)) == chip.duty(channel)


def test_full_on_and_full_off_wins() -> None:
    chip = Chip(awake=True)
    chip.set(3, 0x1000, 0)
    assert chip.duty(3) == 1.0
    chip.set(3, 0x1000, 0x1000)
    assert chip.duty(3) == 0.0


@pytest.mark.parametrize(
    ("mode2", "level"), [(0x04, 0.0), (0x05, 1.0), (0x01, 0.0), (0x06, 0.0), (0x07, 0.0), (0x14, 0.0)]
)
def test_output_enable_high_gives_what_outne_says(mode2: int, level: float) -> None:
    chip = Chip(awake=True)
    chip.set(3, 0, 1024)
    chip.write(MODE2, mode2)
    before = chip.duty(3)
    chip.c.output_enable_high = True
    assert [chip.duty(channel) for channel in range(17)] == [level] * 16 + [0.0]
    chip.c.output_enable_high = False
    assert chip.duty(3) == before > 0.0


def test_a_software_reset_does_not_move_the_output_enable_pin() -> None:
    chip = Chip(awake=True)
    chip.c.output_enable_high = True
    assert chip.write(0x06, address=0)
    assert chip.c.output_enable_high


def test_channels_outside_are_low() -> None:
    chip = Chip(awake=True)
    chip.write(ALL_LED, 0, 0x10, 0, 0)
    assert chip.duty(15) == 1.0
    assert chip.duty(16) == 0.0


def test_all_led_writes_every_channel_and_reads_zero() -> None:
    chip = Chip(awake=True)
    chip.write(ALL_LED, 0x00, 0x00, 0x00, 0x08)
    assert [chip.duty(channel) for channel in range(16)] == [0.5] * 16
    assert chip.read(ALL_LED, 4) == [0, 0, 0, 0]


def test_auto_increment_wraps_behind_the_last_channel() -> None:
    chip = Chip(awake=True)
    chip.write(0x45, 0x00, AI | ALLCALL, 0x0C)
    assert chip.read(MODE2) == [0x0C]


def test_auto_increment_wraps_behind_prescale() -> None:
    chip = Chip(awake=True)
    chip.write(PRESCALE, 3, AI | ALLCALL, 0x0C)
    assert chip.read(MODE2) == [0x0C]


def test_without_auto_increment_the_register_stays() -> None:
    chip = Chip(awake=True)
    chip.write(MODE1, 0)
    chip.write(LED0, 1, 2, 3)
    assert chip.read(LED0, 2) == [3, 3]
    assert chip.read(LED0 + 1) == [0]


def test_prescale_is_locked_while_awake() -> None:
    chip = Chip(awake=True)
    chip.write(PRESCALE, 3)
    assert chip.read(PRESCALE) == [0x1E]
    assert chip.c.ignored_writes == 1
    chip.write(MODE1, AI | SLEEP)
    chip.write(PRESCALE, 3)
    assert math.isclose(lib.hil_pca9685_frequency_Hz(chip.c), 1525.88, rel_tol=1e-5)


@pytest.mark.parametrize("value", [0, 1, 2])
def test_prescale_has_a_floor(value: int) -> None:
    chip = Chip()
    chip.write(PRESCALE, value)
    assert chip.read(PRESCALE) == [3]


def test_sleep_stops_and_restart_resumes() -> None:
    chip = Chip(awake=True)
    chip.set(0, 0, 1024)
    chip.write(MODE1, AI | SLEEP)
    assert chip.duty(0) == 0.0
    assert chip.read(MODE1) == [RESTART | AI | SLEEP]
    chip.write(MODE1, AI)
    assert chip.duty(0) == 0.0, "waits for RESTART"
    assert chip.read(MODE1) == [RESTART | AI]
    chip.write(MODE1, RESTART | AI)
    assert chip.read(MODE1) == [AI]
    assert chip.duty(0) == 0.25


def test_restart_is_refused_while_asleep() -> None:
    chip = Chip(awake=True)
    chip.set(0, 0, 1024)
    chip.write(MODE1, AI | SLEEP)
    chip.write(MODE1, RESTART | AI)
    assert chip.duty(0) == 0.0
    assert chip.read(MODE1) == [RESTART | AI]


def test_sleeping_with_all_channels_off_needs_no_restart() -> None:
    chip = Chip(awake=True)
    chip.write(MODE1, AI | SLEEP)
    assert chip.read(MODE1) == [AI | SLEEP]


def test_writing_a_channel_forgets_the_interrupted_state() -> None:
    chip = Chip(awake=True)
    chip.set(0, 0, 1024)
    chip.write(MODE1, AI | SLEEP)
    chip.write(MODE1, AI)
    chip.set(1, 0, 2048)
    assert chip.read(MODE1) == [AI]
    assert (chip.duty(0), chip.duty(1)) == (0.25, 0.5)


def test_external_clock_needs_sleep_and_sticks() -> None:
    chip = Chip(awake=True)
    chip.set(0, 0, 1024)
    chip.write(MODE1, AI | EXTCLK)
    assert chip.duty(0) == 0.25
    chip.write(MODE1, AI | SLEEP)
    chip.write(MODE1, AI | SLEEP | EXTCLK)
    chip.write(MODE1, RESTART | AI)
    assert chip.read(MODE1)[0] & EXTCLK
    assert chip.duty(0) == 0.0, "nothing drives the clock pin"


def test_software_reset_by_general_call() -> None:
    chip = Chip(awake=True)
    chip.set(0, 0, 1024)
    assert chip.write(0x06, address=0x00)
    assert chip.read(MODE1) == [SLEEP | ALLCALL]
    assert chip.write(MODE1, AI)
    assert chip.duty(0) == 0.0


def test_the_general_call_address_alone_is_acknowledged_and_does_nothing() -> None:
    chip = Chip(awake=True)
    assert chip.write(address=0x00)
    assert chip.read(MODE1) == [AI | ALLCALL]


@pytest.mark.parametrize("data", [[0x05], [0x06, 0x06]])
def test_other_general_calls_are_not_acknowledged(data: list[int]) -> None:
    chip = Chip(awake=True)
    assert not chip.write(*data, address=0x00)
    assert chip.read(MODE1) == [AI | ALLCALL]


def test_all_call_address_can_be_switched_off_and_moved() -> None:
    chip = Chip(awake=True)
    assert chip.write(MODE2, 0x0C, address=0x70)
    chip.write(0x05, 0x61 << 1)
    assert not chip.write(MODE2, 0x04, address=0x70)
    assert chip.write(MODE2, 0x04, address=0x61)
    chip.write(MODE1, AI)
    assert not chip.write(MODE2, 0x0C, address=0x61)
    assert chip.read(MODE2) == [0x04]


def test_sub_address_answers_when_enabled() -> None:
    chip = Chip(awake=True)
    assert not chip.write(MODE2, 0x0C, address=0x71)
    chip.write(MODE1, AI | 0x08)
    assert chip.write(MODE2, 0x0C, address=0x71)


def test_foreign_address_changes_nothing() -> None:
    chip = Chip(awake=True)
    before = bytes(ffi.buffer(chip.c))
    assert not chip.write(MODE1, 0xFF, address=0x41)
    assert bytes(ffi.buffer(chip.c)) == before


def test_inverted_outputs() -> None:
    chip = Chip(awake=True)
    chip.set(0, 0, 1024)
    chip.write(MODE2, 0x14)
    assert chip.duty(0) == 0.75


@pytest.mark.full
@given(st.lists(st.binary(max_size=20), max_size=20))
def test_any_bytes_leave_duties_in_range(writes: list[bytes]) -> None:
    chip = Chip(awake=True)
    for data in writes:
        chip.write(*data)
        assert all(0.0 <= chip.duty(channel) <= 1.0 for channel in range(16))
        assert 24 <= round(lib.hil_pca9685_frequency_Hz(chip.c)) <= 1526


def test_test_mode_is_never_written() -> None:
    chip = Chip(awake=True)
    chip.write(TESTMODE, 0xAA)
    assert chip.c.ignored_writes == 1
    assert chip.read(TESTMODE) == [0]


def put(chip: Chip, *data: int) -> None:
    assert lib.hil_pca9685_start(chip.c, ADDRESS, False)
    assert all(lib.hil_pca9685_put(chip.c, byte) for byte in data)


def test_outputs_change_on_stop_and_not_before() -> None:
    chip = Chip(awake=True)
    put(chip, LED0, 0, 0, 0, 0x08)
    put(chip, LED0 + 4, 0, 0, 0, 0x04)
    assert [chip.duty(channel) for channel in range(2)] == [0.0, 0.0]
    lib.hil_pca9685_stop(chip.c)
    assert [chip.duty(channel) for channel in range(2)] == [0.5, 0.25]


def test_with_och_outputs_change_on_the_acknowledge_of_the_last_byte() -> None:
    chip = Chip(awake=True)
    chip.write(MODE2, 0x0C)
    put(chip, LED0, 0, 0, 0)
    assert chip.duty(0) == 0.0
    assert lib.hil_pca9685_put(chip.c, 0x08)
    assert chip.duty(0) == 0.5


def test_a_read_sends_bytes_only_after_its_own_address() -> None:
    chip = Chip(awake=True)
    put(chip, MODE1)
    assert lib.hil_pca9685_get(chip.c) == 0xFF
    assert lib.hil_pca9685_start(chip.c, ADDRESS, True)
    assert [lib.hil_pca9685_get(chip.c) for _ in range(2)] == [AI | ALLCALL, 0x04]
    assert not lib.hil_pca9685_start(chip.c, 0x70, True)
