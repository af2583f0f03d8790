# SPDX-License-Identifier: MIT
"""Writes the generated parts of docs/reference/safety.md: ``python -m bench.figures.fault_table [--write]``.

They are the diagram of the safety states, from the robot's own table, and the table of faults, from a run of every
case.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

from hil_sim.fault_bench import FaultResult, run_case
from hil_sim.fault_cases import CASES, EMERGENCY_STOP, FaultCase
from hil_sim.state_diagram import diagram
from omniwheel import files

PAGE = Path("docs/reference/safety.md")
STATES = ("<!-- states: python -m bench.figures.fault_table --write -->", "<!-- end of states -->")
FAULTS = ("<!-- faults: python -m bench.figures.fault_table --write -->", "<!-- end of faults -->")
HEAD = (
    "| Fault | Motors | Zero volts within | Measured [ms] | The robot says | Way back |",
    "|---|---|---|---|---|---|",
)
_BY_ITSELF = "drives on"
_AGAIN = "disarm, arm"
_RELEASED = "release, arm"


def bound_text(case: FaultCase) -> str:
    """Return the bound as the table shows it, constants in ms."""
    if case.stops is None or not case.coasts:
        return ""
    if case.bound == "0":
        return "the same tick"
    words = (f"`{w}`" if w.isidentifier() else f"{float(w) * 1e3:g} ms" for w in case.bound.split(" + "))
    return " + ".join(words)


def reaction(case: FaultCase) -> str:
    """Return what the motors do."""
    if case.stops is None:
        return "drive on"
    return "coast" if case.coasts else "**keep their voltage** until the bus works again"


def row(result: FaultResult) -> str:
    """Return a case's row."""
    case = result.case
    stops = [] if case.failsafe is None else [f"`failsafe: {case.failsafe}`"]
    warns = [] if case.warns is None else [f"warning `{case.warns}`"]
    said = ", ".join([*stops, *warns, *([] if case.says is None else [f"`{case.says}`"])])
    measured = "" if case.stops is None or result.latency_s is None else f"{result.latency_s * 1e3:.0f}"
    back = {None: _BY_ITSELF, EMERGENCY_STOP: _RELEASED}.get(case.stops, _AGAIN)
    return f"| {case.what} | {reaction(case)} | {bound_text(case)} | {measured} | {said} | {back} |"


def table(results: Iterable[FaultResult]) -> str:
    """Return the whole table."""
    return "\n".join([*HEAD, *(row(result) for result in results)])


def with_part(document: str, marks: tuple[str, str], text: str) -> str:
    """Return the document with another text between two marks; ValueError if one is missing."""
    start, end = document.index(marks[0]) + len(marks[0]), document.index(marks[1])
    return f"{document[:start]}\n{text}\n{document[end:]}"


def main() -> None:
    """Print diagram and table, or put them into docs/reference/safety.md."""
    parser = argparse.ArgumentParser(prog="python -m bench.figures.fault_table", description=__doc__)
    parser.add_argument("--write", action="store_true", help="put them into --file instead of printing them")
    parser.add_argument("--file", type=Path, default=PAGE, help="document with the parts' marks")
    arguments = parser.parse_args()
    parts = {STATES: diagram(), FAULTS: table(run_case(case) for case in CASES)}
    if not arguments.write:
        sys.stdout.write("\n\n".join(parts.values()) + "\n")
        return
    document = arguments.file.read_text()
    for marks, text in parts.items():
        document = with_part(document, marks, text)
    files.write_text(arguments.file, document)


if __name__ == "__main__":
    main()
