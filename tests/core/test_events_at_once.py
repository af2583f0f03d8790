# SPDX-License-Identifier: MIT
"""The whole tick in every state, with every set of events at once, with and without a stop fault."""

from __future__ import annotations

import itertools

import pytest

from omniwheel._core import lib
from tests.core.test_robot import Bench

STATES = ("INIT", "DISARMED", "ARMED", "FAILSAFE", "ESTOP")
EVENTS = ("ARM", "DISARM", "ESTOP", "ESTOP_CLEAR", "TRAJECTORY_START", "TRAJECTORY_STOP", "SET_POSE")
SUBSETS = [subset for count in range(len(EVENTS) + 1) for subset in itertools.combinations(EVENTS, count)]


def expected(before: str, events: tuple[str, ...], fault: bool) -> str:
    """What stops wins over what starts; a release comes first, an emergency stop last."""
    if "ESTOP" in events:
        return "ESTOP"
    now = "DISARMED" if before == "INIT" or (before == "ESTOP" and "ESTOP_CLEAR" in events) else before
    if now == "ESTOP":
        return now
    if now == "DISARMED" and "ARM" in events and not fault:
        now = "ARMED"
    if "DISARM" in events:
        return "DISARMED"
    return "FAILSAFE" if now == "ARMED" and fault else now


def name_of(state: int) -> str:
    return next(name for name in STATES if getattr(lib, f"OMNI_STATE_{name}") == state)


def bench_in(state: str, fault: bool) -> Bench:
    """Return a robot in a state that has been asked to turn, so that any voltage it may give shows."""
    bench = Bench()
    bench.tick(count=2)
    if state == "ARMED":
        bench.tick(lib.OMNI_EVENT_ARM)
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.3))
        bench.tick(count=100)
    bench.robot.supervisor.state = getattr(lib, f"OMNI_STATE_{state}")
    bench.inputs.faults = lib.OMNI_FAULT_OVERRUN if fault else 0
    bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.3))
    return bench


@pytest.mark.parametrize("fault", [False, True], ids=["healthy", "fault"])
@pytest.mark.parametrize("before", STATES)
def test_every_state_with_every_set_of_events(before: str, fault: bool) -> None:
    for events in SUBSETS:
        bench = bench_in(before, fault)
        bits = sum(getattr(lib, f"OMNI_EVENT_{event}") for event in events)
        out = bench.tick(bits)
        now = expected(before, events, fault)
        assert name_of(out.state) == now, events
        assert out.drive == (now == "ARMED"), events
        if now != "ARMED":
            assert list(out.duty) == [0.0] * 4, events
        elif before == "ARMED":
            assert max(abs(duty) for duty in out.duty) > 0.1, events
