# SPDX-License-Identifier: MIT
"""The safety table, every state with every event."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib

STATES = ["INIT", "DISARMED", "ARMED", "FAILSAFE", "ESTOP"]
EVENTS = ["READY", "ARM", "DISARM", "FAULT", "ESTOP", "ESTOP_CLEAR"]


def state(name: str) -> int:
    return int(getattr(lib, f"OMNI_STATE_{name}"))


def event(name: str) -> int:
    return int(getattr(lib, f"OMNI_SAFETY_{name}"))


def text(pointer: object) -> str:
    return str(ffi.string(pointer).decode())


def expected(current: str, happened: str) -> str:
    """Return the next state by the rules in words, not by a table."""
    if current == "ESTOP":  # latched: only clearing leaves it, and only to where motors are off
        return "DISARMED" if happened == "ESTOP_CLEAR" else "ESTOP"
    if happened == "ESTOP":  # wins over everything
        return "ESTOP"
    if current == "INIT":  # nothing but passed boot checks ends booting
        return "DISARMED" if happened == "READY" else "INIT"
    if happened == "DISARM":
        return "DISARMED"
    if current == "DISARMED" and happened == "ARM":
        return "ARMED"
    if current == "ARMED" and happened == "FAULT":
        return "FAILSAFE"
    return current


@pytest.mark.parametrize(("current", "happened"), list(itertools.product(STATES, EVENTS)))
def test_every_state_with_every_event(current: str, happened: str) -> None:
    assert lib.omni_safety_next(state(current), event(happened)) == state(expected(current, happened))


def test_the_test_knows_all_states_and_events() -> None:
    assert len(STATES) == lib.OMNI_STATE_COUNT
    assert len(EVENTS) == lib.OMNI_SAFETY_EVENT_COUNT
    assert sorted(state(s) for s in STATES) == list(range(len(STATES)))
    assert sorted(event(e) for e in EVENTS) == list(range(len(EVENTS)))


def test_armed_is_reached_only_by_arming_from_disarmed() -> None:
    ways = [
        (s, e)
        for s, e in itertools.product(STATES, EVENTS)
        if s != "ARMED" and lib.omni_safety_next(state(s), event(e)) == state("ARMED")
    ]
    assert ways == [("DISARMED", "ARM")]


@given(st.lists(st.sampled_from([e for e in EVENTS if e != "ESTOP_CLEAR"])))
def test_an_emergency_stop_holds_until_cleared(events: list[str]) -> None:
    now = lib.omni_safety_next(state("ARMED"), event("ESTOP"))
    for name in events:
        now = lib.omni_safety_next(now, event(name))
        assert now == state("ESTOP")
    assert lib.omni_safety_next(now, event("ESTOP_CLEAR")) == state("DISARMED")


@pytest.mark.parametrize(("current", "happened"), [(5, 0), (0, 6), (255, 255), (2**31, 1), (1, 2**32 - 1)])
def test_what_should_not_exist_stops(current: int, happened: int) -> None:
    assert lib.omni_safety_next(current, happened) == state("ESTOP")


def test_state_names() -> None:
    assert [text(lib.omni_safety_state_name(state(s))) for s in STATES] == [s.lower() for s in STATES]
    assert text(lib.omni_safety_state_name(lib.OMNI_STATE_COUNT)) == "?"


def test_every_fault_bit_has_its_own_name() -> None:
    known = lib.OMNI_FAULT_STOP_MASK | lib.OMNI_WARN_MASK
    names = {bit: text(lib.omni_fault_name(1 << bit)) for bit in range(32)}
    named = {bit: name for bit, name in names.items() if known >> bit & 1}
    assert "?" not in named.values()
    assert len(set(named.values())) == len(named)
    assert all(name == name.lower() and len(name) <= 16 for name in named.values())
    assert {name for bit, name in names.items() if not known >> bit & 1} == {"?"}


@pytest.mark.parametrize("bits", [0, 3, 0xFFFFFFFF])
def test_no_bit_or_several_have_no_name(bits: int) -> None:
    assert text(lib.omni_fault_name(bits)) == "?"


def test_some_names_are_what_a_user_will_read() -> None:
    assert text(lib.omni_fault_name(lib.OMNI_FAULT_ENCODER)) == "encoder"
    assert text(lib.omni_fault_name(lib.OMNI_FAULT_COMMAND_LOSS)) == "command loss"
