# SPDX-License-Identifier: MIT
"""The H-bridge: truth table, drive-brake against drive-coast, sleep; coast against a time-domain simulation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib

PERIOD_s = 1 / 1525.88
SUPPLY_V = 12.0
R, L = 2.7, 1.4e-3
DIODES_V = 1.6
share = st.floats(0, 1)


def bridge(in1: float, in2: float, phase1: float = 0.0, phase2: float = 0.0, period_s: float = PERIOD_s) -> Any:
    made = ffi.new("hil_drv8871_t *")
    lib.hil_drv8871_inputs(made, in1, phase1, in2, phase2, period_s)
    return made


def winding(emf_V: float = 0.0) -> Any:
    return ffi.new("hil_winding_t *", (R, L, emf_V))


def mean_V(made: Any, emf_V: float = 0.0) -> float:
    return float(lib.hil_drv8871_mean_V(made, winding(emf_V), SUPPLY_V))


@pytest.mark.parametrize(("in1", "in2", "volts"), [(1, 0, 12.0), (0, 1, -12.0), (1, 1, 0.0)])
def test_truth_table(in1: int, in2: int, volts: float) -> None:
    made = bridge(in1, in2)
    assert not lib.hil_drv8871_open(made)
    assert mean_V(made, emf_V=3.0) == volts


def test_both_low_is_open() -> None:
    assert lib.hil_drv8871_open(bridge(0, 0))


@given(st.floats(-1, 1))
def test_drive_brake_is_linear(duty: float) -> None:
    made = bridge(1.0, 1.0 - duty) if duty >= 0 else bridge(1.0 + duty, 1.0)
    assert made.coast == 0.0
    assert math.isclose(mean_V(made, emf_V=2.0), duty * SUPPLY_V, abs_tol=1e-9)


@given(share, share, share, share)
def test_shares_from_overlap_match_counting(in1: float, in2: float, phase1: float, phase2: float) -> None:
    made = bridge(in1, in2, phase1, phase2)
    t = (np.arange(4096) + 0.5) / 4096
    high1, high2 = (t - phase1) % 1 < in1, (t - phase2) % 1 < in2
    assert abs(made.coast - np.mean(~high1 & ~high2)) < 2e-3
    assert abs(made.drive - (np.mean(high1) - np.mean(high2))) < 2e-3


def simulated_mean_current(duty: float, emf_V: float) -> float:
    """Drive-coast by stepping through many periods."""
    n = 4000
    dt = PERIOD_s / n
    current = 0.0
    for _ in range(12):
        total = 0.0
        for k in range(n):
            if k < duty * n:
                volts = SUPPLY_V - emf_V - R * current
            elif current > 0:
                volts = -SUPPLY_V - DIODES_V - emf_V - R * current
            else:
                volts = 0.0
            current = max(current + dt / L * volts, 0.0)
            total += current
    return total / n


@pytest.mark.parametrize("duty", [0.1, 0.3, 0.6, 0.9])
@pytest.mark.parametrize("emf_V", [0.0, 3.0])
def test_drive_coast_matches_time_domain(duty: float, emf_V: float) -> None:
    made = bridge(duty, 0.0)
    current = (mean_V(made, emf_V) - emf_V) / R
    assert math.isclose(current, simulated_mean_current(duty, emf_V), rel_tol=0.25, abs_tol=0.01)


def test_drive_coast_is_symmetric() -> None:
    assert math.isclose(mean_V(bridge(0.4, 0.0), 1.0), -mean_V(bridge(0.0, 0.4), -1.0), rel_tol=1e-12)


def test_slow_drive_coast_sleeps_every_period_and_loses_its_waking_time() -> None:
    slow_s = 1 / 100
    made = bridge(0.5, 0.0, period_s=slow_s)
    assert math.isclose(made.drive, 0.5 - 45e-6 / slow_s)
    assert bridge(0.5, 0.0).drive == 0.5, "awake at 1526 Hz"
    assert bridge(1.0, 0.5, period_s=slow_s).drive == 0.5, "never low, never asleep"


@pytest.mark.parametrize("start_A", [2.0, -2.0])
def test_freewheeling_current_dies_and_stays_zero(start_A: float) -> None:
    current = ffi.new("double *", start_A)
    mean = lib.hil_drv8871_freewheel(winding(), SUPPLY_V, 1e-3, current)
    assert current[0] == 0.0
    assert 0 < mean / start_A < 0.1
    assert lib.hil_drv8871_freewheel(winding(5.0), SUPPLY_V, 1e-3, current) == 0.0


def test_freewheeling_takes_its_time() -> None:
    current = ffi.new("double *", 2.0)
    lib.hil_drv8871_freewheel(winding(), SUPPLY_V, 1e-5, current)
    slope = (SUPPLY_V + DIODES_V + R * 2.0) / L
    assert math.isclose(current[0], 2.0 - slope * 1e-5)
