# SPDX-License-Identifier: MIT
"""What a reset takes away, what it leaves, and which images the boot ROM starts."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.machine import DEFAULT_OPTIONS, NOTHING_WIRED, chip_config
from omniwheel._core import ffi, lib
from tests.image.assembly import Program
from tests.image.bare import unicorn_library
from tests.image.chip import Chip, parked, parked_program

SRSR, GPR5, AIRCR = 0x400F8008, 0x400F8030, 0xE000ED0C
HPCR, HPRTCLR, LPCR, LPSRTCMR, LPSRTCLR = 0x400D4008, 0x400D4028, 0x400D4038, 0x400D4050, 0x400D4054
POWER, PROGRAM, WATCHDOG, HOT = 1, 2, 0x80, 0x100
OCRAM, DTCM = 0x20200000, 0x20000000


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Return a program that waits in RAM."""
    return parked_program(tmp_path_factory.mktemp("parked"))


@pytest.fixture
def chip(program: Program) -> Iterator[Chip]:
    """Return a chip that tells of resets."""
    with parked(program) as chip:
        lib.rt1062_stop_on(chip.c, 1 << lib.RT1062_STOP_RESET)
        yield chip


def reset(chip: Chip, flags: int) -> None:
    """Reset the chip from outside and let its program come to its loop."""
    lib.rt1062_reset(chip.c, flags)
    assert chip.wait(1e6) == lib.RT1062_STOP_RESET
    assert chip.wait(100e3) == lib.RT1062_STOP_TIME, chip.why


def test_reasons_add_up_until_they_are_cleared(chip: Chip) -> None:
    assert chip.read(SRSR) == POWER
    reset(chip, WATCHDOG)
    assert chip.read(SRSR) == POWER | WATCHDOG
    chip.write(AIRCR, 0x05FA0004)
    assert chip.wait(1e6) == lib.RT1062_STOP_RESET
    assert chip.read(SRSR) == POWER | WATCHDOG | PROGRAM
    chip.write(SRSR, WATCHDOG)
    assert chip.read(SRSR) == POWER | PROGRAM
    chip.write(SRSR, chip.read(SRSR))
    assert chip.read(SRSR) == 0


def test_over_temperature_is_cleared_by_a_zero(chip: Chip) -> None:
    reset(chip, HOT)
    chip.write(SRSR, chip.read(SRSR))  # what CrashReport.clear() of the core does
    assert chip.read(SRSR) == HOT
    chip.write(SRSR, 0)
    assert chip.read(SRSR) == 0


def test_what_outlives_a_reset_and_what_a_power_cut(chip: Chip) -> None:
    chip.write(GPR5, 0x0BAD00F1)
    chip.put(OCRAM + 0x7FF80, b"crash report")
    chip.put(DTCM + 0x8000, b"kept")
    chip.put(OCRAM + 0x100, b"the boot ROM's")
    reset(chip, WATCHDOG)
    assert chip.read(GPR5) == 0x0BAD00F1
    assert chip.memory(OCRAM + 0x7FF80, 12) == b"crash report"
    assert chip.memory(DTCM + 0x8000, 4) == b"kept"
    assert chip.memory(OCRAM + 0x100, 14) != b"the boot ROM's"
    assert lib.rt1062_power_on(chip.c)
    assert chip.read(GPR5) == 0
    assert chip.read(SRSR) == POWER
    assert chip.memory(OCRAM + 0x7FF80, 12) != b"crash report"
    assert chip.memory(DTCM + 0x8000, 4) != b"kept"


