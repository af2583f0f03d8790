# SPDX-License-Identifier: MIT
"""The budgets' gate: instructions, stack and memory of the control tick on the Cortex-M7, beside what was recorded.

usage: python tests/parity/budgets.py [--write]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.parity.budget_figures import Figures, measure
from tests.parity.budget_page import unmoved, write_page
from tests.parity.builds import CORTEX_M7, GATE, ROOT, BuildError, generate, make, usable

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

RECORDED = Path(__file__).with_name("budgets.toml")
PAGE = ROOT / "docs" / "checks" / "performance.md"
SLACK = 1.10
LIMITS = {"every_filter.tick_mean": 5500, "gyro.tick_mean": 7000}
"""What may not be exceeded whatever was recorded."""


def too_large(measured: Mapping[str, int], recorded: Mapping[str, int]) -> list[str]:
    """Return a sentence for every figure beyond its record plus slack, beyond its limit, or without a record."""
    sentences = [
        f"{name}: {value}, recorded {recorded[name]}, more than 10 % above"
        for name, value in measured.items()
        if name in recorded and value > recorded[name] * SLACK
    ]
    sentences += [
        f"{name}: {measured[name]}, the limit is {limit}"
        for name, limit in LIMITS.items()
        if name in measured and measured[name] > limit
    ]
    if set(measured) != set(recorded):
        sentences.append(
            "not the figures that were recorded: " + ", ".join(sorted(set(measured) ^ set(recorded))) + " (run --write)"
        )
    return sentences


def read_recorded() -> dict[str, int]:
    """Return the recorded figures by name."""
    with RECORDED.open("rb") as file:
        sections = tomllib.load(file)
    return {f"{section}.{name}": value for section, entries in sections.items() for name, value in entries.items()}


def updated(measured: Mapping[str, int], recorded: Mapping[str, int]) -> Figures:
    """Return the figures to record: those measured, but the recorded one where it has hardly moved."""
    return {
        name: recorded[name] if name in recorded and unmoved(recorded[name], value) else value
        for name, value in measured.items()
    }


def write_recorded(figures: Mapping[str, int]) -> None:
    """Replace the recorded figures."""
    lines = [
        "# SPDX-License-Identifier: MIT",
        "# Written by: make budgets ARGS=--write; see docs/checks/performance.md.",
    ]
    section = ""
    for name, value in figures.items():
        head, _, tail = name.rpartition(".")
        if head != section:
            section = head
            lines += ["", f"[{head}]"]
        lines.append(f"{tail} = {value}")
    RECORDED.write_text("\n".join(lines) + "\n")


def table(measured: Mapping[str, int], recorded: Mapping[str, int]) -> Table:
    """Return measured beside recorded figures."""
    result = Table(title="Cortex-M7: instructions and bytes")
    result.add_column("figure")
    result.add_column("measured", justify="right")
    result.add_column("recorded", justify="right")
    for name, value in measured.items():
        result.add_row(name, str(value), str(recorded.get(name, "")))
    return result


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="measure the control tick on the emulated Cortex-M7")
    parser.add_argument("--write", action="store_true", help="record what is measured, and put it into the page")
    options = parser.parse_args()
    console = Console(soft_wrap=True)
    try:
        builds, missing = usable([build for build in GATE if build.name == CORTEX_M7])
        if not builds:
            console.print(f"left out: {missing[0]}", style="yellow", markup=False)
            return 0
        generate()
        make(builds[0])
        figures: Figures = measure(builds[0])
    except BuildError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    if options.write:
        kept = updated(figures, read_recorded())
        write_recorded(kept)
        write_page(PAGE, kept)
    recorded = read_recorded()
    console.print(table(figures, recorded))
    sentences = too_large(figures, recorded)
    for sentence in sentences:
        console.print(sentence, style="red", markup=False)
    return 1 if sentences else 0


if __name__ == "__main__":
    sys.exit(main())
