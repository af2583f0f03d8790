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


def normals(seed: int, stream: int, blocks: int, first: int = 0) -> npt.NDArray[np.float64]:
    """Return blocks of four normals (blocks, 4)."""
    out = np.empty((blocks, 4), dtype=np.float32)
    lib.hil_normals(seed, stream, first, blocks, ffi.cast("float *", ffi.from_buffer(out)))
    return out.astype(float)


@pytest.mark.full
def test_many_normals_are_normal() -> None:
    sample = normals(7, 3, 500_000).ravel()
    assert stats.kstest(sample, "norm").pvalue > 0.01
    # standard errors of the first four moments
    for power, expected, error in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert abs((sample**power).mean() - expected) < 4.5 * np.sqrt(error / sample.size)


@pytest.mark.parametrize("edge", [2.5, 3.5, 4.5])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_tails_hold_what_they_must(edge: float, sign: float) -> None:
    sample = normals(8, 3, 2_000_000)
    expected = sample.size * stats.norm.sf(edge)
    for column in range(4):
        assert abs((sign * sample[:, column] > edge).sum() - expected / 4) < 4.5 * np.sqrt(expected / 4) + 1.0


def test_many_normals_are_independent() -> None:
    sample = normals(7, 3, 500_000)
    # neither the numbers nor their sizes (Box-Muller's pairs share a radius) are related
    for values in (sample, sample**2, np.abs(sample)):
        correlation = np.corrcoef(values, rowvar=False) - np.eye(4)
        assert np.abs(correlation).max() < 4.5 / np.sqrt(len(sample))
        whole = values.ravel() - values.mean()
        for lag in range(1, 9):
            assert abs((whole[:-lag] * whole[lag:]).mean() / whole.var()) < 4.5 / np.sqrt(whole.size)


@pytest.mark.full
def test_an_angle_of_a_pair_is_uniform() -> None:
    pairs = normals(9, 3, 500_000).reshape(-1, 2)
    assert stats.kstest(np.arctan2(pairs[:, 1], pairs[:, 0]), "uniform", args=(-np.pi, 2 * np.pi)).pvalue > 0.01
    assert stats.kstest((pairs**2).sum(axis=1), "chi2", args=(2,)).pvalue > 0.01


def test_blocks_of_normals_do_not_depend_on_how_they_are_asked_for() -> None:
    all_at_once = normals(7, 3, 40)
    assert np.array_equal(all_at_once[17:23], normals(7, 3, 6, first=17))
    assert not np.array_equal(all_at_once, normals(7, 4, 40))
    assert not np.array_equal(all_at_once, normals(7 + 2**32, 3, 40))
    assert not np.array_equal(all_at_once, normals(7, 3, 40, first=2**32))


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
