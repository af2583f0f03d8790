# SPDX-License-Identifier: MIT
"""What a machine must not carry over: set back, called, or with other code in its flash memory, it goes by the new."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from omniwheel._core import ffi, lib
from tests.image.assembly import RAM, assemble
from tests.image.bare import Bare, running
from tests.image.chip import Chip
from tests.image.test_flash_memory import enable_writing, erase_sector_at_once, finish

COUNTING = """
main:
    movs r4, #0
round:
    adds r4, #1
    str r4, [r7]
    b round
.thumb_func
answer:
    movs r0, #42
    bx lr
"""
NOTHING = (0, 0, 0, 0)


@contextmanager
def snapshot_of(bare: Bare) -> Iterator[object]:
    """Copy a machine."""
    copy = lib.rt1062_snapshot(bare.c)
    try:
        yield copy
    finally:
        lib.rt1062_snapshot_free(copy)


def call(bare: Bare, function: str) -> tuple[int, int]:
    """Return how a call ended, and its result."""
    result = ffi.new("uint32_t *")
    stop = lib.rt1062_call(bare.c, bare.program.symbols[function], NOTHING, 1_000_000, result)
    return int(stop), int(result[0])


def rounds(bare: Bare) -> int:
    """Run to the break point and return how many rounds were finished before."""
    assert bare.run(1000.0) == lib.RT1062_STOP_BREAK
    return bare.words(1)[0]


def test_a_break_point_is_met_once_each_round_whatever_was_done_meanwhile(tmp_path: Path) -> None:
    with running(assemble(COUNTING, tmp_path)) as bare:
        assert lib.rt1062_break(bare.c, bare.program.symbols["round"])
        assert rounds(bare) == 1
        with snapshot_of(bare) as copy:
            assert call(bare, "answer") == (lib.RT1062_STOP_TIME, 42)
            assert rounds(bare) == 2
            assert rounds(bare) == 3
            lib.rt1062_restore(bare.c, copy)
            assert rounds(bare) == 2


def test_a_call_without_a_break_point_left_is_refused(tmp_path: Path) -> None:
    with running(assemble(COUNTING, tmp_path)) as bare:
        for number in range(8):
            assert lib.rt1062_break(bare.c, RAM + 4 * number)
        assert call(bare, "answer")[0] == lib.RT1062_STOP_REFUSED
        assert "break point" in bare.why
        assert not lib.rt1062_break(bare.c, RAM)


def test_a_call_waits_for_the_end_of_a_critical_section(tmp_path: Path) -> None:
    source = """
main:
    movs r0, #0
    str r0, [r7]
    cpsid i
    movw r1, #1000
1:  subs r1, #1
    bne 1b
    movs r0, #1
    str r0, [r7]
    cpsie i
    b .
.thumb_func
look:
    ldr r0, =0x20000000
    ldr r0, [r0]
    bx lr
"""
    with running(assemble(source, tmp_path)) as bare:
        bare.run(15.0)
        assert call(bare, "look") == (lib.RT1062_STOP_TIME, 1)


IN_FLASH = """
main:
    ldr r0, =0x20000100
    movw r1, #0xE7FE            @ b .
    strh r1, [r0]
    orr r0, #1
    bx r0
.balign 4096
.thumb_func
answer:
    movs r0, #42
    bx lr
"""


def erase_program(chip: Chip) -> None:
    """Erase the sector of ``answer``."""
    chip.write(0x402A8000, chip.read(0x402A8000) & ~2)
    enable_writing(chip)
    erase_sector_at_once(chip, (chip.program.symbols["answer"] - 0x60000000) & ~0xFFF)
    finish(chip)
    assert chip.wait(500_000_000) == lib.RT1062_STOP_TIME


def test_a_program_that_erases_itself_is_found_and_gone(tmp_path: Path) -> None:
    with running(assemble(IN_FLASH, tmp_path)) as bare:
        chip = Chip(bare.c, bare.program, bare.begin_ns)
        chip.wait(100_000)
        assert call(chip, "answer") == (lib.RT1062_STOP_TIME, 42)
        with snapshot_of(chip) as copy:
            erase_program(chip)
            assert any("in the program itself" in text for text in chip.findings())
            assert call(chip, "answer")[0] != lib.RT1062_STOP_TIME
            lib.rt1062_restore(chip.c, copy)
            assert call(chip, "answer") == (lib.RT1062_STOP_TIME, 42)
