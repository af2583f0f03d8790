# SPDX-License-Identifier: MIT
"""How lanes are built: with no operation that rounds otherwise than the robot's, and by other compilers, too."""

from __future__ import annotations

import platform
import re
import subprocess

import pytest

from tests.hil_sim.lanes.test_numbers import AVX512, FLAGS, LANES
from tests.native import ROOT, generated_dir

LEVELS = {"avx2": FLAGS["avx2"], "avx512_eight": AVX512}
FUSED = re.compile(r"\bvf(n?)m(add|sub|addsub|subadd)\w+\b")

x86_64 = pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="levels of x86-64")


@pytest.mark.full
@x86_64
@pytest.mark.needs("objdump")
def test_nothing_is_fused() -> None:
    """AVX-512 has fused multiply-add. A compiler that used it would give other bits than the robot's processor."""
    library = generated_dir().parent / "hil_sim" / "libhil_sim.a"
    found = subprocess.run(["objdump", "-d", "--no-show-raw-insn", str(library)], capture_output=True, check=True)
    text = found.stdout.decode("ascii", "replace")
    assert "zmm" in text, "this has the levels with AVX-512"
    assert FUSED.search("vfmadd213pd %zmm1,%zmm2,%zmm3")
    assert FUSED.search(text) is None


@pytest.mark.full
@x86_64
@pytest.mark.needs("clang")
@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("source", ["core.cpp", "runs.cpp"])
def test_clang_takes_lanes_too(level: str, source: str) -> None:
    generated = generated_dir()
    folders = [LANES, ROOT / "hil_sim/src", ROOT / "hil_sim/include", ROOT / "shared/core/include"]
    folders += [ROOT / "shared/core/src", ROOT / "shared/link/include"]
    folders += [generated / name for name in ("include", "lanes", "world")]
    words = ["clang++", "-std=gnu++20", "-fsyntax-only", "-w", f"-DOMNI_LANES_LEVEL={level}", *LEVELS[level]]
    done = subprocess.run(
        [*words, *(f"-I{folder}" for folder in folders), str(LANES / source)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
