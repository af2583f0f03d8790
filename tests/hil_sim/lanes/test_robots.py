# SPDX-License-Identifier: MIT
"""Eight robots in lanes do, bit for bit, what each does alone; where they would part, they say so."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from omniwheel.robots import parameter_table
from tests.native import ROOT, build_library, core_archive, generated_dir

PROGRAM = ROOT / "tests" / "parity" / "program"
LANES = ROOT / "hil_sim" / "lanes"
TICKS = 30_000
SEEDS = (9, 10)
"""Scenes that arm every controller; in the second the lanes part over a reading of motion over the floor."""


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
    ]


@pytest.fixture(scope="module")
def lib(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    sources = [Path(__file__).with_name("robots.c")]
    sources += [
        PROGRAM / f"{name}.c" for name in ("scene", "world", "gyro", "flow", "current", "draw", "random", "digest")
    ]
    flags = ["-O2", "-fno-math-errno", "-std=c11", "-Domni_robot_tick=lanes_scene_tick"]
    archives = [generated_dir().parent / "hil_sim" / "libhil_sim.a", core_archive()]
    built = build_library(
        tmp_path_factory.mktemp("robots"),
        "robots",
        sources,
        [LANES, PROGRAM, ROOT / "hil_sim" / "include"],
        flags=flags,
        archives=archives,
    )
    return ctypes.CDLL(str(built))


def run(lib: ctypes.CDLL, seed: int, level: int) -> Tally:
    tally = Tally()
    lib.lanes_scene(seed, TICKS, level, ctypes.byref(tally))
    return tally


@pytest.mark.parametrize("level", [0, 1], ids=["baseline", "best"])
def test_eight_in_lanes_are_bit_for_bit_eight_alone(lib: ctypes.CDLL, level: int) -> None:
    tallies = [run(lib, seed, level) for seed in SEEDS]

    def total(name: str) -> int:
        return sum(getattr(tally, name) for tally in tallies)

    assert total("wrong") == 0
    assert total("compared") > 0.5 * total("ticks")
    assert total("parted") + total("unequal") > 0, "a scene in which nothing goes wrong shows nothing"
    assert total("fixes") > 200
    assert min(tally.in_a_row for tally in tallies) > 1000
    assert all(sum(tally.kinds[kind] for tally in tallies) > 0 for kind in range(6))
    controllers = range(len(parameter_table()["CTL_MODE"].values))
    assert all(sum(tally.armed[controller] for tally in tallies) > 0 for controller in controllers)
