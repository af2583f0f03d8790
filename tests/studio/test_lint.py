# SPDX-License-Identifier: MIT
"""The linter of the page (``make lint-page``) finds what it is there for."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.needs import need

ROOT = Path(__file__).resolve().parents[2]
ESLINT = ROOT / "build" / "eslint"
GOOD = "export const twice = (number) => 2 * number;\n"


def lint(path: Path) -> subprocess.CompletedProcess[str]:
    """Lint a file as ``make lint-page`` does."""
    program = ESLINT / "node_modules" / ".bin" / "eslint"
    need("eslint")
    path_env = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    config = ESLINT / "eslint.config.mjs"
    words = [str(program), "--config", str(config), "--max-warnings", "0", path.name]
    return subprocess.run(
        words, cwd=path.parent, env={**os.environ, "PATH": path_env}, capture_output=True, text=True, check=False
    )


def test_what_is_good_passes(tmp_path: Path) -> None:
    (tmp_path / "page.js").write_text(GOOD)
    found = lint(tmp_path / "page.js")
    assert found.returncode == 0, found.stdout + found.stderr


@pytest.mark.parametrize(
    ("rule", "line"),
    [
        ("no-undef", "export const size = () => status.length;"),  # a window's own, by mistake
        ("no-unused-vars", 'import { twice } from "./other.js";'),
        ("no-shadow", "export const f = (twice) => twice;"),
        ("eqeqeq", "export const g = (a, b) => a == b;"),
        ("prefer-const", "export function h() { let a = 1; return a; }"),
        ("no-dupe-keys", "export const i = { a: 1, a: 2 };"),
        ("no-unsafe-finally", "export function j() { try { return 1; } finally { return 2; } }"),
        ("Unused eslint-disable", "// eslint-disable-next-line no-undef\nexport const k = 1;"),
    ],
)
def test_a_mistake_is_found(tmp_path: Path, rule: str, line: str) -> None:
    before = "" if "import" in line else GOOD
    (tmp_path / "page.js").write_text(f"{before}{line}\n")
    found = lint(tmp_path / "page.js")
    assert found.returncode == 1
    assert rule in found.stdout
