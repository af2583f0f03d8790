# SPDX-License-Identifier: MIT
"""The flash chip behind its controller: what a Teensy's core may ask of it, and what it must not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from omniwheel._core import lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked, parked_program

FLEXSPI = 0x402A8000
MCR0, INTR, LUTKEY, LUTCR = FLEXSPI, FLEXSPI + 0x14, FLEXSPI + 0x18, FLEXSPI + 0x1C
IPCR0, IPCR1, IPCMD = FLEXSPI + 0xA0, FLEXSPI + 0xA4, FLEXSPI + 0xB0
IPRXFCR, IPTXFCR, RFDR, TFDR = FLEXSPI + 0xB8, FLEXSPI + 0xBC, FLEXSPI + 0x100, FLEXSPI + 0x180
LUT60 = FLEXSPI + 0x200 + 4 * 60
DONE, WINDOW_EMPTY = 1, 1 << 6
BUSY, WRITE_ENABLED = 1, 2
AT = 0x1F0000


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Return a program that waits in RAM."""
    return parked_program(tmp_path_factory.mktemp("parked"))


@pytest.fixture
def chip(program: Program) -> Iterator[Chip]:
    """Return a chip that waits in RAM."""
    with parked(program) as chip:
        yield chip


def unlock(chip: Chip) -> None:
    """Open the look-up table."""
    chip.write(LUTKEY, 0x5AF05AF0)
    chip.write(LUTCR, 2)


def start(chip: Chip, instructions: tuple[int, int], address: int = 0, size: int = 0) -> None:
    """Put a sequence of up to four instructions into the table and run it."""
    unlock(chip)
    for word, value in enumerate((*instructions, 0, 0)):
        chip.write(LUT60 + 4 * word, value)
    chip.write(IPCR0, address)
    chip.write(IPCR1, 15 << 16 | size)
    chip.write(IPCMD, 1)


def finish(chip: Chip) -> None:
    """Wait until the command is through."""
    for _ in range(100):
        if chip.read(INTR) & DONE:
            chip.write(INTR, DONE)
            return
        chip.wait(1000)
    pytest.fail("the command is never done")


def status(chip: Chip) -> int:
    """Return the flash chip's status register."""
    chip.write(IPRXFCR, 1)
    start(chip, (0x0405 | 0x2401 << 16, 0), size=1)
    finish(chip)
    return chip.read(RFDR, 1)


def enable_writing(chip: Chip) -> None:
    """Set the write enable latch."""
    start(chip, (0x0406, 0))
    finish(chip)


def feed(chip: Chip, data: bytes) -> None:
    """Hand data to the FIFO as the core does: eight bytes at a time, the rest in the widest stores that fit."""
    for begin in range(0, len(data), 8):
        assert chip.read(INTR) & WINDOW_EMPTY
        part = data[begin : begin + 8]
        at = 0
        while at < len(part):
            width = next(size for size in (4, 2, 1) if at + size <= len(part))
            chip.write(TFDR + at, int.from_bytes(part[at : at + width], "little"), width)
            at += width
        chip.write(INTR, WINDOW_EMPTY)


def program_at_once(chip: Chip, address: int, data: bytes) -> None:
    """Program without letting the processor run in between."""
    chip.write(IPTXFCR, 1)
    start(chip, (0x0432 | 0x0818 << 16, 0x2201), address, len(data))
    feed(chip, data)


def program_bytes(chip: Chip, address: int, data: bytes) -> None:
    """Program without waiting until the flash chip is done."""
    program_at_once(chip, address, data)
    finish(chip)


def erase_sector_at_once(chip: Chip, address: int) -> None:
    """Erase 4 KB without letting the processor run in between."""
    start(chip, (0x0420 | 0x0818 << 16, 0), address)


def erase_sector(chip: Chip, address: int) -> None:
    """Erase 4 KB without waiting until the flash chip is done."""
    erase_sector_at_once(chip, address)
    finish(chip)


