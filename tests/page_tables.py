# SPDX-License-Identifier: MIT
"""Tables of a page that a command makes: it prints them, or writes them between their markers in the page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from tests.parity.budget_page import replace_block

Tables = Mapping[str, Sequence[str]]
"""Lines of each table, by the name in its markers ``<!-- NAME -->`` and ``<!-- /NAME -->``."""


def with_tables(page: Path, tables: Tables) -> str:
    """Return the page's text with these tables. Raises ValueError if markers are missing or stand twice."""
    text = page.read_text(encoding="utf-8")
    for name, lines in tables.items():
        text = replace_block(text, name, lines)
    return text


def main(module: str, doc: str | None, page: Path, tables: Callable[[], Tables]) -> int:
    """Print the tables, or write them into the page: the command ``python -m MODULE``, which ``doc`` explains."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=(doc or "").split(":")[0])
    parser.add_argument("--write", action="store_true", help="write the tables into the page")
    write = parser.parse_args().write
    found = tables()
    if write:
        page.write_text(with_tables(page, found), encoding="utf-8")
    else:
        sys.stdout.write("\n\n".join("\n".join(lines) for lines in found.values()) + "\n")
    return 0
