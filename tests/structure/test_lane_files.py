# SPDX-License-Identifier: MIT
"""Lanes are a guest of the core: only the files that shared/core/lane_files.txt lists use them."""

from __future__ import annotations

import re

from tests.native import ROOT

CORE = ROOT / "shared" / "core"
LANE_WORDS = re.compile(r"\bomni_(?:select|any|all|flag_t)\b")
MOST_USES = 170
"""Of all files together. Lower it when a file becomes plain C."""


def uses() -> dict[str, int]:
    """Return the number of uses by file, files without any left out."""
    found = {}
    for path in sorted(CORE.rglob("*.[ch]")):
        count = len(LANE_WORDS.findall(path.read_text(encoding="utf-8")))
        if count:
            found[path.relative_to(CORE).as_posix()] = count
    return found


def test_only_the_listed_files_use_lanes() -> None:
    lines = (CORE / "lane_files.txt").read_text(encoding="utf-8").splitlines()
    assert sorted(uses()) == [line for line in lines if line and not line.startswith("#")]


def test_lanes_do_not_spread() -> None:
    assert sum(uses().values()) <= MOST_USES