def busy_ns(chip: Chip, step_ns: int) -> int:
    """Return how long the chip is busy, to a step."""
    begin = chip.now_ns
    while status(chip) & BUSY:
        chip.wait(step_ns)
    return chip.now_ns - begin


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 7, 8, 9, 31, 32, 256])
def test_programs_what_it_was_given(chip: Chip, count: int) -> None:
    data = bytes((37 * i + 11) % 256 for i in range(count))
    enable_writing(chip)
    program_bytes(chip, AT, data)
    busy_ns(chip, 10_000)
    assert chip.flash(AT, count) == data
    assert chip.flash(AT + count, 8) == b"\xff" * 8
    assert chip.findings() == []


def test_programming_only_clears_bits(chip: Chip) -> None:
    for value in (0xF0, 0x3C):
        enable_writing(chip)
        program_bytes(chip, AT, bytes([value]))
        busy_ns(chip, 10_000)
    assert chip.flash(AT, 1) == bytes([0xF0 & 0x3C])
    assert any("would set bits" in text for text in chip.found(lib.RT1062_FINDING_FLASH))


def test_ones_leave_what_is_there(chip: Chip) -> None:
    """Bytes of ones around the others fill a copy up to a round length: nothing to object to."""
    enable_writing(chip)
    program_bytes(chip, AT, b"\x12\xff\xff\xff")
    busy_ns(chip, 10_000)
    enable_writing(chip)
    program_bytes(chip, AT, b"\xff\x34\xff\xff")
    busy_ns(chip, 10_000)
    assert chip.flash(AT, 4) == b"\x12\x34\xff\xff"
    assert chip.findings() == []


def test_programming_wraps_within_its_page(chip: Chip) -> None:
    enable_writing(chip)
    program_bytes(chip, AT + 254, b"abcd")
    busy_ns(chip, 10_000)
    assert chip.flash(AT + 254, 4) == b"ab\xff\xff"
    assert chip.flash(AT, 2) == b"cd"
    assert any("wraps around" in text for text in chip.found(lib.RT1062_FINDING_FLASH))


@pytest.mark.parametrize("enabled", [True, False])
def test_a_program_needs_write_enable(chip: Chip, enabled: bool) -> None:
    if enabled:
        enable_writing(chip)
    assert status(chip) == (WRITE_ENABLED if enabled else 0)
    program_bytes(chip, AT, b"x")
    busy_ns(chip, 10_000)
    assert chip.flash(AT, 1) == (b"x" if enabled else b"\xff")
    assert (chip.found(lib.RT1062_FINDING_FLASH) != []) != enabled
    assert status(chip) == 0, "write enable ends with the command"


def test_a_locked_table_stays_as_it_is(chip: Chip) -> None:
    before = chip.read(LUT60)
    chip.write(LUT60, 0x0406)
    chip.write(LUTCR, 2)  # no key before
    chip.write(LUT60, 0x0406)
    assert chip.read(LUT60) == before
    assert len(chip.found(lib.RT1062_FINDING_FLASH)) >= 1
    unlock(chip)
    chip.write(LUT60, 0x0406)
    assert chip.read(LUT60) == 0x0406


def test_too_little_data_never_ends(chip: Chip) -> None:
    """As on the chip: the clock waits for the FIFO. A hang that the watchdog ends."""
    enable_writing(chip)
    chip.write(IPTXFCR, 1)
    start(chip, (0x0432 | 0x0818 << 16, 0x2201), AT, 16)
    feed(chip, b"12345678")
    chip.wait(1_000_000)
    assert not chip.read(INTR) & DONE
    feed(chip, b"12345678")
    finish(chip)


def test_erases_one_sector(chip: Chip) -> None:
    for address in (AT - 1, AT, AT + 4095, AT + 4096):
        enable_writing(chip)
        program_bytes(chip, address, b"\x00")
        busy_ns(chip, 10_000)
    enable_writing(chip)
    erase_sector(chip, AT + 5)
    assert 45e6 <= busy_ns(chip, 1_000_000) <= 402e6
    assert chip.flash(AT, 4096) == b"\xff" * 4096
    assert chip.flash(AT - 1, 1) == chip.flash(AT + 4096, 1) == b"\x00"
    assert chip.findings() == []


