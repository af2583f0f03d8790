# SPDX-License-Identifier: MIT
"""How many texts a link is told: a burst, then one per interval; what is left out is counted and said."""

from __future__ import annotations

import ctypes
from itertools import count
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.native import kept_library

BURST, RESERVE = 10, 2
INTERVAL_US = 1_000_000
START_US = 50_000_000
SAME = 7


class Gate:
    """A fresh gate."""

    def __init__(self, library: ctypes.CDLL, interval_us: int = INTERVAL_US) -> None:
        self._c = library
        self._sums = count(1000)
        library.gate_new(ctypes.c_uint64(interval_us))

    def another(self, now_us: int = START_US) -> bool:
        """Whether a text may go that differs from the one before."""
        return bool(self._c.gate_pass(ctypes.c_uint64(now_us), next(self._sums)))

    def same(self, now_us: int = START_US) -> bool:
        return bool(self._c.gate_pass(ctypes.c_uint64(now_us), SAME))

    def others(self, tries: int, now_us: int = START_US) -> int:
        """How many of so many different texts may go."""
        return sum(self.another(now_us) for _ in range(tries))

    def repeated(self, tries: int, now_us: int = START_US) -> int:
        return sum(self.same(now_us) for _ in range(tries))

    def left_out_by_others(self, number: int) -> None:
        self._c.gate_count(number)

    def told(self, now_us: int = START_US) -> int:
        return int(self._c.gate_take_left_out(ctypes.c_uint64(now_us)))


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    shim = Path(__file__).parent / "text_shim.cpp"
    built = ctypes.CDLL(str(kept_library("gate", [shim])))
    built.gate_pass.restype = ctypes.c_bool
    return built


@pytest.mark.full
@given(tries=st.integers(0, 40), interval_us=st.integers(1, 10**9))
def test_a_burst_of_different_texts_goes_at_once(library: ctypes.CDLL, tries: int, interval_us: int) -> None:
    assert Gate(library, interval_us).others(tries) == min(tries, BURST)


@given(intervals=st.integers(0, 25), part=st.integers(0, INTERVAL_US - 1))
def test_then_one_for_each_whole_interval(library: ctypes.CDLL, intervals: int, part: int) -> None:
    gate = Gate(library)
    assert gate.others(20) == BURST
    later_us = START_US + intervals * INTERVAL_US + part
    assert gate.others(20, later_us) == min(intervals, BURST)
    if intervals < BURST:  # the part of an interval is not lost
        next_us = START_US + (intervals + 1) * INTERVAL_US
        assert gate.others(2, next_us - 1) == 0
        assert gate.others(2, next_us) == 1


def test_a_gate_that_is_full_gains_nothing_by_waiting(library: ctypes.CDLL) -> None:
    gate = Gate(library)
    assert gate.others(1) == 1
    assert gate.others(3, START_US + 5 * INTERVAL_US) == 3
    assert gate.others(20, START_US + 6 * INTERVAL_US - 1) == BURST - 3
    assert gate.others(20, START_US + 6 * INTERVAL_US) == 1


def test_a_repeated_text_leaves_room_for_another_one(library: ctypes.CDLL) -> None:
    gate = Gate(library)
    assert gate.repeated(30) == BURST - RESERVE
    assert gate.others(30) == RESERVE


def test_a_repeated_text_waits_until_what_was_left_out_is_said(library: ctypes.CDLL) -> None:
    gate = Gate(library)
    gate.repeated(BURST)
    later_us = START_US + 100 * INTERVAL_US
    assert not gate.same(later_us)
    assert gate.told(later_us) == RESERVE + 1
    assert gate.same(later_us)


def test_two_texts_in_turns_are_no_repetition(library: ctypes.CDLL) -> None:
    gate = Gate(library)
    assert sum(gate.same() if i % 2 else gate.another() for i in range(30)) == BURST


@given(refused=st.integers(0, 50), counted=st.integers(0, 50))
def test_every_text_goes_or_is_counted(library: ctypes.CDLL, refused: int, counted: int) -> None:
    gate = Gate(library)
    gone = gate.others(refused)
    gate.left_out_by_others(counted)
    later_us = START_US + 100 * INTERVAL_US
    assert gone + gate.told(later_us) == refused + counted
    assert gate.told(later_us) == 0
    took = 1 if refused - gone + counted else 0
    assert gate.others(30, later_us) == BURST - took, "saying so is a text, too"


def test_what_was_left_out_is_not_said_with_the_last_ones(library: ctypes.CDLL) -> None:
    gate = Gate(library)
    gate.others(BURST + 5)
    for intervals in range(RESERVE + 1):
        assert gate.told(START_US + intervals * INTERVAL_US) == 0
    assert gate.told(START_US + (RESERVE + 1) * INTERVAL_US) == 5


def test_a_clock_that_starts_over_gives_nothing_away_and_goes_on(library: ctypes.CDLL) -> None:
    gate = Gate(library)
    gate.others(BURST)
    assert gate.others(5, 1000) == 0
    assert gate.others(5, 1000 + INTERVAL_US - 1) == 0
    assert gate.others(5, 1000 + INTERVAL_US) == 1
