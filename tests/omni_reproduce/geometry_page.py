# SPDX-License-Identifier: MIT
"""Left-out runs of two robots, for docs/guides/geometry.md: ``python -m tests.omni_reproduce.geometry_page``.

The figures are those of the kept results; ``--write`` puts the table into the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

from omni_reproduce.geometry_logs import DOCUMENTED, IDENTIFIED, LARGEST, NAME, POSITIONS, STATISTICS
from omni_reproduce.registry import select
from tests.omni_reproduce.kept_page import PAGE as RESULTS
from tests.omni_reproduce.kept_page import sections
from tests.page_tables import main, with_tables

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "geometry.md"


def kept() -> dict[tuple[str, str], str]:
    """Return our figures by setting and quantity, of the kept results."""
    (experiment,) = select([NAME])
    lines = sections(RESULTS.read_text(encoding="utf-8"))[experiment.title].splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    return {(cells[0], cells[1]): cells[4] for cells in rows if len(cells) == 5}


def tables() -> dict[str, list[str]]:
    """Return the page's table in mm, of the kept results."""
    figures = kept()
    table = [f"| | {' | '.join(STATISTICS.values())} |", "|---|" + "---:|" * len(STATISTICS)]
    for robot in ("three wheels", "four wheels"):
        for setting in (DOCUMENTED, IDENTIFIED, POSITIONS):
            cells = [figures[f"{robot}, {setting}", f"{LARGEST}, {name}"] for name in STATISTICS.values()]
            shown = [cell if cell == "–" else f"{1e3 * float(cell):.0f}" for cell in cells]
            table.append(f"| {robot}, {setting} | {' | '.join(shown)} |")
    return {"geometry": table}


def written() -> str:
    """Return the page with the table of the kept results."""
    return with_tables(PAGE, tables())


if __name__ == "__main__":
    sys.exit(main("tests.omni_reproduce.geometry_page", __doc__, PAGE, tables))
