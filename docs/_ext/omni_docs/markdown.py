# SPDX-License-Identifier: MIT
"""Small pieces of Markdown that the generators share."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

_SPECIAL = re.compile(r"([\\*_<>\[\]#|~$])")
_CODE = re.compile(r"(`[^`]+`)")


def escaped(text: str) -> str:
    """Return plain text so that Markdown shows it as it is; what stands in backticks stays code."""
    parts = _CODE.split(text)
    return "".join(part if part.startswith("`") else _SPECIAL.sub(r"\\\1", part) for part in parts)


def code(text: str) -> str:
    """Return the text as code, or nothing if it is empty."""
    return f"`{text}`" if text else ""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; cells are Markdown already, in one line or more."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)


def _cell(text: str) -> str:
    return re.sub(r"(?<!\\)\|", r"\|", text.replace("\n", " "))


def page(*parts: str) -> str:
    """Return a page of these blocks."""
    return "\n\n".join(part for part in parts if part) + "\n"
