# SPDX-License-Identifier: MIT
"""The bare board: a program's way in and out, its clock, its stack, its faults."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.arm import build_program, need_emulator, run_program

HERE = Path(__file__).parent
INSTRUCTIONS = 3 * 10000
FAULT_EXIT_CODE = 70


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    need_emulator()
    return build_program(tmp_path_factory.mktemp("bare"), "count", [HERE / "count.cpp"])


def test_arguments_console_and_exit_code(program: Path) -> None:
    done = run_program(program, "one", "two")
    assert done.stderr.startswith("two ticks ")
    assert done.stderr.endswith(" 0.125\n")
    assert done.returncode == 3


@pytest.mark.parametrize("shift", [6, 7])
def test_instructions_are_counted_exactly(program: Path, shift: int) -> None:
    done = run_program(program, icount_shift=shift)
    ticks = int(re.findall(r"ticks (\d+)", done.stderr)[0])
    assert ticks * 40 / 2**shift == pytest.approx(INSTRUCTIONS, abs=2)  # a tick of the clock is 40 ns


def test_the_painted_stack_shows_what_was_used(program: Path) -> None:
    used = int(re.findall(r"stack (\d+)", run_program(program).stderr)[0])
    assert 10000 <= used <= 10200


@pytest.mark.parametrize("word", ["null", "overflow"])
def test_a_fault_is_reported_with_its_registers_and_ends_the_program(program: Path, word: str) -> None:
    done = run_program(program, word)
    assert done.returncode == FAULT_EXIT_CODE
    assert re.search(r"HardFault at pc [0-9a-f]{8} lr [0-9a-f]{8}", done.stderr)
    assert re.search(r"cfsr 000000[0-9a-f]{2} hfsr 40000000|cfsr 0000[0-9a-f]{4} hfsr 40000000", done.stderr)
