# SPDX-License-Identifier: MIT
"""Tables of studies as rows of text: for the terminal and for the page alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hil_sim.studies.figures import FIGURES
from hil_sim.studies.study_summary import counted
from omniwheel import files

PAGE_FILE = "montecarlo.md"
SPREAD_HEADINGS = ("", "mean", "± 95 %", "sd", "median", "5 %", "95 %", "99 %", "worst")

NO_FIGURES = "none of them drove on a path, so there are no metrics"


def spread_rows(summary: dict[str, Any]) -> list[list[str]]:
    """Return a row per figure under SPREAD_HEADINGS; figures that no run has are left out."""
    rows = []
    for name, figure in FIGURES.items():
        entry = summary["figures"][name]
        if entry["runs"] == 0 or figure.detail:
            continue
        interval = entry["mean_95"]
        half = None if interval is None else 0.5 * (interval[1] - interval[0])
        numbers = (entry["mean"], half, *(entry[key] for key in ("sd", "median", "p5", "p95", "p99", "max")))
        rows.append([figure.heading, *(figure.show(number) for number in numbers)])
    return rows


def completion_line(summary: dict[str, Any]) -> str:
    """Say how many runs were driven to the end, with Wilson's interval."""
    completed = summary["completed"]
    low, high = (100.0 * share for share in completed["share_95"])
    return (
        f"driven to the end: {completed['runs']} of {summary['runs']} runs, {100.0 * completed['share']:.4g} % "
        f"(95 % interval {low:.4g} to {high:.4g} %)"
    )


def fault_lines(summary: dict[str, Any]) -> list[str]:
    """Say which faults and warnings were seen in how many runs."""
    runs, kinds = summary["runs"], (("stops", "faults"), ("warnings", "warnings"))
    refused = [f"could not be run: {counted(summary['not_run'], runs)}"] if summary["not_run"] else []
    return [*refused, *(f"{word}: {counted(summary['faults'][key], runs)}" for key, word in kinds)]


def markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown, numbers to the right."""
    lines = [f"| {' | '.join(headings)} |", f"|---|{'--:|' * (len(headings) - 1)}"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines)


def write_montecarlo_page(summary: dict[str, Any], picture: str, path: Path) -> None:
    """Write the page of a Monte Carlo study."""
    first, last = summary["seeds"]
    worst = [
        [entry["file"], str(entry["seed"]), FIGURES[summary["worst_by"]].show(entry[summary["worst_by"]])]
        for entry in summary["worst"]
    ]
    parts = [
        f"# {summary['scenario']}: {summary['runs']} runs",
        summary["description"],
        f"Robot {summary['robot']}, plant {summary['plant']}, seeds {first} to {last}, "
        f"{summary['simulated_s']:.1f} s simulated, omniwheel {summary['engine']['omniwheel']}.",
        markdown_table(SPREAD_HEADINGS, rows) if (rows := spread_rows(summary)) else f"{NO_FIGURES.capitalize()}.",
        "\n".join(f"- {line}" for line in (completion_line(summary), *fault_lines(summary))),
        f"![Distribution of the metrics]({picture})",
        f"Worst runs by {FIGURES[summary['worst_by']].heading}; `omni run --core-only FILE` repeats one:",
        markdown_table(("file", "seed", FIGURES[summary["worst_by"]].heading), worst),
    ]
    files.write_text(path, "\n\n".join(parts) + "\n")
