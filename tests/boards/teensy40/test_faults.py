# SPDX-License-Identifier: MIT
"""Whatever the processor did not expect takes the motors' power away first."""

from __future__ import annotations

import ctypes
from pathlib import Path

from tests.boards.teensy40.conftest import BOARD, HERE
from tests.native import build_library

INTERRUPTS = 160
PENDSV, SYSTICK, TEMPERATURE_PANIC, USB = 14, 15, 16 + 64, 16 + 113


def load(tmp_path: Path) -> ctypes.CDLL:
    sources = [BOARD / "faults.cpp", HERE / "vectors_shim.cpp"]
    c = ctypes.CDLL(str(build_library(tmp_path, "vectors", sources, [HERE / "fakes_vectors"])))
    c.vector.restype = ctypes.c_char
    c.vectors_start_up()
    return c


def test_motors_on_pins_of_the_processor_are_dropped_without_an_output_enable_pin(tmp_path: Path) -> None:
    c = load(tmp_path)
    for value in (5, 7):
        c.vectors_on_fault(value)
    assert [c.vectors_write(number) for number in range(3)] == [5, 7, 0]
    assert c.vector(2) == b"f"
    for value in range(20):
        c.vectors_on_fault(100 + value)  # more than there is room for: nothing beyond is written
    assert c.vectors_write(15) == 113


def test_every_vector_that_nobody_asked_for_drops_the_outputs(tmp_path: Path) -> None:
    c = load(tmp_path)
    c.vectors_set_on_fault(1 << 11)
    found = b"".join(c.vector(exception) for exception in range(2, 16 + INTERRUPTS)).decode()
    expected = ["f"] * len(found)
    for own in (PENDSV, SYSTICK, USB):
        expected[own - 2] = "s"
    assert found == "".join(expected)
    assert found[TEMPERATURE_PANIC - 2] == "f"  # Teensyduino's own function for it would leave the motors on
    assert c.vectors_mask() == 1 << 11
