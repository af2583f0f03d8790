# SPDX-License-Identifier: MIT
"""docs/report/results.md and its pictures are of today: some experiments in full give the very rows of that page.

Page and pictures are copied from one run of ``omni reproduce``, so rows that differ mean that both are old.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from omni_reproduce import page, study
from omni_reproduce.experiment import Context
from omni_reproduce.registry import select

DOCS = Path(__file__).resolve().parents[2] / "docs"
KEPT = DOCS / "report" / "results.md"
QUICK_IN_FULL = ("models", "table1")
"""Experiments that take seconds with all their seeds. What changes core or world changes these, too."""


def rows(markdown: str) -> list[str]:
    """Return the lines of a page's tables, without footnote marks: their numbers depend on the rest of the page."""
    return [re.sub(r" (\[\d+\])? \|$", "", line) for line in markdown.splitlines() if line.startswith("| ")]


@pytest.mark.slow
@pytest.mark.parametrize("name", QUICK_IN_FULL)
def test_the_kept_page_has_the_rows_of_today(name: str, tmp_path: Path) -> None:
    """After a change: ``omni reproduce``, then copy its page to results.md and its pictures to images/reproduce."""
    outcomes = study.run_all(select([name]), Context(tmp_path), lambda _number, _share: None)
    today = rows(page.markdown(outcomes, ""))
    assert len(today) > 4
    kept = set(rows(KEPT.read_text(encoding="utf-8")))
    assert [row for row in today if row not in kept] == []


def test_every_kept_picture_is_on_the_page() -> None:
    shown = set(re.findall(r"images/reproduce/(\w+\.png)\)", KEPT.read_text(encoding="utf-8")))
    assert shown == {picture.name for picture in (DOCS / "images" / "reproduce").glob("*.png")}
