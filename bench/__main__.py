# SPDX-License-Identifier: MIT
"""``make bench``: runs the benchmarks, prints their tables; ``--write`` puts them into docs/checks/performance.md."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path

from rich.console import Console

from bench import bus, downloads, estimators, filter_study, memory, original_law, simulation
from bench.build import OUT, BenchError
from bench.options import Options
from bench.tables import Table, write_page
from hil_sim.speed import machine
from omniwheel import files
from omniwheel.errors import OmniError
from tests.native import ROOT

PAGE = ROOT / "docs" / "checks" / "performance.md"
RESULT = OUT / "result.json"
BENCHMARKS: dict[str, Callable[[Options], list[Table]]] = {
    "simulation": simulation.measure,
    "memory": memory.measure,
    "filter-study": filter_study.measure,
    "estimators": estimators.measure,
    "law": original_law.measure,
    "download": downloads.measure,
    "bus": bus.measure,
}


def parse(words: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(prog="make bench ARGS=...", description="ours and its peers, measured in turn")
    parser.add_argument("--quick", action="store_true", help="short runs: to see that all works, not for the page")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/checks/performance.md")
    parser.add_argument("--only", nargs="+", choices=list(BENCHMARKS), default=list(BENCHMARKS), help="these only")
    parser.add_argument("--seed", type=int, default=1, help="of simulations and noise")
    parser.add_argument("--json", type=Path, default=RESULT, metavar="FILE", help=f"figures as measured ({RESULT})")
    options = parser.parse_args(words)
    if options.write and options.quick:
        parser.error("--quick is too noisy for the page: give --write alone")
    return options


def main() -> int:
    """Run the command line."""
    words = parse()
    console = Console(soft_wrap=True)
    line = f"{date.today().isoformat()}, {machine()}"
    console.print(line, style="bold", markup=False)
    tables: list[Table] = []
    try:
        with console.status("") as status:
            options = Options(words.quick, words.seed, lambda text: status.update(text))
            for name in words.only:
                found = BENCHMARKS[name](options)
                tables += found
                for table in found:
                    console.print(table.rich())
        save(words.json, line, words.seed, tables)
        if words.write:
            write_page(PAGE, line, tables)
    except (BenchError, OmniError, OSError, ValueError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    return 0


def save(path: Path, line: str, seed: int, tables: Sequence[Table]) -> None:
    """Write the figures as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figures = {"machine": line, "seed": seed, "tables": {table.name: table.json() for table in tables}}
    files.write_text(path, json.dumps(figures, indent=2, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    sys.exit(main())
