# SPDX-License-Identifier: MIT
"""What rollers cost, for docs/concepts/real-wheels.md: ``python -m tests.hil_sim.rollers_page [--write]``."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from hil_sim.metrics import Rmse, tracking_rmse
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from tests.page_tables import main, with_tables

PAGE = Path(__file__).parents[2] / "docs" / "concepts" / "real-wheels.md"
SCENARIOS = ("ideal", "demo", "ideal_no_slip", "no_slip", "fast_ideal", "fast")


@cache
def error_of(name: str) -> Rmse:
    """Return the tracking error of a scenario on its path."""
    return tracking_rmse(run_in_process(load_scenario(name)).record)


def tables() -> dict[str, list[str]]:
    """Return the page's table, from a fresh run."""
    table = ["| scenario | position | heading |", "|---|---:|---:|"]
    for name in SCENARIOS:
        error = error_of(name)
        table.append(f"| `{name}` | {1e3 * error.position_m:.2f} mm | {1e3 * error.theta_rad:.2f} mrad |")
    return {"real-wheels": table}


def written() -> str:
    """Return the page with the table of a fresh run."""
    return with_tables(PAGE, tables())


if __name__ == "__main__":
    sys.exit(main("tests.hil_sim.rollers_page", __doc__, PAGE, tables))
