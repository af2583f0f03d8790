# SPDX-License-Identifier: MIT
"""Writes what docs/checks/image.md says of the checks, and of what the model leaves out.

usage: python -m image_check.page [--write]

Without ``--write``: exit code 1 if the page says something else.
"""

from __future__ import annotations

import sys
from pathlib import Path

from emulated_teensy.machine import not_modelled
from image_check.run import all_checks
from omniwheel import files

PAGE = Path(__file__).resolve().parents[1] / "docs" / "checks" / "image.md"
_WRITTEN_BY = ": python -m image_check.page --write"


def checks_table() -> str:
    """Return a row for each check."""
    rows = [f"| `{check.name}` | {check.what} | {', '.join(check.depths)} |" for check in all_checks()]
    return "\n".join(["| Check | What it shows | Depths |", "|---|---|---|", *rows])


def left_out() -> str:
    """Return the list of what is not modelled."""
    return "\n".join(f"- {sentence}" for sentence in not_modelled())


def filled_in(page: str) -> str:
    """Return the page with both parts as they are now."""
    for name, text in (("checks", checks_table()), ("not modelled", left_out())):
        begin, end = f"<!-- {name}{_WRITTEN_BY} -->\n", f"<!-- /{name} -->"
        head, _, rest = page.partition(begin)
        _, _, tail = rest.partition(end)
        page = f"{head}{begin}{text}\n{end}{tail}"
    return page


def main(words: list[str]) -> int:
    """Compare or write the page; return the exit code."""
    page = PAGE.read_text(encoding="utf-8")
    wanted = filled_in(page)
    if words == ["--write"]:
        files.write_text(PAGE, wanted)
    return 0 if words == ["--write"] or page == wanted else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