def test_the_low_power_clock_outlives_a_reset(chip: Chip) -> None:
    chip.write(LPSRTCLR, (1_546_300_800 << 15) & 0xFFFFFFFF)
    chip.write(LPSRTCMR, 1_546_300_800 >> 17)
    chip.write(LPCR, chip.read(LPCR) | 1)
    chip.write(HPCR, chip.read(HPCR) | 1 | 1 << 16)
    begin = chip.read(HPRTCLR)
    chip.wait(1e9)
    assert chip.read(HPRTCLR) - begin == pytest.approx(32768, abs=2)
    before = chip.read(LPSRTCLR)
    reset(chip, PROGRAM)
    assert chip.read(LPCR) & 1
    assert 0 < chip.read(LPSRTCLR) - before < 32768
    assert chip.read(HPRTCLR) == 0
    assert chip.read(HPCR) & 1 == 0
    assert lib.rt1062_power_on(chip.c)
    assert chip.read(LPCR) & 1 == 0


def test_the_clock_cannot_be_set_while_it_runs(chip: Chip) -> None:
    chip.write(LPCR, chip.read(LPCR) | 1)
    assert "while it runs" in chip.refuses(LPSRTCLR, 5)


def refusal(flash: bytes) -> str:
    """Return why the boot ROM would not start this."""
    config = chip_config(NOTHING_WIRED, DEFAULT_OPTIONS)
    why = ffi.new("char[]", lib.RT1062_TEXT)
    machine = lib.rt1062_new(str(unicorn_library()).encode(), config, why, lib.RT1062_TEXT)
    try:
        ffi.memmove(lib.rt1062_flash(machine), flash, len(flash))
        started = lib.rt1062_power_on(machine)
        return "" if started else str(ffi.string(lib.rt1062_why(machine)).decode())
    finally:
        lib.rt1062_free(machine)


@pytest.mark.parametrize(
    ("offset", "word", "says"),
    [
        (0x0, 0xFFFFFFFF, "no flash configuration block"),
        (0x4, 0, "can't use the flash configuration block"),
        (0x50, 0, "can't use the flash configuration block"),
        (0x80, 0xFFFFFFFF, "can't use the flash configuration block"),
        (0x1000, 0x442000D1, "no image vector table"),
        (0x1000, 0x432000D2, "no image vector table"),
        (0x1014, 0x60001004, "no image vector table"),
        (0x100C, 0x60001100, "DCD"),
        (0x1004, 0x60002000, "no Thumb code"),
        (0x1004, 0x601F0001, "no Thumb code"),
        (0x1010, 0x20000000, "boot data"),
        (0x1020, 0x60001000, "boot data"),
        (0x1024, 0x00300000, "boot data"),
    ],
)
def test_the_boot_rom_says_what_it_misses(program: Program, offset: int, word: int, says: str) -> None:
    flash = bytearray(program.flash)
    flash[offset : offset + 4] = struct.pack("<I", word)
    assert says in refusal(bytes(flash))
    assert refusal(program.flash) == ""


def test_an_older_header_names_a_vector_table(program: Program) -> None:
    """Teensyduino before it took header 0x43: the entry is the table of stack pointer and reset handler."""
    flash = bytearray(program.flash)
    flash[0x1000:0x1008] = struct.pack("<2I", 0x402000D1, program.symbols["vectors"])
    with parked(replace(program, flash=bytes(flash))) as chip:
        assert chip.register(15) == 0x20000100


def test_a_reset_while_the_flash_chip_erases_cannot_boot(chip: Chip) -> None:
    flexspi = 0x402A8000
    chip.write(flexspi + 0x18, 0x5AF05AF0)
    chip.write(flexspi + 0x1C, 2)
    for word in (0x0406, 0x0420 | 0x0818 << 16):
        chip.write(flexspi + 0x2F0, word)
        chip.write(flexspi + 0xA0, 0x1F0000)
        chip.write(flexspi + 0xA4, 15 << 16)
        chip.write(flexspi + 0xB0, 1)
        chip.wait(10_000)
        chip.write(flexspi + 0x14, 1)
    lib.rt1062_reset(chip.c, WATCHDOG)
    assert chip.wait(1e6) == lib.RT1062_STOP_REFUSED
    assert "boot ROM" in chip.why