def test_times_are_drawn_between_typical_and_maximal(program: Program) -> None:
    times = []
    for seed in range(1, 9):
        with parked(program, seed=seed) as chip:
            enable_writing(chip)
            erase_sector(chip, AT)
            times.append(busy_ns(chip, 1_000_000))
    assert min(times) >= 44e6
    assert max(times) <= 402e6
    assert max(times) - min(times) > 100e6


def test_ignores_commands_while_busy(chip: Chip) -> None:
    enable_writing(chip)
    erase_sector(chip, AT)
    enable_writing(chip)
    assert any("busy" in text for text in chip.found(lib.RT1062_FINDING_FLASH))
    busy_ns(chip, 1_000_000)
    assert status(chip) == 0


def test_code_in_flash_memory_cannot_run_while_it_is_busy(tmp_path: Path) -> None:
    with parked(parked_program(tmp_path, in_flash=True)) as chip:
        enable_writing(chip)
        erase_sector_at_once(chip, AT)
        assert chip.wait(1_000_000) == lib.RT1062_STOP_REFUSED
        assert "runs code at" in chip.why
        assert "while the flash chip erases" in chip.why
        assert chip.found(lib.RT1062_FINDING_FLASH) != []


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_power_cut_in_a_program_leaves_some_bits(chip: Chip, share: float) -> None:
    lib.rt1062_cut_power_at(chip.c, 2, share)
    enable_writing(chip)
    program_bytes(chip, AT, b"\x00" * 256)
    busy_ns(chip, 10_000)
    enable_writing(chip)
    program_at_once(chip, AT + 256, b"\x00" * 256)
    assert chip.wait(4_000_000) == lib.RT1062_STOP_POWER
    assert chip.flash(AT, 256) == b"\x00" * 256
    left = sum(byte.bit_count() for byte in chip.flash(AT + 256, 256)) / 2048
    assert left == pytest.approx(1 - share, abs=0.05)


def test_power_cut_in_an_erase_leaves_some_bits(program: Program) -> None:
    with parked(program) as chip:
        enable_writing(chip)
        program_bytes(chip, AT, b"\x00" * 256)
        busy_ns(chip, 10_000)
        lib.rt1062_cut_power_at(chip.c, 1, 0.3)
        enable_writing(chip)
        erase_sector_at_once(chip, AT)
        assert chip.wait(500e6) == lib.RT1062_STOP_POWER
        set_bits = sum(byte.bit_count() for byte in chip.flash(AT, 256)) / 2048
        assert set_bits == pytest.approx(0.3, abs=0.05)
        assert lib.rt1062_power_on(chip.c), chip.why
        chip.wait(1_000_000)
        assert status(chip) == 0


def test_switching_off_is_a_power_cut_too(chip: Chip) -> None:
    enable_writing(chip)
    program_bytes(chip, AT, b"\x00" * 256)
    busy_ns(chip, 10_000)
    enable_writing(chip)
    erase_sector(chip, AT)
    chip.wait(20_000_000)
    assert lib.rt1062_power_on(chip.c), chip.why
    set_bits = sum(byte.bit_count() for byte in chip.flash(AT, 256))
    assert 0 < set_bits < 2048


@pytest.mark.parametrize("code", [0x75, 0xAB])
def test_an_instruction_that_is_not_modelled_is_refused(chip: Chip, code: int) -> None:
    unlock(chip)
    chip.write(LUT60, 0x0400 | code)
    chip.write(IPCR1, 15 << 16)
    assert f"0x{code:02X}" in chip.refuses(IPCMD, 1)


def test_wrong_lanes_are_refused(chip: Chip) -> None:
    unlock(chip)
    chip.write(LUT60, 0x0620)
    chip.write(LUT60 + 4, 0)
    chip.write(IPCR1, 15 << 16)
    assert "lanes" in chip.refuses(IPCMD, 1)
