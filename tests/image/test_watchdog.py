# SPDX-License-Identifier: MIT
"""WDOG3: when it bites, and what one has to do to configure or calm it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from omniwheel._core import lib
from tests.image.assembly import Program
from tests.image.chip import Chip, parked, parked_program

CS, CNT, TOVAL, WIN = 0x400BC000, 0x400BC004, 0x400BC008, 0x400BC00C
CCGR5, SRC_SCR, SRC_SRSR = 0x400FC07C, 0x400F8000, 0x400F8008
UNLOCK, REFRESH = 0xD928C520, 0xB480A602
UPDATE, INT, EN, LPO, RCS, ULK = 1 << 5, 1 << 6, 1 << 7, 1 << 8, 1 << 10, 1 << 11
PRES, CMD32EN, FLG, WIN_EN = 1 << 12, 1 << 13, 1 << 14, 1 << 15
RUNNING = CMD32EN | LPO | UPDATE | EN
WDOG3_RESET = 1 << 7
FOUND = lib.RT1062_FINDING_WATCHDOG


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Return a program that waits in RAM."""
    return parked_program(tmp_path_factory.mktemp("parked"))


@pytest.fixture
def chip(program: Program) -> Iterator[Chip]:
    """Return a chip whose watchdog has a clock, and that tells of resets."""
    with parked(program) as chip:
        lib.rt1062_stop_on(chip.c, 1 << lib.RT1062_STOP_RESET)
        chip.write(CCGR5, chip.read(CCGR5) | 3 << 4)
        yield chip


def configure(chip: Chip, toval: int, cs: int = RUNNING, win: int | None = None) -> None:
    """Configure it, unlocking it before."""
    chip.write(CNT, UNLOCK)
    chip.write(TOVAL, toval)
    if win is not None:
        chip.write(WIN, win)
    chip.write(CS, cs)


def bite_ns(chip: Chip, limit_ns: float) -> int | None:
    """Return after what time it bites."""
    begin = chip.now_ns
    if chip.wait(limit_ns) == lib.RT1062_STOP_TIME:
        return None
    assert chip.read(SRC_SRSR) & WDOG3_RESET
    return chip.now_ns - begin - 5_000_000  # the boot ROM's time


def test_is_off_when_the_program_begins(chip: Chip) -> None:
    assert not chip.read(CS) & EN
    assert bite_ns(chip, 100e6) is None


@pytest.mark.parametrize(("toval", "cs"), [(6400, RUNNING), (100, RUNNING), (10, RUNNING | PRES)])
def test_bites_when_its_time_is_over(chip: Chip, toval: int, cs: int) -> None:
    configure(chip, toval, cs)
    assert chip.read(CS) & EN
    wanted = toval * (256 if cs & PRES else 1) / 32768 * 1e9
    assert bite_ns(chip, 1e9) == pytest.approx(wanted, abs=1000)
    assert chip.found(FOUND) == ["WDOG3 was not refreshed in time: it bites"]


def test_refreshing_calms_it(chip: Chip) -> None:
    configure(chip, 6400)
    for _ in range(10):
        assert chip.wait(150e6) == lib.RT1062_STOP_TIME
        chip.write(CNT, REFRESH)
    assert bite_ns(chip, 1e9) == pytest.approx(6400 / 32768 * 1e9, abs=1000)


def test_configuring_does_not_refresh(chip: Chip) -> None:
    """A longer time-out, used up beyond the shorter one that comes back: it bites at once."""
    configure(chip, 32000)
    chip.wait(300e6)
    configure(chip, 6400)
    assert bite_ns(chip, 1e6) == pytest.approx(0, abs=1000)


@pytest.mark.parametrize("register", [CS, TOVAL, WIN])
def test_locked_registers_keep_their_values(chip: Chip, register: int) -> None:
    configure(chip, 6400)
    before = chip.read(register)
    chip.write(register, 0x2120)
    assert chip.read(register) == before
    assert len(chip.found(FOUND)) == 1


