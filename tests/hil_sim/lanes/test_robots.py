# SPDX-License-Identifier: MIT
"""Eight robots in lanes do, bit for bit, what each does alone; where they would part, they say so."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from omniwheel._core import lib as core
from omniwheel.robots import parameter_table
from tests.native import ROOT, core_archive, generated_dir, kept_library

PROGRAM = ROOT / "tests" / "parity" / "program"
LANES = ROOT / "hil_sim" / "lanes"
TICKS = 30_000
LEVELS = [
    pytest.param(core.HIL_LANES_BASELINE, id="baseline"),
    pytest.param(core.HIL_LANES_AVX2, id="avx2"),
    pytest.param(
        core.HIL_LANES_BEST,
        id="best",
        marks=pytest.mark.skipif(not core.hil_lanes_has_avx512(), reason="the best level here is the one before"),
    ),
]


class Tally(ctypes.Structure):
    """lanes_tally_t of robots.c."""

    _fields_ = [
        ("ticks", ctypes.c_uint32),
        ("compared", ctypes.c_uint32),
        ("parted", ctypes.c_uint32),
        ("unequal", ctypes.c_uint32),
        ("wrong", ctypes.c_uint32),
        ("armed", ctypes.c_uint32 * 8),
        ("kinds", ctypes.c_uint32 * 8),
        ("fixes", ctypes.c_uint32),
        ("in_a_row", ctypes.c_uint32),
        ("hot", ctypes.c_uint32),
        ("hot_compared", ctypes.c_uint32),
    ]


@pytest.fixture(scope="module")
def lib() -> ctypes.CDLL:
    sources = [Path(__file__).with_name("robots.c")]
    sources += [
        PROGRAM / f"{name}.c" for name in ("scene", "world", "gyro", "flow", "current", "draw", "random", "digest")
    ]
    flags = ["-O2", "-fno-math-errno", "-std=c11", "-Domni_robot_tick=lanes_scene_tick"]
    archives = [generated_dir().parent / "hil_sim" / "libhil_sim.a", core_archive()]
    built = kept_library(
        "lanes_robots",
        sources,
        [LANES, PROGRAM, ROOT / "hil_sim" / "include", ROOT / "shared" / "link" / "include"],
        flags=flags,
        archives=archives,
    )
    return ctypes.CDLL(str(built))


def run(lib: ctypes.CDLL, seed: int, level: int) -> Tally:
    tally = Tally()
    lib.lanes_scene(seed, TICKS, level, ctypes.byref(tally))
    return tally


@pytest.mark.full
@pytest.mark.parametrize("level", LEVELS)
def test_eight_in_lanes_are_bit_for_bit_eight_alone(lib: ctypes.CDLL, level: int) -> None:
    tally = run(lib, 27, level)  # a scene that arms every controller, also while its robots are in lanes
    assert tally.wrong == 0
    assert tally.hot > 1000
    assert tally.hot_compared > 0.5 * tally.hot, "robots without the sensors whose files are plain C stay in lanes"
    assert tally.parted + tally.unequal > 0, "a scene in which nothing goes wrong shows nothing"
    assert tally.fixes > 100
    assert tally.in_a_row > 1000
    assert all(tally.kinds[kind] > 0 for kind in range(6))
    assert all(tally.armed[controller] > 0 for controller in range(len(parameter_table()["CTL_MODE"].values)))


@pytest.mark.full
@pytest.mark.parametrize("level", LEVELS)
def test_lanes_part_over_a_reading_that_counts_for_some(lib: ctypes.CDLL, level: int) -> None:
    """In this scene motion over the floor is used in one lane and refused in the others."""
    tally = run(lib, 10, level)
    assert tally.wrong == 0
    assert tally.parted > 0
