# SPDX-License-Identifier: MIT
"""What found.md says of the planted bugs."""

from __future__ import annotations

import re
from collections.abc import Mapping

from tests.image.planted.bugs import ROOT, Bug
from tests.image.planted.search import Result

PAGE = ROOT / "tests" / "image" / "planted" / "found.md"
BEGIN, END = "<!-- planted: python -m tests.image.planted --write -->\n", "<!-- /planted -->"
NO_VERDICT = "no verdict yet: not run to its end"


def summary(bugs: Mapping[str, Bug], results: Mapping[str, Result]) -> str:
    """Return the figures as sentences. What has no verdict yet counts as not found."""
    found = sum(bool(result.found_by) for result in results.values())
    share = 100 * found // len(bugs)
    told = f"The checks of an image find {found} of {len(bugs)} planted bugs ({share} %)."
    left = len(bugs) - len(results)
    return f"{told} Not found counts also what has no verdict yet: {left}." if left else told


def _verdict(bug: Bug, result: Result | None) -> str:
    if result is None:
        return NO_VERDICT
    return f"`{result.found_by}`" if result.found_by else f"**not found**: {bug.missed or 'a check is missing'}"


def table(bugs: Mapping[str, Bug], results: Mapping[str, Result]) -> str:
    """Return a row for each bug: which check finds it, or why none does."""
    rows = [f"| {bug.title} | {_verdict(bug, results.get(name))} |" for name, bug in bugs.items()]
    return "\n".join(["| Planted | Found by |", "|---|---|", *rows])


def finders(page: str) -> dict[str, str]:
    """Return which check finds which bug, by title, as the page says: where to look first."""
    return dict(re.findall(r"^\| (.+?) \| `([a-z-]+)` \|$", page[page.index(BEGIN) : page.index(END)], re.MULTILINE))


def filled_in(page: str, bugs: Mapping[str, Bug], results: Mapping[str, Result]) -> str:
    """Return the page with the figure and the table as they are now. Raises ValueError if it has no place for them."""
    begin, end = page.index(BEGIN) + len(BEGIN), page.index(END)
    return f"{page[:begin]}{summary(bugs, results)}\n\n{table(bugs, results)}\n{page[end:]}"
