# SPDX-License-Identifier: MIT
"""What rollers cost, for docs/concepts/real-wheels.md: ``python -m tests.hil_sim.rollers_page [--write]``."""

from __future__ import annotations

import argparse
import sys
from functools import cache
from pathlib import Path

from hil_sim.metrics import Rmse, tracking_rmse
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from tests.parity.budget_page import replace_block

PAGE = Path(__file__).parents[2] / "docs" / "concepts" / "real-wheels.md"
SCENARIOS = ("ideal", "demo", "ideal_no_slip", "no_slip", "fast_ideal", "fast")


@cache
def error_of(name: str) -> Rmse:
    """Return the tracking error of a scenario on its path."""
    return tracking_rmse(run_in_process(load_scenario(name)).record)


def written() -> str:
    """Return the page with the table of a fresh run."""
    table = ["| scenario | position | heading |", "|---|---:|---:|"]
    for name in SCENARIOS:
        error = error_of(name)
        table.append(f"| `{name}` | {1e3 * error.position_m:.2f} mm | {1e3 * error.theta_rad:.2f} mrad |")
    return replace_block(PAGE.read_text(), "real-wheels", table)


def main() -> int:
    """Print the page's table, or write it into the page."""
    what = (__doc__ or "").split(":")[0]
    parser = argparse.ArgumentParser(prog="python -m tests.hil_sim.rollers_page", description=what)
    parser.add_argument("--write", action="store_true", help="write the table into the page")
    text = written()
    if parser.parse_args().write:
        PAGE.write_text(text)
    else:
        sys.stdout.write("\n".join(line for line in text.split("\n") if line.startswith("|")) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
