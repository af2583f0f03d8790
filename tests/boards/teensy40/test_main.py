# SPDX-License-Identifier: MIT
"""The order in which the board starts, and what its timer interrupt and its loop do."""

from __future__ import annotations

import ctypes

import pytest

OUTPUT_ENABLE, STOP_BUTTON, LIGHT = 9, 10, 13
HIGH, LOW = 1, 0
NOT_DRIVEN = -1
PRIORITY_SYSTICK, PRIORITY_SERIAL1 = 32, 64


def test_outputs_are_off_from_the_first_moment_and_the_watchdog_starts_last(chip: ctypes.CDLL) -> None:
    chip.startup_middle_hook()
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    chip.main_setup()
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    assert chip.fake_pin_glitches() <= 1  # the lamp may begin low, the motors' power may not
    assert chip.fake_fault_pin() == OUTPUT_ENABLE
    # stack painted, I2C, ALL_LED_OFF, encoders, application, watchdog: its count begun anew, then set up; timer
    assert chip.fake_journal().decode() == "pixeAfwt"


def test_motors_are_switched_off_before_flash_memory_is_erased(chip: ctypes.CDLL) -> None:
    """Without an output-enable pin the chip drives on through a reset in motion."""
    chip.storage_begin(False)
    for value in range(8):
        assert chip.storage_write(0, bytes([value]) * 2048, 2048)  # each fills a bank
    before = len(chip.fake_journal())
    chip.main_setup()
    journal = chip.fake_journal().decode()[before:]
    assert journal.count("E") >= 4
    assert 0 < journal.index("x") < journal.index("E")


