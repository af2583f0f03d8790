# SPDX-License-Identifier: MIT
"""Instructions and cycles of the control tick and of an encoder's interrupt, in the image that is flashed.

Instructions are counted on Unicorn and held against tests/parity/budgets.toml. Cycles are estimates by LLVM's
scheduling model of the Cortex-M7; docs/checks/performance.md says what the bounds mean.

usage: python tests/image/tick_cycles.py [--write]
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.image import flashed
from tests.needs import remedies
from tests.parity.budget_page import CASES, CLOCK_MHZ, TICK_US, replace_block
from tests.parity.budgets import PAGE, read_recorded, too_large
from tests.parity.builds import BuildError

if TYPE_CHECKING:
    from tests.image.edge_cycles import EdgeFigures
    from tests.image.tick_figures import CaseFigures

EDGE_WHEELS = (1, 3, 4)


def share(cycles: float) -> str:
    """Return the share of the processor that these cycles of every tick are."""
    return f"{100.0 * cycles / (CLOCK_MHZ * TICK_US):.2f} %"


def counted(cases: Sequence[CaseFigures]) -> dict[str, int]:
    """Return the instruction counts under the names of the budgets."""
    names = ("core_mean", "core_max", "tick_mean", "tick_max")
    return {f"{case.name}.{name}": getattr(case, name) for case in cases for name in names}


def wrong_order(cases: Sequence[CaseFigures], edges: Sequence[EdgeFigures]) -> list[str]:
    """Return a sentence for every estimate that is not between its bounds."""
    rows = [(f"{case.name}, mean", case.bounds_mean, case.in_order_mean) for case in cases]
    rows += [(f"{case.name}, max", case.bounds_max, case.in_order_max) for case in cases]
    sentences = [
        f"{name}: {middle} cycles in order, not between {bounds.units:.0f} and {bounds.serial}"
        for name, bounds, middle in rows
        if not bounds.units <= middle <= bounds.serial
    ]
    return sentences + [
        f"an edge of {edge.wheels} wheels: {edge.in_order:.0f} cycles in order, not between its bounds"
        for edge in edges
        if not edge.units <= edge.in_order <= edge.serial
    ]


def tick_rows(cases: Sequence[CaseFigures], recorded: Mapping[str, int]) -> list[str]:
    """Return the table of the tick."""
    rows = [
        "| case | instructions, mean | by QEMU | max | cycles, mean: at least | in order | at most "
        "| largest tick: at least | in order | at most | share, in order |",
        "|---|" + "---:|" * 10,
    ]
    for case in cases:
        mean, largest = case.bounds_mean, case.bounds_max
        figures = [case.tick_mean, recorded[f"{case.name}.tick_mean"], case.tick_max]
        figures += [round(mean.units), case.in_order_mean, mean.serial]
        figures += [round(largest.units), case.in_order_max, largest.serial]
        cells = " | ".join(str(figure) for figure in figures)
        rows.append(f"| {CASES[case.name]} | {cells} | {share(case.in_order_mean)} |")
    return rows


def edge_rows(edges: Sequence[EdgeFigures]) -> list[str]:
    """Return the table of the encoders' interrupt."""
    rows = [
        "| wheels counted by interrupts | instructions per edge | cycles: at least | in order | at most "
        "| share at 40 000 edges/s per wheel: at least | in order | at most |",
        "|---|" + "---:|" * 7,
    ]
    for edge in edges:
        cycles = (edge.units, edge.in_order, edge.serial)
        shares = " | ".join(f"{100.0 * edge.share(figure):.2f} %" for figure in cycles)
        cells = " | ".join(f"{figure:.0f}" for figure in (edge.instructions, *cycles))
        rows.append(f"| {edge.wheels} | {cells} | {shares} |")
    return rows


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="count and estimate the control tick inside the flashed image")
    parser.add_argument("--write", action="store_true", help="put the figures into docs/checks/performance.md")
    options = parser.parse_args()
    console = Console(soft_wrap=True, highlight=False)
    image = flashed.image_path()
    if lacking := remedies("arm", "llvm", "image"):
        console.print(f"Nothing was measured. First: {lacking}", style="red", markup=False)
        return 1 if os.environ.get("CI") == "true" or options.write else 0
    from tests.image.cortex_m7_model import ModelError, version
    from tests.image.edge_cycles import measure_edges
    from tests.image.tick_figures import measure_cases

    try:
        cases = measure_cases(image)
        edges = [measure_edges(image, wheels) for wheels in EDGE_WHEELS]
    except (BuildError, ModelError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    recorded = read_recorded()
    tick, edge, model = tick_rows(cases, recorded), edge_rows(edges), [f"*LLVM {version()}, `-mcpu=cortex-m7`.*"]
    console.print(*tick, "", *edge, "", *model, sep="\n", markup=False)
    if options.write:
        page = replace_block(PAGE.read_text(), "tick-cycles", [*tick, "", *model])
        PAGE.write_text(replace_block(page, "edge-cycles", edge))
    measured = counted(cases)
    wrong = too_large(measured, {name: recorded[name] for name in measured}) + wrong_order(cases, edges)
    for sentence in wrong:
        console.print(sentence, style="red", markup=False)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
