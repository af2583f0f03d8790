# SPDX-License-Identifier: MIT
"""Each statement of docs/reference/security.md names a test that exists."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMED = re.compile(r"`(tests/[\w/]+\.py)?(?:::(\w+))?`")


def named_tests() -> list[tuple[Path, str | None]]:
    """Files and tests in the order of the page; `::name` alone belongs to the file before."""
    found: list[tuple[Path, str | None]] = []
    for match in NAMED.finditer((ROOT / "docs" / "reference" / "security.md").read_text(encoding="utf-8")):
        if match[1] or match[2]:
            found.append((ROOT / match[1] if match[1] else found[-1][0], match[2]))
    return found


@pytest.mark.full
def test_every_test_that_the_page_names_exists() -> None:
    named = named_tests()
    assert len(named) > 15
    for path, name in named:
        functions = {node.name for node in ast.parse(path.read_text(encoding="utf-8")).body if hasattr(node, "name")}
        assert name is None or name in functions, f"{path}::{name}"
