# SPDX-License-Identifier: MIT
"""Mermaid state diagrams as tables: they need no program from elsewhere and can be read aloud."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.util.docutils import SphinxDirective

_ARROW = re.compile(r"^\s*(\S+) --> (\S+?)(?:: (.+))?$")


class StateDiagram(SphinxDirective):
    """``mermaid``: the arrows of a state diagram as rows."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the table."""
        rows = [match.groups() for line in self.content if (match := _ARROW.match(line))]
        if not rows:
            raise self.error("only state diagrams are understood here")
        lines = [[start, words or "", end] for start, end, words in rows if start != "[*]"]
        return [_table([["From", "On", "To"], *lines])]


def _table(lines: list[list[str]]) -> nodes.table:
    group = nodes.tgroup("", *[nodes.colspec(colwidth=1) for _ in lines[0]], cols=len(lines[0]))
    group += nodes.thead("", _row(lines[0]))
    group += nodes.tbody("", *[_row(line) for line in lines[1:]])
    return nodes.table("", group)


def _row(cells: list[str]) -> nodes.row:
    return nodes.row("", *[nodes.entry("", nodes.paragraph("", cell)) for cell in cells])
