# SPDX-License-Identifier: MIT
"""Whatever the processor did not expect takes the motors' power away first."""

from __future__ import annotations

import ctypes
from pathlib import Path

from tests.boards.teensy40.conftest import BOARD, HERE
from tests.native import build_library

INTERRUPTS = 160
PENDSV, SYSTICK, TEMPERATURE_PANIC, USB = 14, 15, 16 + 64, 16 + 113


def test_every_vector_that_nobody_asked_for_drops_the_outputs(tmp_path: Path) -> None:
    sources = [BOARD / "faults.cpp", HERE / "vectors_shim.cpp"]
    c = ctypes.CDLL(str(build_library(tmp_path, "vectors", sources, [HERE / "fakes_vectors"])))
    c.vector.restype = ctypes.c_char
    c.vectors_start_up()
    c.vectors_set_on_fault(1 << 11)
    found = b"".join(c.vector(exception) for exception in range(2, 16 + INTERRUPTS)).decode()
    expected = ["f"] * len(found)
    for own in (PENDSV, SYSTICK, USB):
        expected[own - 2] = "s"
    assert found == "".join(expected)
    assert found[TEMPERATURE_PANIC - 2] == "f"  # Teensyduino's own function for it would leave the motors on
    assert c.vectors_mask() == 1 << 11
