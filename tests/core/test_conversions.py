# SPDX-License-Identifier: MIT
"""Numbers that fit no integer are refused before they are converted: in C the conversion would be undefined."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.native import ROOT, generated_dir
from tests.needs import need

CORE = ROOT / "shared" / "core"


@pytest.mark.full
def test_a_path_is_refused_without_converting_what_does_not_fit(tmp_path: Path) -> None:
    need("clang")
    program = tmp_path / "refused_paths"
    parts = ("reference/trajectory*.c", "model/kinematics.c", "math/*.c")
    sources = [path for part in parts for path in (CORE / "src").glob(part)]
    flags = ["-std=c99", "-O1", "-ffp-contract=off", "-fsanitize=float-cast-overflow", "-fno-sanitize-recover=all"]
    includes = [f"-I{path}" for path in (CORE / "include", generated_dir() / "include")]
    main = ROOT / "tests" / "core" / "refused_paths.c"
    subprocess.run(
        ["clang", *flags, *includes, *map(str, sources), str(main), "-o", str(program)], check=True, timeout=300
    )
    done = subprocess.run([str(program)], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