def test_the_window_closes_after_128_bus_clocks(chip: Chip) -> None:
    """132 MHz after the boot ROM: 970 ns."""
    chip.write(CNT, UNLOCK)
    assert chip.read(CS) & ULK
    chip.wait(900)
    assert chip.read(CS) & ULK
    chip.write(TOVAL, 100)
    chip.wait(200)
    assert not chip.read(CS) & ULK
    chip.write(CS, RUNNING)
    assert chip.read(TOVAL) != 100
    assert not chip.read(CS) & (RCS | EN)
    assert chip.found(FOUND) != []


def test_says_when_a_configuration_has_come_through(chip: Chip) -> None:
    """Three periods of its 32.768 kHz: 91.6 us."""
    configure(chip, 6400)
    assert not chip.read(CS) & RCS
    chip.wait(90_000)
    assert not chip.read(CS) & RCS
    chip.wait(3_000)
    assert chip.read(CS) & RCS
    chip.write(CNT, UNLOCK)
    assert not chip.read(CS) & RCS


def test_needs_both_registers(chip: Chip) -> None:
    chip.write(CNT, UNLOCK)
    chip.write(CS, RUNNING)
    assert not chip.read(CS) & (RCS | EN)
    assert not chip.read(CS) & EN
    chip.write(TOVAL, 100)
    assert chip.read(CS) & EN


@pytest.mark.parametrize(("value", "size"), [(0, 4), (0xD928C521, 4), (0xC520, 2)])
def test_anything_else_written_to_the_counter_resets(chip: Chip, value: int, size: int) -> None:
    chip.write(CNT, value, size)
    assert bite_ns(chip, 1e6) == pytest.approx(0, abs=1000)
    assert len(chip.found(FOUND)) == 1


def test_without_update_it_cannot_be_changed_any_more(chip: Chip) -> None:
    configure(chip, 6400, RUNNING & ~UPDATE)
    chip.wait(1e6)
    chip.write(CNT, UNLOCK)
    assert bite_ns(chip, 1e6) == pytest.approx(0, abs=1000)
    assert len(chip.found(FOUND)) == 1


def test_halfword_commands(chip: Chip) -> None:
    configure(chip, 6400, RUNNING & ~CMD32EN)
    chip.wait(100e6)
    for command in (REFRESH, UNLOCK):
        chip.write(CNT, command & 0xFFFF, 2)
        chip.write(CNT, command >> 16, 2)
    assert chip.read(CNT) == 0
    assert chip.read(CS) & ULK
    chip.write(CNT, REFRESH & 0xFFFF, 2)
    chip.wait(1000)
    chip.write(CNT, REFRESH >> 16, 2)  # too late
    assert bite_ns(chip, 1e6) == pytest.approx(0, abs=1000)


def test_refreshing_before_its_window_bites(chip: Chip) -> None:
    configure(chip, 6400, RUNNING | WIN_EN, win=3200)
    chip.wait(150e6)
    chip.write(CNT, REFRESH)
    assert chip.wait(50e6) == lib.RT1062_STOP_TIME
    chip.write(CNT, REFRESH)
    assert bite_ns(chip, 1e6) == pytest.approx(0, abs=1000)
    assert len(chip.found(FOUND)) == 1


def test_the_interrupt_comes_before_the_reset(chip: Chip) -> None:
    configure(chip, 100, RUNNING | INT)
    bite = 100 / 32768 * 1e9
    assert chip.wait(bite + 500) == lib.RT1062_STOP_TIME
    assert chip.read(CS) & FLG
    assert bite_ns(chip, 1e6) == pytest.approx(128 / 132e6 * 1e9 - 500, abs=200)


def test_a_masked_reset_does_not_happen(chip: Chip) -> None:
    chip.write(SRC_SCR, (chip.read(SRC_SCR) & 0x0FFFFFFF) | 5 << 28)
    configure(chip, 100)
    assert chip.wait(100e6) == lib.RT1062_STOP_TIME


def test_without_a_clock_it_cannot_be_reached(chip: Chip) -> None:
    chip.write(CCGR5, chip.read(CCGR5) & ~(3 << 4))
    configure(chip, 100)
    assert chip.read(CS) == 0
    assert chip.found(lib.RT1062_FINDING_CLOCK) != []
    assert bite_ns(chip, 100e6) is None
