# SPDX-License-Identifier: MIT
"""Tables that list pages: every page of the folder's navigation, in its order, under the page's own title."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [DOCS / folder / "index.md" for folder in ("guides", "concepts", "checks", "reference", "report")]
ROW = re.compile(r"^\| \[([^\]]+)\]\(([^)]+)\.md\) \| (.+) \|$", re.MULTILINE)
NAVIGATION = re.compile(r"```\{toctree\}\n:hidden:\n\n(.*?)```", re.DOTALL)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.parent.name)
def test_a_table_of_pages_is_the_navigation_under_their_own_titles(path: Path) -> None:
    text = path.read_text()
    rows = ROW.findall(text)
    listed = [name for block in NAVIGATION.findall(text) for name in block.split()]
    assert listed
    assert [name for _, name, _ in rows] == listed
    for title, name, _ in rows:
        if not name.startswith("generated/"):
            assert (path.parent / f"{name}.md").read_text().splitlines()[0] == f"# {title}"
