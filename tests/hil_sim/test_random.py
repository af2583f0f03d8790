# SPDX-License-Identifier: MIT
"""Philox against its published vectors, and the distributions drawn from it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from omniwheel._core import ffi, lib

ONES = 0xFFFFFFFF
# Known-answer vectors of the Random123 distribution: counter, key, output.
VECTORS = [
    ([0] * 4, [0] * 2, [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
    ([ONES] * 4, [ONES] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
    (
        [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
        [0xA4093822, 0x299F31D0],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ),
]
DRAWS = 20000


@pytest.mark.parametrize(("counter", "key", "expected"), VECTORS)
def test_philox_known_answers(counter: list[int], key: list[int], expected: list[int]) -> None:
    out = ffi.new("uint32_t[4]")
    lib.hil_philox(ffi.new("uint32_t[2]", key), ffi.new("uint32_t[4]", counter), out)
    assert list(out) == expected


def draws(kind: str, seed: int, stream: int) -> npt.NDArray[np.float64]:
    draw = getattr(lib, kind)
    return np.array([draw(seed, stream, index) for index in range(DRAWS)])


def test_uniform_is_uniform() -> None:
    sample = draws("hil_uniform", 7, 3)
    assert sample.min() >= 0.0
    assert sample.max() < 1.0
    assert stats.kstest(sample, "uniform").pvalue > 0.01


def test_normal_is_normal_and_white() -> None:
    sample = draws("hil_normal", 7, 3)
    assert stats.kstest(sample, "norm").pvalue > 0.01
    assert abs(np.corrcoef(sample[:-1], sample[1:])[0, 1]) < 4 / np.sqrt(DRAWS)


def test_four_normals_are_normal_and_independent() -> None:
    out = ffi.new("double[4]")
    rows = []
    for index in range(DRAWS // 4):
        lib.hil_normal4(7, 3, index, out)
        rows.append(list(out))
    sample = np.array(rows)
    assert stats.kstest(sample.ravel(), "norm").pvalue > 0.01
    # neither the numbers nor their sizes (Box-Muller's pairs share a radius) are related
    for values in (sample, sample**2):
        correlation = np.corrcoef(values, rowvar=False) - np.eye(4)
        assert np.abs(correlation).max() < 4.5 / np.sqrt(len(sample))
    lib.hil_normal4(7, 3, 0, out)
    assert list(out) == rows[0]


def test_streams_are_independent() -> None:
    first, second = draws("hil_normal", 7, 3), draws("hil_normal", 7, 4)
    assert abs(np.corrcoef(first, second)[0, 1]) < 4 / np.sqrt(DRAWS)


@given(st.integers(0, 2**64 - 1), st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1))
def test_every_number_is_a_pure_function_in_range(seed: int, stream: int, index: int) -> None:
    uniform, normal = lib.hil_uniform(seed, stream, index), lib.hil_normal(seed, stream, index)
    assert 0.0 <= uniform < 1.0
    assert np.isfinite(normal)
    assert lib.hil_uniform(seed, stream, index) == uniform
    assert lib.hil_normal(seed, stream, index) == normal


def test_high_words_of_seed_and_index_count() -> None:
    base = lib.hil_uniform(1, 0, 0)
    assert lib.hil_uniform(1 + 2**32, 0, 0) != base
    assert lib.hil_uniform(1, 0, 2**32) != base
