# SPDX-License-Identifier: MIT
"""Real logs beside both worlds, for docs/report/reproduce.md: ``python -m tests.omni_reproduce.real_worlds_page``.

The figures are those of the kept results; ``--write`` puts the table into the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

from omni_reproduce.real_measured import ACCELEROMETER, HEADED, IDEAL, LIFTED, MUJOCO, OURS, TURN, WHEEL, WHEELS_ONLY
from omni_reproduce.registry import select
from tests.omni_reproduce.kept_page import PAGE as RESULTS
from tests.omni_reproduce.kept_page import sections
from tests.page_tables import main, with_tables

PAGE = Path(__file__).parents[2] / "docs" / "report" / "reproduce.md"
BAND = f"{ACCELEROMETER}, at order 18"
QUANTITIES = (
    *(f"{sensor}, ripple" for sensor in (ACCELEROMETER, TURN, WHEEL)),
    BAND,
    *(f"{name}, median of the runs" for name in (HEADED, WHEELS_ONLY)),
)


def kept() -> dict[tuple[str, str], tuple[str, str, str]]:
    """Return unit, the logs' figure and the setting's, by setting and quantity, of the kept results."""
    (experiment,) = select(["real_worlds"])
    found = {}
    for line in sections(RESULTS.read_text(encoding="utf-8"))[experiment.title].splitlines():
        cells = [cell.strip() for cell in line.split("|")[1:-1]]
        if len(cells) == 9:
            found[cells[0], cells[1]] = (cells[2], cells[3], cells[4].partition(" ")[0])
    return found


def tables() -> dict[str, list[str]]:
    """Return the page's table, of the kept results."""
    figures, settings = kept(), (LIFTED, IDEAL, OURS, MUJOCO)
    table = ["| | logs | wheels in the air | ideal wheels | our world | MuJoCo |", "|---|---:|---:|---:|---:|---:|"]
    for quantity in QUANTITIES:
        unit, logs, _ = figures[OURS, quantity]
        cells = [figures[setting, quantity][2] if (setting, quantity) in figures else "" for setting in settings]
        table.append(f"| {quantity.replace('^2', '²')} [{unit.replace('^2', '²')}] | {logs} | {' | '.join(cells)} |")
    return {"real-worlds": table}


def written() -> str:
    """Return the page with the table of the kept results."""
    return with_tables(PAGE, tables())


if __name__ == "__main__":
    sys.exit(main("tests.omni_reproduce.real_worlds_page", __doc__, PAGE, tables))
