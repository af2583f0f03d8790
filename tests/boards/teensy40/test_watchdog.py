# SPDX-License-Identifier: MIT
from __future__ import annotations

import ctypes
import random
import struct
import zlib

import pytest

POWER_ON, WATCHDOG, SOFTWARE, CRASH, OVER_TEMPERATURE = range(5)
ENABLED, INTERRUPT_FIRST, COMMAND_32_BIT, LOW_POWER_CLOCK = 1 << 7, 1 << 6, 1 << 13, 1 << 8
# SRC_SRSR, reference manual, SRC Reset Status Register
FLAGS = (
    "ipp_reset",
    "system_reset",
    "security",
    "user",
    "watchdog",
    "jtag",
    "jtag_software",
    "watchdog3",
    "temperature",
)
SYSTEM_RESET_FLAG, WATCHDOG_FLAG, WATCHDOG3_FLAG, TEMPERATURE_FLAG = 1 << 1, 1 << 4, 1 << 7, 1 << 8
TEMPERATURE_PANIC = 16 + 64  # exception number of the interrupt
FAULT_HANDLER_MARK = 0x0BAD00F1


def fault_record(**fields: int) -> bytes:
    """What Teensyduino's fault handler leaves: eleven words, the last a CRC over the others without final inversion."""
    names = ("len", "ipsr", "cfsr", "hfsr", "mmfar", "bfar", "ret", "xpsr", "temp", "time")
    words = struct.pack("<10I", *({"len": 11, **fields}.get(name, 0) for name in names))
    return words + struct.pack("<I", ~zlib.crc32(words) & 0xFFFFFFFF)


def crash_lines(chip: ctypes.CDLL) -> list[str]:
    lines: list[str] = []
    while (line := chip.watchdog_line(len(lines))) is not None:
        lines.append(line.decode())
    return lines


def test_it_is_fed_only_if_a_tick_ran_since_the_last_time(chip: ctypes.CDLL) -> None:
    chip.watchdog_start()
    before = chip.fake_feeds()
    chip.watchdog_feed()
    assert chip.fake_feeds() == before
    chip.watchdog_tick()
    for _ in range(100):  # the background is much faster than the tick
        chip.watchdog_feed()
    assert chip.fake_feeds() == before + 1


def test_a_tick_that_stands_or_a_background_that_hangs_starves_it(chip: ctypes.CDLL) -> None:
    chip.watchdog_start()
    rng = random.Random(5)
    for _ in range(200):
        tick, background = rng.random() < 0.5, rng.random() < 0.5
        before = chip.fake_feeds()
        for _ in range(rng.randrange(1, 20)):
            if tick:
                chip.watchdog_tick()
            if background:
                chip.watchdog_feed()
        fed = chip.fake_feeds() - before
        if not background:
            assert fed == 0
        elif not tick:
            assert fed <= 1  # for a tick that ran before


def test_it_runs_on_the_low_power_oscillator_with_its_time_out_in_milliseconds(chip: ctypes.CDLL) -> None:
    assert chip.fake_watchdog_control() == 0
    chip.watchdog_start()
    control = chip.fake_watchdog_control()
    assert control & ENABLED
    assert control & COMMAND_32_BIT
    assert control & LOW_POWER_CLOCK
    assert not control & INTERRUPT_FIRST  # a reset, not an interrupt that a hung processor would not serve
    assert 150 <= chip.fake_watchdog_counts() / 32.768 <= 250
    assert chip.fake_watchdog_atomic()


def test_it_is_not_fed_before_it_is_started(chip: ctypes.CDLL) -> None:
    chip.watchdog_tick()
    chip.watchdog_feed()
    assert chip.fake_feeds() == 0


@pytest.mark.parametrize(
    ("flag", "cause", "line"),
    [
        ("ipp_reset", POWER_ON, None),
        ("system_reset", SOFTWARE, None),  # the loader, after an upload; a lock-up ends by the watchdog
        ("security", CRASH, "reset by the processor's security monitor"),
        ("user", POWER_ON, None),
        ("watchdog", WATCHDOG, None),
        ("jtag", SOFTWARE, None),
        ("jtag_software", SOFTWARE, None),
        ("watchdog3", WATCHDOG, None),
        ("temperature", OVER_TEMPERATURE, None),
    ],
)
def test_every_reset_flag_has_its_cause(chip: ctypes.CDLL, flag: str, cause: int, line: str | None) -> None:
    chip.fake_reset_flags(1 << FLAGS.index(flag), 0)
    chip.watchdog_begin()
    assert chip.watchdog_cause() == cause
    assert crash_lines(chip) == ([line] if line else [])
    assert chip.fake_reset_flags_left() == 0  # the next start must not see the same flags
    chip.watchdog_begin()
    assert chip.watchdog_cause() == POWER_ON


