# SPDX-License-Identifier: MIT
"""Limits that keep the direction of a wheel vector (eq. 30)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib

vectors = st.lists(st.floats(-1000, 1000, width=32), min_size=1, max_size=4)
limits = st.floats(0.125, 100, width=32)


def saturate(values: list[float], limit: float) -> tuple[float, list[float]]:
    out = ffi.new("float[]", values)
    factor = lib.omni_saturate_direction(out, len(values), limit)
    return factor, list(out)


@given(vectors, limits)
def test_nothing_exceeds_the_limit_and_the_direction_stays(values: list[float], limit: float) -> None:
    factor, out = saturate(values, limit)
    assert 0.0 < factor <= 1.0
    assert max(abs(v) for v in out) <= limit
    np.testing.assert_allclose(out, np.array(values) * factor, rtol=1e-6, atol=1e-30)


@given(vectors, limits)
def test_values_are_cut_only_if_they_must_be(values: list[float], limit: float) -> None:
    factor, out = saturate(values, limit)
    peak = max(abs(v) for v in values)
    if peak <= limit:
        assert factor == 1.0
        assert out == values
    else:
        assert max(abs(v) for v in out) == pytest.approx(limit, rel=1e-6)


@given(vectors, limits)
def test_a_second_pass_changes_nothing(values: list[float], limit: float) -> None:
    _, once = saturate(values, limit)
    assert saturate(once, limit) == (1.0, once)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("slot", range(3))
def test_values_that_are_not_finite_zero_all(bad: float, slot: int) -> None:
    values = [1.0, -2.0, 3.0]
    values[slot] = bad
    assert saturate(values, 10.0) == (0.0, [0.0, 0.0, 0.0])


@pytest.mark.parametrize("limit", [0.0, -1.0, math.nan, -math.inf])
def test_a_limit_that_allows_nothing_zeroes_all(limit: float) -> None:
    assert saturate([0.5, -0.25], limit) == (0.0, [0.0, 0.0])


def test_only_the_counted_values_are_touched() -> None:
    out = ffi.new("float[4]", [4.0, 2.0, 9.0, math.nan])
    assert lib.omni_saturate_direction(out, 2, 1.0) == 0.25
    assert list(out)[:3] == [1.0, 0.5, 9.0]
