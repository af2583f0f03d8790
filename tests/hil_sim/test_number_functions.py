# SPDX-License-Identifier: MIT
"""Logarithm, normals, sine and wrapping of the simulation's own, against libm in double precision."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from tests.native import ROOT, kept_library

Words = npt.NDArray[np.uint32]
Array = npt.NDArray[np.float64]
CELLS = 2.0**32
EDGES = [0, 1, 2, 2**16 - 1, 2**16, 2**24, 2**31, 0xBFFFFFFF, 0xC0000000, 2**32 - 2**16, 2**32 - 2, 2**32 - 1]
COUNT = 1 << 20


@pytest.fixture(scope="module")
def lib() -> ctypes.CDLL:
    source = Path(__file__).with_name("number_functions.c")
    includes = [ROOT / "hil_sim" / "src", ROOT / "hil_sim" / "include"]
    return ctypes.CDLL(str(kept_library("number_functions", [source], includes)))


def pointer(array: npt.NDArray[np.generic]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def words(seed: int) -> Words:
    """Edges, words of every size from small to large and from the top down, and random ones."""
    rng = np.random.default_rng(seed)
    sizes = (rng.random(COUNT) * 2.0 ** rng.integers(0, 33, COUNT)).astype(np.uint32)
    return np.concatenate([np.array(EDGES, dtype=np.uint32), sizes, ~sizes, rng.integers(0, 2**32, COUNT, np.uint32)])


def exact_log(word: Words) -> Array:
    """-ln of the middle of a word's cell, without cancellation near 1."""
    w = word.astype(float)
    return np.where(w < CELLS / 2, -np.log((w + 0.5) / CELLS), -np.log1p(-(CELLS - 0.5 - w) / CELLS))


def test_logarithm_is_as_good_near_0_as_near_22(lib: ctypes.CDLL) -> None:
    word = words(1)
    out = np.empty(len(word), dtype=np.float32)
    lib.minus_log(len(word), pointer(word), pointer(out))
    exact = exact_log(word)
    assert exact.min() < 2e-10
    assert exact.max() > 22.8
    assert np.abs(out / exact - 1.0).max() < 4e-7


@pytest.mark.full
def test_normals_are_those_of_box_and_muller(lib: ctypes.CDLL) -> None:
    first, second = words(2), np.random.default_rng(3).permutation(words(4))
    word = np.stack([first, second], axis=1).copy()
    out = np.empty(word.shape, dtype=np.float32)
    lib.normal_pairs(len(word), pointer(word), pointer(out))
    radius = np.sqrt(2.0 * exact_log(first))
    # 31 bits around a half circle, the uppermost bit mirrors
    low = (second & np.uint32(0x7FFFFFFF)).astype(float)
    angle = np.pi * (np.where(low < CELLS / 4, low, low - CELLS / 2) + 0.5) / (CELLS / 2)
    mirror = np.where(second >= 2**31, -1.0, 1.0)
    exact = radius[:, None] * np.stack([mirror * np.cos(angle), np.sin(angle)], axis=1)
    assert np.abs((out - exact) / radius[:, None]).max() < 4e-7
    assert np.abs(out).max() <= 6.77


def test_cosine_and_sine(lib: ctypes.CDLL) -> None:
    rng = np.random.default_rng(5)
    quarters = np.arange(-4000, 4000) * (np.pi / 4)
    angle = np.concatenate([quarters, rng.uniform(-10, 10, COUNT), rng.uniform(-1e6, 1e6, COUNT)])
    out = np.empty((len(angle), 2))
    lib.real_cos_sin(len(angle), pointer(angle), pointer(out))
    assert np.abs(out - np.stack([np.cos(angle), np.sin(angle)], axis=1)).max() <= 5e-16


def test_wrapping(lib: ctypes.CDLL) -> None:
    angle = np.random.default_rng(6).uniform(-1e3, 1e3, COUNT)
    out = np.empty_like(angle)
    lib.real_wrap(len(angle), pointer(angle), pointer(out))
    assert np.abs(out).max() <= np.pi + 1e-12
    assert np.abs(np.exp(1j * out) - np.exp(1j * angle)).max() < 5e-13
