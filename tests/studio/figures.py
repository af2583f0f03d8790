# SPDX-License-Identifier: MIT
"""The studio's figures beside what is wanted of them: ``python -m tests.studio.figures``. About half an hour.

Runs :mod:`tests.studio.measure`, :mod:`tests.studio.peers` and :mod:`tests.studio.memory`, one after another, and keeps
what each found in ``build/studio-figures``: interrupted, it goes on there. ``--write`` puts the tables into
docs/checks/performance.md. Exit code 1: something wanted is not reached.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil_sim.speed import machine
from tests.parity.budget_page import replace_block
from tests.studio.memory import LARGEST_GROWTH_MB_PER_H

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "build" / "studio-figures"
PAGE = ROOT / "docs" / "checks" / "performance.md"
PARTS = ("measure", "peers", "memory")


@dataclass(frozen=True)
class Figure:
    """A row of the table: where it stands in what ``measure`` prints, and what is wanted."""

    what: str
    path: str
    unit: str
    wanted: float
    at_least: bool = False
    factor: float = 1.0

    def of(self, measured: dict[str, Any]) -> float:
        """Return the figure in ``unit``."""
        found: Any = measured
        for name in self.path.split("."):
            found = found[name]
        return self.factor * float(found)

    def reached(self, value: float) -> bool:
        """Return whether the value is what is wanted."""
        return value >= self.wanted if self.at_least else value <= self.wanted


FIGURES = (
    Figure("frames drawn per second", "frames_per_s", "1/s", 45, at_least=True),
    Figure("telemetry at the server → drawn, 95 %", "arrival_to_drawn_ms.p95", "ms", 100),
    Figure("gain changed → mark drawn in the plots, largest", "gain_to_mark_ms.largest", "ms", 150),
    Figure("space bar → the robot says zero duty, 99 %", "stop_to_zero_duty_on_the_wire_ms.p99", "ms", 50),
    Figure("`omni studio` → first sample drawn", "start_to_first_sample_s", "s", 3),
    Figure("server's share of a processor", "server_processor_share", "%", 25, factor=100),
)


def rows(measured: dict[str, Any]) -> list[str]:
    """Return the table of the studio's own figures."""
    lines = ["| | measured | wanted | |", "|---|---:|---:|---|"]
    for figure in FIGURES:
        value = figure.of(measured)
        sign = "≥" if figure.at_least else "≤"
        missed = "" if figure.reached(value) else "missed"
        lines.append(
            f"| {figure.what} | {value:.3g} {figure.unit} | {sign} {figure.wanted:g} {figure.unit} | {missed} |"
        )
    return lines


def peer_rows(frames_s: dict[str, float]) -> list[str]:
    """Return the table of what others draw."""
    return ["| | frames per second |", "|---|---:|", *(f"| {name} | {value:.1f} |" for name, value in frames_s.items())]


def memory_rows(memory: dict[str, Any]) -> list[str]:
    """Return the table of the memory after so many hours, at most eight rows, and how fast it grows at the end."""
    every = memory["rows"]
    chosen = every[:: -(-len(every) // 8)]
    if chosen[-1] is not every[-1]:
        chosen.append(every[-1])
    lines = ["| telemetry | server | page's heap |", "|---:|---:|---:|"]
    lines += [f"| {row['hours']:.2g} h | {row['server_MB']:.0f} MB | {row['page_MB']:.1f} MB |" for row in chosen]
    growth = memory["growth_MB_per_h"]
    last = f"{growth['server_MB']:+.2f} MB/h | {growth['page_MB']:+.2f} MB/h"
    return [*lines, f"| growth in the later half | {last} |"]


def found(part: str) -> dict[str, Any]:
    """Return what a part printed; run it if nothing is kept."""
    kept = KEPT / f"{part}.json"
    if not kept.exists():
        sys.stderr.write(f"{part} ...\n")
        done = subprocess.run(
            [sys.executable, "-m", f"tests.studio.{part}"], cwd=ROOT, stdout=subprocess.PIPE, check=False
        )
        result = json.loads(done.stdout)
        result["machine"] = machine()
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_text(json.dumps(result, indent=1))
    return dict(json.loads(kept.read_text()))


def blocks_of(measured: dict[str, dict[str, Any]]) -> dict[str, list[str]]:
    """Return the lines of the page's tables that what was measured fills, by their marks on the page."""
    blocks: dict[str, list[str]] = {}
    if "measure" in measured:
        blocks["studio-machine"] = [f"*{measured['measure']['machine']}*"]
        blocks["studio-speed"] = rows(measured["measure"])
    if "peers" in measured:
        frames_s = {name: value for name, value in measured["peers"].items() if name != "machine"}
        blocks["studio-peers"] = peer_rows(frames_s)
    if "memory" in measured:
        blocks["studio-memory"] = memory_rows(measured["memory"])
    return blocks


def all_reached(measured: dict[str, dict[str, Any]]) -> bool:
    """Return whether everything that was measured is as wanted."""
    speed, memory = measured.get("measure"), measured.get("memory")
    flat = memory is None or max(memory["growth_MB_per_h"].values()) < LARGEST_GROWTH_MB_PER_H
    return flat and (speed is None or all(figure.reached(figure.of(speed)) for figure in FIGURES))


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.studio.figures", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--write", action="store_true", help="put the tables into docs/checks/performance.md")
    parser.add_argument("--again", action="store_true", help="forget what was measured before")
    parser.add_argument("--only", choices=PARTS, help="leave out the other parts")
    options = parser.parse_args()
    wanted = PARTS if options.only is None else (options.only,)
    if options.again:
        for part in wanted:
            (KEPT / f"{part}.json").unlink(missing_ok=True)
    measured = {part: found(part) for part in wanted}
    blocks = blocks_of(measured)
    text = PAGE.read_text()
    for name, lines in blocks.items():
        sys.stdout.write("\n".join(lines) + "\n\n")
        text = replace_block(text, name, lines)
    if options.write:
        PAGE.write_text(text)
    return 0 if all_reached(measured) else 1


if __name__ == "__main__":
    sys.exit(main())
