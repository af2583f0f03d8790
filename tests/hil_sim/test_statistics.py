# SPDX-License-Identifier: MIT
from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hil_sim.statistics import RELATIVE_ERROR, Spread, bucket_codes

ANY = st.floats(allow_nan=True, allow_infinity=True)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
MODERATE = st.floats(-1e6, 1e6)


def array(values: list[float]) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)


@given(st.lists(FINITE, min_size=1, max_size=200), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_quantiles_keep_their_error(values: list[float], q: float) -> None:
    exact = np.sort(array(values))[math.floor(q * (len(values) - 1))]
    found = Spread.of(array(values)).quantile(q)
    assert abs(found - exact) <= RELATIVE_ERROR * abs(exact) + np.finfo(np.float64).tiny


@pytest.mark.parametrize("scale", [1e-300, 1e-3, 1.0, 1e300])
def test_quantiles_of_awkward_distributions(scale: float) -> None:
    random = np.random.default_rng(1)
    values = scale * np.concatenate([random.lognormal(0.0, 3.0, 5000), -random.pareto(1.0, 5000), np.zeros(100)])
    spread = Spread.of(values)
    for q in (0.0, 0.001, 0.01, 0.25, 0.5, 0.505, 0.9, 0.999, 1.0):
        exact = np.quantile(values, q, method="lower")
        assert spread.quantile(q) == pytest.approx(exact, rel=RELATIVE_ERROR, abs=1e-307)
    assert len(spread.buckets) < 15_000


@given(st.lists(ANY, max_size=60), st.lists(ANY, max_size=60))
@settings(max_examples=60, deadline=None)
def test_quantiles_and_extremes_do_not_depend_on_the_order_of_merging(one: list[float], other: list[float]) -> None:
    a, b = Spread.of(array(one)), Spread.of(array(other))
    whole = Spread.of(array([*one, *other]))
    for found in (a.merge(b), b.merge(a)):
        assert found.buckets == whole.buckets
        assert (found.count, found.missing) == (whole.count, whole.missing)
        np.testing.assert_array_equal([found.min, found.max], [whole.min, whole.max])


@given(st.lists(MODERATE, min_size=2, max_size=100), st.integers(0, 100))
@settings(max_examples=60, deadline=None)
def test_mean_and_deviation_are_those_of_the_values(values: list[float], cut: int) -> None:
    data = array(values)
    size = float(np.max(np.abs(data)))
    for spread in (Spread.of(data), Spread.of(data[:cut]).merge(Spread.of(data[cut:]))):
        assert spread.mean == pytest.approx(float(np.mean(data)), rel=1e-12, abs=1e-14 * size + 1e-300)
        assert spread.sd == pytest.approx(float(np.std(data, ddof=1)), rel=1e-9, abs=1e-13 * size + 1e-300)


def test_a_small_deviation_about_a_large_mean_survives() -> None:
    data = 1e6 + np.random.default_rng(2).normal(0.0, 1e-3, 10_000)
    whole = Spread()
    for piece in np.split(data, 100):
        whole = whole.merge(Spread.of(piece))
    assert whole.sd == pytest.approx(float(np.std(data, ddof=1)), rel=1e-6)


@given(st.lists(FINITE, min_size=2, max_size=50))
@settings(max_examples=60, deadline=None)
def test_buckets_are_in_the_values_order(values: list[float]) -> None:
    data = np.sort(array(values))
    assert np.all(np.diff(bucket_codes(data)) >= 0)


def test_what_is_not_a_number_is_counted_and_left_out() -> None:
    spread = Spread.of(array([1.0, math.nan, 3.0, math.inf, -math.inf]))
    assert (spread.count, spread.missing, spread.mean, spread.max) == (2, 3, 2.0, 3.0)
    nothing = Spread.of(array([math.nan]))
    assert all(
        math.isnan(value) for value in (nothing.mean, nothing.sd, nothing.min, nothing.max, nothing.quantile(0.5))
    )
    assert nothing.merge(spread).mean == spread.merge(nothing).mean == 2.0
    assert Spread.of(array([4.0])).sd == 0.0


@given(st.lists(MODERATE, max_size=40))
@settings(max_examples=60, deadline=None)
def test_json_keeps_every_bit(values: list[float]) -> None:
    spread = Spread.of(array(values))
    assert Spread.from_dict(json.loads(json.dumps(spread.to_dict(), allow_nan=False))) == spread


def test_a_quantile_outside_is_refused() -> None:
    with pytest.raises(ValueError, match="0 to 1"):
        Spread().quantile(1.5)
