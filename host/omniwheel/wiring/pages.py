# SPDX-License-Identifier: MIT
"""Writes the wiring tables and diagrams of the shipped robots into the documentation.

``python -m omniwheel.wiring.pages`` from a checkout; a test holds that nothing would change.
"""

from __future__ import annotations

from pathlib import Path

from omniwheel import files
from omniwheel.robots import read_robot, robot_names
from omniwheel.wiring import electrics
from omniwheel.wiring.connections import HEADING, Connection, connections
from omniwheel.wiring.diagram import draw_wiring
from omniwheel.wiring.plan import plan_wiring

ROBOT = "three_wheel"
"""Whose tables the pages show."""
WIRING = ("<!-- wiring: python -m omniwheel.wiring.pages -->", "<!-- end of wiring -->")
OE = ("<!-- oe: python -m omniwheel.wiring.pages -->", "<!-- end of oe -->")
_PULL_UPS_OHM = (10_000.0, 4_700.0, 2_200.0, electrics.OE_PULL_UP_OHM)


def markdown(table: tuple[Connection, ...]) -> str:
    """Return the table in Markdown."""
    rows = [f"| {row.start} | {row.end} | {row.note} |" for row in table]
    return "\n".join([f"| From | To | {HEADING.capitalize()} |", "|---|---|---|", *rows])


def oe_table() -> str:
    """Return what each pull-up gives against a board's pull-down, in Markdown."""
    rows = [_oe_row(ohm) for ohm in _PULL_UPS_OHM]
    head = "| Pull-up | OE, board pulls down by 10 kΩ | The chip is | The pin sinks |"
    return "\n".join([head, "|---|---|---|---|", *rows])


def _oe_row(pull_up_ohm: float) -> str:
    level = electrics.oe_level_V(pull_up_ohm)
    verdict = "off" if level >= electrics.OE_OFF_V else "undefined" if level > electrics.OE_ON_V else "on"
    return f"| {pull_up_ohm / 1e3:g} kΩ | {level:.2f} V | {verdict} | {1e3 * electrics.oe_sink_A(pull_up_ohm):.1f} mA |"


def pages(docs: Path) -> dict[Path, str]:
    """Return what each file below ``docs`` should hold; ValueError if a page has lost its marks."""
    table = connections(plan_wiring(read_robot(ROBOT)))
    parts = {
        docs / "guides" / "bring-up.md": (WIRING, markdown(table)),
        docs / "guides" / "robot-file.md": (OE, oe_table()),
    }
    texts = {page: _with_part(page.read_text(encoding="utf-8"), *part) for page, part in parts.items()}
    drawings = {drawing_path(docs, name): draw_wiring(plan_wiring(read_robot(name))) for name in robot_names()}
    return {**texts, **drawings}


def drawing_path(docs: Path, name: str) -> Path:
    """Return where a robot's diagram is."""
    return docs / "images" / f"wiring_{name}.svg"


def _with_part(document: str, marks: tuple[str, str], text: str) -> str:
    start, end = document.index(marks[0]) + len(marks[0]), document.index(marks[1])
    return f"{document[:start]}\n{text}\n{document[end:]}"


if __name__ == "__main__":
    for path, text in pages(Path("docs")).items():
        files.write_text(path, text)
