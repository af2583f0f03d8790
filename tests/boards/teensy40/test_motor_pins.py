# SPDX-License-Identifier: MIT
"""Motors on PWM pins of the Teensy: what the board layer asks of the pins, and wirings that do not compile."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from tests.boards.teensy40.chip import write_wiring_header
from tests.boards.teensy40.conftest import BOARD, HERE
from tests.native import ROOT, build_library

EXAMPLE = ROOT / "shared" / "robots" / "examples" / "three_wheel_pins.toml"
PINS = [10, 11, 14, 15, 22, 23]
GPIO = 0x15
TIMER = 0x100
"""The fake's alternative function of a timer, with the pin's number in the bits below."""
FULL = 4096
LOW = [(0, GPIO)] * 6


def load(out: Path, robot: Path = EXAMPLE) -> ctypes.CDLL:
    wiring = write_wiring_header(out, robot)
    sources = [BOARD / "motor_pins.cpp", HERE / "motor_pins_shim.cpp"]
    return ctypes.CDLL(str(build_library(out, "motor_pins", sources, [HERE / "fakes_motor_pins", wiring])))


@pytest.fixture
def board(tmp_path: Path) -> ctypes.CDLL:
    board = load(tmp_path)
    board.pins_begin()
    return board


def write(board: ctypes.CDLL, *steps: int) -> bool:
    return bool(board.pins_write((ctypes.c_uint16 * 6)(*steps)))


def pins(board: ctypes.CDLL) -> list[tuple[int, int]]:
    """Return each pin's level or timer steps, and its pad's function."""
    return [(board.pin_value(pin), board.pin_pad(pin)) for pin in PINS]


def test_all_pins_are_low_outputs_before_anything_else(tmp_path: Path) -> None:
    board = load(tmp_path)
    board.pins_drive_low()
    assert pins(board) == LOW
    assert board.glitches() == 0, "low before it becomes an output"


def test_a_fault_clears_every_pin_and_takes_its_pad_from_the_timer(board: ctypes.CDLL) -> None:
    write(board, FULL, 1000, 2000, FULL, 0, 5)
    board.fault()
    assert pins(board) == LOW
    assert [board.pin_frequency(pin) for pin in PINS] == [20_000] * 6


def test_ends_of_the_range_come_from_no_timer(board: ctypes.CDLL) -> None:
    assert write(board, FULL, 1000, 2000, FULL, 0, 5)
    expected = [(1, GPIO), (1000, TIMER + 11), (2000, TIMER + 14), (1, GPIO), (0, GPIO), (5, TIMER + 23)]
    assert pins(board) == expected
    assert write(board, *[0] * 6)
    assert pins(board) == LOW


def test_what_does_not_change_is_not_written_again(board: ctypes.CDLL) -> None:
    write(board, FULL, 1000, 2000, FULL, 0, 5)
    before = board.writes()
    assert write(board, FULL, 1000, 2000, FULL, 0, 5)
    assert board.writes() == before


def test_a_pad_that_lost_its_timer_is_a_failure_and_set_anew(board: ctypes.CDLL) -> None:
    write(board, 100, 1000, 2000, FULL, 0, 5)
    board.lose_pad(14)
    assert not write(board, 100, 1000, 2000, FULL, 0, 5)
    assert board.pin_pad(14) == TIMER + 14
    assert write(board, 100, 1000, 2000, FULL, 0, 5)


@pytest.mark.parametrize(
    ("driver", "motors", "encoders", "needle"),
    [
        ("in1_in2", "{255, 255}, {255, 255}, {255, 255}", "{3, 2}, {7, 8}, {5, 4}", "give wiring.motor_pins"),
        ("in1_in2", "{10, 11}, {14, 15}, {22, 16}", "{3, 2}, {7, 8}, {5, 4}", "needs pins with PWM"),
        ("pwm_dir", "{10, 11}, {14, 15}, {16, 22}", "{3, 2}, {7, 8}, {5, 4}", "needs pins with PWM"),
        ("in1_in2", "{10, 11}, {14, 15}, {22, 10}", "{3, 2}, {7, 8}, {5, 4}", "is used twice, or by an encoder"),
        ("in1_in2", "{10, 11}, {14, 15}, {22, 2}", "{3, 2}, {7, 8}, {5, 4}", "is used twice, or by an encoder"),
    ],
)
def test_a_wiring_that_cannot_be_does_not_compile_and_says_why(
    tmp_path: Path, driver: str, motors: str, encoders: str, needle: str
) -> None:
    folder = write_wiring_header(tmp_path, EXAMPLE) / "omni"
    header = folder / "wiring_gen.h"
    text = header.read_text(encoding="utf-8")
    if driver == "pwm_dir":
        text = text.replace("motor_pwm[2] = {true, true}", "motor_pwm[2] = {true, false}")
        assert "{true, false}" in text
    text = text.replace("{{10, 11}, {14, 15}, {22, 23}}", f"{{{motors}}}")
    header.write_text(text.replace("{{3, 2}, {7, 8}, {5, 4}}", f"{{{encoders}}}"), encoding="utf-8")
    sources = [BOARD / "motor_pins.cpp", HERE / "motor_pins_shim.cpp"]
    with pytest.raises(AssertionError, match=needle):
        build_library(tmp_path, "refused", sources, [HERE / "fakes_motor_pins", folder.parent])
