# SPDX-License-Identifier: MIT
"""The peers in C and C++ compute what the core computes, on this computer and on the emulated Cortex-M7."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench import build, estimators, original_law, ticks
from tests.arm import need_emulator

pytestmark = pytest.mark.reference

STEPS = 300
PEERS = [
    "tiny",
    pytest.param("eigen", marks=pytest.mark.needs("eigen")),
]


@pytest.fixture(scope="module")
def program() -> Path:
    return estimators.program()


def run(program: Path, *words: str) -> dict[str, list[float]]:
    return build.numbers(build.call([str(program), *words]))


@pytest.mark.full
@pytest.mark.parametrize("peer", PEERS)
def test_a_peers_filters_end_where_ours_do(program: Path, peer: str) -> None:
    ours, theirs = (run(program, f"{name}_pose", str(STEPS)) for name in ("core", peer))
    np.testing.assert_allclose(theirs["pose"], ours["pose"], atol=2e-6)
    np.testing.assert_allclose(theirs["pose_p"], ours["pose_p"], rtol=1e-3, atol=1e-10)
    assert np.abs(ours["pose"]).max() > 1e-4
    ours, theirs = (run(program, f"{name}_motor", str(STEPS)) for name in ("core", peer))
    np.testing.assert_allclose(theirs["motor"], ours["motor"], atol=2e-6)
    np.testing.assert_allclose(theirs["motor_p"], ours["motor_p"], rtol=1e-4)


@pytest.mark.needs("eigen")
def test_the_filter_with_eigen_that_does_what_ours_does_ends_where_ours_does(program: Path) -> None:
    ours, theirs = (run(program, f"{name}_pose", str(STEPS)) for name in ("core", "eigen_late"))
    np.testing.assert_allclose(theirs["pose"], ours["pose"], atol=2e-6)
    np.testing.assert_allclose(theirs["pose_p"], ours["pose_p"], rtol=1e-3, atol=1e-10)


def test_the_original_law_in_double_asks_for_the_same_voltages() -> None:
    program = build.build("law", original_law.sources())
    ours, theirs = (run(program, name, "500")["voltage"] for name in ("core_law", "double_law"))
    np.testing.assert_allclose(theirs, ours, atol=1e-3)
    assert np.ptp(ours) > 20.0


@pytest.mark.nightly
def test_the_cortex_m7_counts_and_computes_the_same() -> None:
    need_emulator()
    here = run(build.build("law", original_law.sources()), "core_law", "20")
    there = build.numbers(build.run_cortex_m7(build.build_cortex_m7("law", original_law.sources()), ["core_law", "20"]))
    assert there["voltage"] == here["voltage"]
    assert 500 < there["cost"][0] < 20000


def test_a_program_is_built_anew_with_other_flags(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eigen that is installed, or removed, after a first run is such a flag."""
    monkeypatch.setattr(build, "OUT", tmp_path)
    source = tmp_path / "told.c"
    source.write_text('#include <stdio.h>\nint main(void) { return printf("told %d", TOLD) < 0; }\n')
    for told in (0, 1, 0):
        assert run(build.build("told", [source], [f"-DTOLD={told}"])) == {"told": [told]}


def test_all_ways_to_tick_drive_the_same_way() -> None:
    program = ticks.program()
    words = [*ticks.write_inputs(program.parent, 1), "400"]
    poses = [run(program, way, *words)["pose"] for way in ticks.ways()]
    assert all(pose == poses[0] for pose in poses)
