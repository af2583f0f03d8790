# SPDX-License-Identifier: MIT
"""Tables of figures: on the terminal, as JSON, and in docs/checks/performance.md between markers."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.table import Table as RichTable

from omniwheel import files
from tests.parity.budget_page import replace_block

PAGE_WIDTH = 120

Cell = float | str | None
"""A figure, words, or nothing."""


@dataclass(frozen=True)
class Row:
    """One candidate and its cells by column heading."""

    label: str
    cells: Mapping[str, Cell]


@dataclass(frozen=True)
class Table:
    """One benchmark. ``name`` is that of its markers; ``note`` says parameters, seed, rounds."""

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    note: str

    def markdown(self) -> list[str]:
        """Return the lines for the page."""
        lines = [f"| {' | '.join([self.title, *self.columns])} |", "|---|" + "---:|" * len(self.columns)]
        lines += [f"| {' | '.join([row.label, *self._cells(row)])} |" for row in self.rows]
        return [*lines, "", *textwrap.wrap(f"*{self.note}*", PAGE_WIDTH, break_on_hyphens=False)]

    def rich(self) -> RichTable:
        """Return the table for the terminal."""
        table = RichTable(title=self.title, title_style="bold", title_justify="left", caption=self.note)
        table.add_column("")
        for heading in self.columns:
            table.add_column(heading, justify="right")
        for row in self.rows:
            table.add_row(row.label, *self._cells(row))
        return table

    def json(self) -> dict[str, Any]:
        """Return all figures as they were measured."""
        return {"title": self.title, "note": self.note, "rows": {row.label: dict(row.cells) for row in self.rows}}

    def _cells(self, row: Row) -> list[str]:
        return [shown(row.cells.get(heading)) for heading in self.columns]


def shown(cell: Cell) -> str:
    """Return a figure with three digits."""
    if cell is None:
        return ""
    if isinstance(cell, str):
        return cell
    if cell == 0.0:
        return "0"
    text = f"{cell:.3g}"
    return f"{float(text):.0f}" if "e" in text and abs(cell) >= 1.0 else text


def with_ratios(rows: Sequence[Row], column: str, reference: str, heading: str) -> tuple[Row, ...]:
    """Return the rows with a column more: a row's figure in units of the reference row's."""
    base = next(row.cells[column] for row in rows if row.label == reference)
    if not isinstance(base, float):
        raise TypeError(f"{reference}: {column} is {base!r}, not a figure to compare with")
    result = []
    for row in rows:
        value = row.cells.get(column)
        ratio = value / base if isinstance(value, (int, float)) else None
        result.append(Row(row.label, {**row.cells, heading: ratio}))
    return tuple(result)


def write_page(page: Path, machine: str, tables: Sequence[Table]) -> None:
    """Put the tables into the page, all or none. Each says when and where it was measured: others may be older."""
    text = replace_block(page.read_text(), "bench-machine", [machine])
    for table in (replace(table, note=f"{table.note} {machine}.") for table in tables):
        text = replace_block(text, f"bench-{table.name}", table.markdown())
    files.write_text(page, text)
