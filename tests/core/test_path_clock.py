# SPDX-License-Identifier: MIT
"""The clock of a path brakes as the mirror of how it started, to the nanosecond, and ends exactly."""

from __future__ import annotations

import ctypes

import pytest

from omniwheel import _core
from omniwheel._core import ffi
from tests.core.test_trajectory import Plan


class Clock(ctypes.Structure):
    """omni_path_clock_t."""

    _fields_ = [
        ("path_ns", ctypes.c_uint64),
        ("rate", ctypes.c_float),
        ("rate_change", ctypes.c_float),
        ("done", ctypes.c_bool),
    ]


CORE = ctypes.CDLL(_core.__file__)
CORE.omni_path_clock.restype = Clock
CORE.omni_path_clock.argtypes = [ctypes.c_void_p, ctypes.c_uint64]
CORE.omni_path_real_ns.restype = ctypes.c_uint64
CORE.omni_path_real_ns.argtypes = [ctypes.c_void_p]


def clock(plan: Plan, time_ns: int) -> Clock:
    found: Clock = CORE.omni_path_clock(int(ffi.cast("uintptr_t", plan.c)), time_ns)
    return found


@pytest.mark.parametrize("period_s", [3.0, 20.0, 61.7])
def test_braking_mirrors_starting_to_the_nanosecond(period_s: float) -> None:
    plan = Plan({"period_s": period_s})
    total = CORE.omni_path_real_ns(int(ffi.cast("uintptr_t", plan.c)))
    duration = int(plan.c.timing.duration_ns)
    for after in (0, 1, 2, 1000, 123_456_789, int(plan.c.timing.ramp_ns) - 1):
        start, brake = clock(plan, after), clock(plan, total - 1 - after)
        assert brake.path_ns == duration - start.path_ns
        assert (brake.rate, brake.rate_change) == (start.rate, -start.rate_change)
        assert not brake.done
    for time_ns in (total, total + 1, total + 10**12):
        end = clock(plan, time_ns)
        assert (end.path_ns, end.rate, end.rate_change, end.done) == (duration, 0.0, 0.0, True)
