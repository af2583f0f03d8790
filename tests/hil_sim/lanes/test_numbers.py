# SPDX-License-Identifier: MIT
"""Numbers of eight lanes, or sixteen, do in each lane what the scalar does, and say so when the lanes would part."""

from __future__ import annotations

import ctypes
import platform
from pathlib import Path

import pytest

from tests.native import ROOT, kept_library

LANES = ROOT / "hil_sim" / "lanes"
AVX512 = ["-mavx512f", "-mavx512dq", "-mavx512bw", "-mavx512vl"]
FLAGS = {"baseline": [], "avx2": ["-mavx2"], "avx512": AVX512, "eight": AVX512}
"""The last one has eight lanes, as all of a build with -march=native but the level avx512."""
LEVELS = list(FLAGS) if platform.machine() in ("x86_64", "AMD64") else ["baseline"]


def _runs_here(level: str) -> bool:
    if level == "baseline":
        return True
    words = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").split()
    return all(flag.removeprefix("-m") in words for flag in FLAGS[level])


@pytest.fixture(scope="module", params=LEVELS)
def lib(request: pytest.FixtureRequest) -> ctypes.CDLL:
    level = request.param
    if not _runs_here(level):
        pytest.skip(f"the processor lacks the instructions of lanes level {level}")
    flags = ["-Wno-psabi", "-Wno-float-equal", "-fno-math-errno", f"-DOMNI_LANES_LEVEL={level}"]
    flags += FLAGS[level]
    flags += ["-Wno-uninitialized"] if FLAGS[level] == AVX512 else []  # gcc warns of its own header
    flags += ["-DLANES_SIXTEEN"] if level == "avx512" else []
    sources = [Path(__file__).with_name("numbers.cpp"), LANES / "divergence.c"]
    return ctypes.CDLL(str(kept_library(f"lanes_{level}", sources, [LANES], flags=flags)))


@pytest.mark.full
@pytest.mark.parametrize("lib", LEVELS, indirect=True)
def test_only_the_level_for_it_has_sixteen_lanes(lib: ctypes.CDLL, request: pytest.FixtureRequest) -> None:
    """Whole robots are packed by eight, so a compiler that is told of AVX-512 everywhere must change nothing there."""
    assert lib.lanes_count() == (16 if request.node.callspec.params["lib"] == "avx512" else 8)


@pytest.mark.full
def test_every_operation_gives_the_bits_of_the_scalar_one(lib: ctypes.CDLL) -> None:
    assert lib.lanes_wrong_numbers() == 0


def test_whole_numbers_wrap_and_shift_like_scalars(lib: ctypes.CDLL) -> None:
    assert lib.lanes_wrong_whole_numbers() == 0


def test_a_mixed_condition_is_always_noticed_and_answered_by_lane_0(lib: ctypes.CDLL) -> None:
    for bits in range(256):
        parted = bits not in (0, 255)
        assert lib.lanes_condition(bits) == (bits & 1) + 2 * parted


def test_a_cast_of_unequal_lanes_is_noticed(lib: ctypes.CDLL) -> None:
    assert lib.lanes_cast(-1) == 3
    for lane in range(8):
        assert lib.lanes_cast(lane) == (104 if lane == 0 else 103)
