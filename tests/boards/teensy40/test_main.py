# SPDX-License-Identifier: MIT
"""The order in which the board starts, and what its timer interrupt and its loop do."""

from __future__ import annotations

import ctypes

OUTPUT_ENABLE, LIGHT = 9, 13
HIGH, LOW = 1, 0
PRIORITY_SYSTICK, PRIORITY_SERIAL1 = 32, 64


def test_outputs_are_off_from_the_first_moment_and_the_watchdog_starts_last(chip: ctypes.CDLL) -> None:
    chip.startup_middle_hook()
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    chip.main_setup()
    assert chip.fake_pin(OUTPUT_ENABLE) == HIGH
    assert chip.fake_pin_glitches() <= 1  # the lamp may begin low, the motors' power may not
    assert chip.fake_fault_pin() == OUTPUT_ENABLE
    assert chip.fake_journal().decode() == "peiAwt"  # stack painted, encoders, I2C, application, watchdog, timer


def test_the_tick_has_its_period_and_its_place_among_the_interrupts(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    assert chip.fake_timer_period() == 1000
    assert PRIORITY_SYSTICK < chip.fake_timer_priority() < PRIORITY_SERIAL1


def test_the_watchdog_is_fed_only_while_timer_and_loop_both_live(chip: ctypes.CDLL) -> None:
    chip.main_setup()
    for _ in range(5):
        chip.fake_timer_fires()
        chip.main_loop()
        chip.main_loop()
    assert chip.fake_feeds() == 5
    for _ in range(5):
        chip.main_loop()  # the timer stands
    assert chip.fake_feeds() == 5
    chip.fake_timer_fires()
    chip.app_background_hangs()
    chip.main_loop()
    assert chip.fake_feeds() == 5


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
