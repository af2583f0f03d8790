# SPDX-License-Identifier: MIT
"""docs/how-to-add/parameter.md, followed word by word, gives a parameter that the core uses."""

from __future__ import annotations

import subprocess
import sys

from tests.recipes.recipe import Scratch


def check(copy: Scratch) -> None:
    """The generator takes it into the table, and the core that uses it compiles."""
    out = copy.root / "build" / "parameter"
    program = [sys.executable, str(copy.root / "shared/generate/generate.py"), "--out", str(out), "--part", "tables"]
    subprocess.run(program, check=True, timeout=120)
    assert '"MOT_K_SCALE"' in (out / "src" / "params_gen.c").read_text(encoding="utf-8")
    includes = [f"-I{copy.root / 'shared/core/include'}", f"-I{out / 'include'}"]
    source = str(copy.root / "shared/core/src/config/robot_config.c")
    words = ["gcc", "-std=c99", "-fsyntax-only", "-Wall", "-Wextra", "-Werror", *includes, source]
    subprocess.run(words, check=True, timeout=120)
