# SPDX-License-Identifier: MIT
"""make lint runs every linter whatever the ones before found, and ends with which failed."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("ruff", "clang-format", "mypy", "lint-imports", "python", "make", "cmake")


def lint(folder: Path, *failing: str) -> tuple[int, str, set[str]]:
    """Run .ci/lint with stand-ins for all tools; return its exit code, its last line, and which tools it ran."""
    tools = folder / "bin"
    tools.mkdir(parents=True)
    for name in TOOLS:
        program = tools / name
        program.write_text(f"#!/bin/sh\ntouch {folder}/ran-{name}\nexit {int(name in failing)}\n")
        program.chmod(0o755)
    command = [str(ROOT / ".ci" / "lint"), os.path.relpath(folder, ROOT), "a.c"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    ran = {path.name.removeprefix("ran-") for path in folder.glob("ran-*")}
    return done.returncode, (done.stdout + done.stderr).splitlines()[-1], ran


def test_every_linter_runs_and_those_that_failed_are_named(tmp_path: Path) -> None:
    assert lint(tmp_path / "good") == (0, "lint: all passed", set(TOOLS))
    code, last, ran = lint(tmp_path / "bad", "clang-format", "mypy")
    assert (code, last) == (1, "lint FAILED: clang-format,mypy")
    assert ran == set(TOOLS)


def test_without_a_build_the_linters_that_need_one_failed(tmp_path: Path) -> None:
    code, last, ran = lint(tmp_path / "bad", "cmake")
    assert (code, last) == (1, "lint FAILED: cppcheck and clang-tidy: CMake failed")
    assert {"ruff", "mypy", "make"} <= ran