@pytest.mark.parametrize(
    ("flags", "mark", "cause"),
    [
        (0, 0, POWER_ON),
        (SYSTEM_RESET_FLAG | WATCHDOG3_FLAG, 0, WATCHDOG),
        (TEMPERATURE_FLAG | SYSTEM_RESET_FLAG, 0, OVER_TEMPERATURE),
        (WATCHDOG_FLAG | 1, 0, WATCHDOG),
        (SYSTEM_RESET_FLAG, FAULT_HANDLER_MARK, CRASH),
        (1, FAULT_HANDLER_MARK, POWER_ON),  # what a register holds at power-on means nothing
    ],
)
def test_several_reset_flags_and_marks_have_an_order(chip: ctypes.CDLL, flags: int, mark: int, cause: int) -> None:
    chip.fake_reset_flags(flags, mark)
    chip.watchdog_begin()
    assert chip.watchdog_cause() == cause
    assert crash_lines(chip) == (["the fault's record is lost"] if cause == CRASH else [])
    assert chip.fake_reset_flags_left() == 0


def test_a_processor_that_got_too_hot_says_so(chip: ctypes.CDLL) -> None:
    """Teensyduino's fault handler serves the sensor's panic interrupt, too."""
    chip.fake_fault(fault_record(ipsr=TEMPERATURE_PANIC, ret=0x1234ABCD))
    chip.fake_reset_flags(WATCHDOG3_FLAG, 0)
    chip.watchdog_begin()
    assert chip.watchdog_cause() == OVER_TEMPERATURE
    assert crash_lines(chip) == ["too hot, above 90 C, at 0x1234ABCD"]


def test_an_interrupt_that_nobody_serves_is_told_by_its_number(chip: ctypes.CDLL) -> None:
    chip.fake_fault(fault_record(ipsr=16 + 93, ret=0x1234ABCD))
    chip.watchdog_begin()
    assert crash_lines(chip)[0] == "crash at 0x1234ABCD: unexpected interrupt 93"
    chip.fake_fault(fault_record(ipsr=2, ret=0x1234ABCD))
    chip.watchdog_begin()
    assert crash_lines(chip)[0] == "crash at 0x1234ABCD: exception 2"


def test_each_way_of_setting_it_up_gives_the_whole_time(chip: ctypes.CDLL) -> None:
    """And unlocks only once what was set up before has arrived."""
    chip.watchdog_start()
    for _ in range(3):
        chip.fake_watchdog_elapse_ms(190)
        chip.watchdog_expect_erase(True)
        chip.watchdog_expect_erase(False)
        chip.watchdog_expect_erase(True)
        chip.fake_watchdog_elapse_ms(960)
        chip.watchdog_expect_erase(False)
    chip.fake_watchdog_elapse_ms(190)
    assert not chip.fake_watchdog_bitten()
    assert not chip.fake_watchdog_misused()
    chip.fake_watchdog_elapse_ms(20)
    assert chip.fake_watchdog_bitten()


def test_a_reset_that_was_asked_for_is_known_afterwards(chip: ctypes.CDLL) -> None:
    assert chip.fake_resets(chip.watchdog_reset)
    chip.fake_reset_flags(SYSTEM_RESET_FLAG, chip.fake_reset_mark())
    chip.watchdog_begin()
    assert chip.watchdog_cause() == SOFTWARE
    assert crash_lines(chip) == []


def test_a_crash_is_reported_once_in_lines_that_fit_a_status_text(chip: ctypes.CDLL) -> None:
    chip.fake_fault(fault_record(cfsr=0x82, mmfar=0x20, ret=0x1234ABCD, hfsr=0x40000000))
    chip.fake_reset_flags(WATCHDOG3_FLAG, 0)  # the watchdog ends the fault handler's wait
    chip.watchdog_begin()
    assert chip.watchdog_cause() == CRASH
    lines = crash_lines(chip)
    assert lines == [
        "crash at 0x1234ABCD: forbidden memory",
        "CFSR 0x00000082 HFSR 0x40000000",
        "accessing 0x00000020",
    ]
    chip.watchdog_begin()
    assert crash_lines(chip) == []


@pytest.mark.parametrize("cfsr", [0, 0x1, 0x100, 0x8200, 0x10000, 0x01000000, 0xFFFFFFFF])
def test_every_kind_of_fault_fits_its_lines(chip: ctypes.CDLL, cfsr: int) -> None:
    chip.fake_fault(fault_record(cfsr=cfsr, bfar=0xDEADBEEF, ret=0xFFFFFFFF, hfsr=0xFFFFFFFF))
    chip.watchdog_begin()
    lines = crash_lines(chip)
    assert len(lines) == (3 if cfsr & 0x8080 else 2)
    assert all(0 < len(line) <= 50 for line in lines)


def test_memory_that_only_looks_like_a_crash_record_is_none(chip: ctypes.CDLL) -> None:
    good = fault_record(cfsr=0x82, ret=0x1000)
    rng = random.Random(2)
    for bit in range(8 * len(good)):
        broken = bytearray(good)
        broken[bit // 8] ^= 1 << bit % 8
        chip.fake_fault(bytes(broken))
        chip.fake_reset_flags(0, 0)
        chip.watchdog_begin()
        assert chip.watchdog_cause() == POWER_ON, f"bit {bit}"
    chip.fake_fault(rng.randbytes(len(good)))
    chip.watchdog_begin()
    assert crash_lines(chip) == []
