# SPDX-License-Identifier: MIT
"""Duty to the two inputs of a DRV8871 in drive-brake mode."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import lib

STEPS = 4096


def counts(duty: float, drive: bool = True) -> tuple[int, int]:
    out = lib.omni_bridge_counts(duty, drive)
    return out.in1, out.in2


def mean_duty(in1: int, in2: int) -> float:
    """Return mean output voltage over supply: 10 is forward, 01 reverse, both rise together."""
    forward = max(in1 - in2, 0)
    reverse = max(in2 - in1, 0)
    return (forward - reverse) / STEPS


@given(st.floats(-1, 1, width=32))
def test_the_mean_voltage_is_the_duty_to_half_a_step(duty: float) -> None:
    in1, in2 = counts(duty)
    assert max(in1, in2) == STEPS
    assert min(in1, in2) >= 0
    assert mean_duty(in1, in2) == pytest.approx(duty, abs=0.5001 / STEPS)


@given(st.floats(-1, 1, width=32))
def test_both_directions_are_mirror_images(duty: float) -> None:
    assert counts(duty) == counts(-duty)[::-1]


@given(st.floats(width=32))
def test_without_drive_both_inputs_are_low(duty: float) -> None:
    assert counts(duty, drive=False) == (0, 0)


@pytest.mark.parametrize("duty", [0.0, -0.0, 1e-5, math.nan])
def test_no_duty_brakes(duty: float) -> None:
    assert counts(duty) == (STEPS, STEPS)


@pytest.mark.parametrize("duty", [1.0, 1.5, 1e30, math.inf])
def test_more_than_full_duty_is_full_duty(duty: float) -> None:
    assert counts(duty) == (STEPS, 0)
    assert counts(-duty) == (0, STEPS)