def test_a_released_pin_is_left_to_its_pull_up_and_comes_back_as_off_without_a_moment_of_on(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    chip.board_output_enable(True)
    chip.board_output_enable_release()
    assert chip.fake_pin(OUTPUT_ENABLE) == NOT_DRIVEN
    glitches = chip.fake_pin_glitches()
    chip.board_output_enable(False)
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    assert chip.fake_pin_glitches() == glitches
    chip.board_output_enable(True)
    assert chip.fake_pin(OUTPUT_ENABLE) == LOW


@pytest.mark.parametrize(
    ("answers", "expected"),
    [
        (b"nnd", "xxxe"),  # no acknowledge at first
        (b"sd", "xcxe"),  # stuck since the reset cut a transfer short: freed, and again
        (b"bbbd", "xe"),
    ],
)
def test_motors_are_switched_off_on_a_bus_that_needs_patience(chip: ctypes.CDLL, answers: bytes, expected: str) -> None:
    chip.fake_i2c_answers(answers)
    chip.main_setup()
    journal = chip.fake_journal().decode()
    assert journal == f"pi{expected}Afwt"


@pytest.mark.parametrize("answers", [b"n" * 1000, b"s" * 1000, b"b" * 1000])
def test_a_dead_bus_does_not_keep_the_board_from_starting(chip: ctypes.CDLL, answers: bytes) -> None:
    chip.fake_time_passes(True)
    chip.fake_i2c_answers(answers)
    chip.main_setup()
    assert chip.fake_journal().decode().endswith("eAfwt")


def test_the_uploaders_baud_rate_takes_the_motors_power_away(chip: ctypes.CDLL) -> None:
    """Teensyduino jumps to the bootloader 10 ms later; nothing would stop a motor there."""
    chip.main_setup()
    chip.board_output_enable(True)
    chip.fake_usb_baud(115200)
    chip.fake_timer_fires()
    assert chip.fake_pin(OUTPUT_ENABLE) == LOW
    before = len(chip.fake_journal())
    chip.fake_usb_baud(134)
    chip.fake_timer_fires()
    chip.fake_timer_fires()
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    journal = chip.fake_journal().decode()[before:]
    assert "x" in journal
    assert "1" not in journal  # the application drives no more


def test_the_tick_has_its_period_and_its_place_among_the_interrupts(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    assert chip.fake_timer_period() == 1000
    assert PRIORITY_SYSTICK < chip.fake_timer_priority() < PRIORITY_SERIAL1


def test_the_watchdog_is_fed_only_while_timer_and_loop_both_live(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    before = chip.fake_feeds()
    for _ in range(5):
        chip.fake_timer_fires()
        chip.main_loop()
        chip.main_loop()
    assert chip.fake_feeds() == before + 5
    for _ in range(5):
        chip.main_loop()  # the timer stands
    assert chip.fake_feeds() == before + 5
    chip.fake_timer_fires()
    chip.app_background_hangs()
    chip.main_loop()
    assert chip.fake_feeds() == before + 5


@pytest.mark.parametrize(("burnt", "told"), [(0x04E5A0B1, 15048881), (0x04012345, 745650), (0x00989680, 10_000_000)])
def test_the_serial_number_is_the_usb_ports(chip: ctypes.CDLL, burnt: int, told: int) -> None:
    chip.fake_burnt_address(burnt)
    chip.main_setup()
    assert chip.board_serial_number() == told


def test_the_application_gets_two_ports_a_battery_and_the_pins(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    assert chip.board_ports() == 2
    assert chip.board_output_enable_wired()
    chip.fake_conversion(1, 2978)
    chip.fake_timer_fires()
    assert abs(chip.board_battery_V() - 12.0) < 0.01
    chip.board_output_enable(True)
    assert chip.fake_pin(OUTPUT_ENABLE) == LOW
    chip.board_output_enable(False)
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    chip.board_light(False)
    assert chip.fake_pin(LIGHT) == LOW
    chip.board_light(True)
    assert chip.fake_pin(LIGHT) == HIGH


def test_the_stop_button_is_open_unless_its_contact_closes_the_pin_to_ground(chip: ctypes.CDLL) -> None:
    """By the pull-up inside the processor, so that a cut wire reads as pressed."""
    chip.fake_ground_pin(STOP_BUTTON, True)
    chip.main_setup()
    assert not chip.board_stop_button_open()
    chip.fake_ground_pin(STOP_BUTTON, False)
    assert chip.board_stop_button_open()


def test_a_reboot_waits_for_what_was_said_and_leaves_the_outputs_off(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    chip.board_output_enable(True)
    chip.app_asks_for_reboot()
    chip.fake_time_passes(True)
    assert chip.fake_resets(chip.main_loop)
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    journal = chip.fake_journal().decode()
    assert journal.endswith("ToR")  # the timer first, so that no tick switches them on again
    assert chip.board_now_us() >= 100_000


def test_programming_waits_for_the_update_on_the_bus(chip: ctypes.CDLL) -> None:
    """Each 32 bytes take interrupts away for up to 0.4 ms: several in a row would look like a stuck bus."""
    chip.main_setup()
    for value in range(1, 5):
        chip.fake_i2c_on_wire(3)
        assert chip.board_storage_fill(value)
    assert chip.flash_held_up_bus() == 0


def test_programming_does_not_wait_for_a_dead_bus_for_ever(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    chip.fake_time_passes(True)
    chip.fake_i2c_on_wire(1_000_000)
    before = chip.board_now_us()
    assert chip.board_storage_fill(1)
    assert chip.board_now_us() - before < 150_000  # the watchdog is not fed meanwhile


@pytest.mark.parametrize("looks", [3, 1_000_000])
def test_an_erase_does_not_cut_short_the_update_that_stops_the_motors(chip: ctypes.CDLL, looks: int) -> None:
    """What is stored at a disarm may need an erase: interrupts are off for up to 400 ms, and the bus needs them."""
    chip.main_setup()
    before = len(chip.fake_journal())
    for value in range(1, 15):  # uses the whole ring up
        assert chip.board_storage_fill(value)
    assert "E" not in chip.fake_journal().decode()[before:]
    chip.fake_time_passes(True)
    for value in range(15, 18):
        before = len(chip.fake_journal())
        chip.fake_i2c_on_wire(looks)
        assert chip.board_storage_fill(value)
        events = chip.fake_journal().decode()[before:].replace("w", "").replace("f", "")
        if "E" in events:
            break
    waited = events[: events.index("E")]
    assert waited.endswith("bbbq") if looks == 3 else 15 <= waited.count("b") <= 25
