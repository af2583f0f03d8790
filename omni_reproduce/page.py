# SPDX-License-Identifier: MIT
"""The page to put beside the report: Markdown, and the same as HTML, with the pictures next to it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt

from omni_reproduce.experiment import Row
from omni_reproduce.numbers import mean_and_sd, number, ratio
from omni_reproduce.study import Outcome, row_dict
from omniwheel import files

MARKDOWN_FILE = "reproduction.md"
HTML_FILE = "reproduction.html"
SUMMARY_FILE = "summary.md"
JSON_FILE = "rows.json"

HEADINGS = ("setting", "quantity", "unit", "published", "ours", "seeds", "limit", "ratio", "")
_SUMMARY_COLUMNS = (0, 1, 2, 3, 4, 6)
"""The columns of HEADINGS in the summary's tables; *published* and *limit* only where a row has one."""
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; } h2 { margin-top: 3rem; border-top: 1px solid #ccc; padding-top: 1.5rem; }
table { border-collapse: collapse; font-size: 13.5px; }
th, td { padding: .2rem .7rem; border-bottom: 1px solid #e4e4e4; }
th { text-align: left; } td:nth-child(n+4):nth-child(-n+8) { text-align: right; white-space: nowrap; }
img { max-width: 100%; } code { background: #f3f3f3; padding: 0 .2rem; }
"""


def footnotes(rows: Sequence[Row]) -> tuple[list[str], list[str]]:
    """Return each row's footnote mark ("" for none) and the explanations, equal ones once."""
    texts: list[str] = []
    marks = []
    for row in rows:
        if row.explanation and row.explanation not in texts:
            texts.append(row.explanation)
        marks.append(f"[{texts.index(row.explanation) + 1}]" if row.explanation else "")
    return marks, texts


def cells(row: Row, mark: str) -> tuple[str, ...]:
    """Return a row's texts, under HEADINGS."""
    return (
        row.setting,
        row.quantity,
        row.unit,
        mean_and_sd(row.published, row.published_sd),
        mean_and_sd(row.ours, row.sd if row.seeds != 1 else None),
        str(row.seeds) if row.seeds else "",
        number(row.limit) if row.limit is not None else "",
        ratio(row) if row.published is not None else "",
        mark,
    )


def markdown(outcomes: Sequence[Outcome], facts: str) -> str:
    """Return the page as Markdown; ``facts`` says how it came about."""
    lines = ["# The report, reproduced", "", facts, ""]
    for outcome in outcomes:
        lines += _section(outcome)
    return "\n".join(lines) + "\n"


def summary(outcomes: Sequence[Outcome], facts: str) -> str:
    """Return a short page as Markdown: of each experiment the rows of its ``headline``, and its pictures.

    A comment has the number of all rows and the digest of the whole section, so that a change of any figure shows.
    """
    lines = ["# The report, reproduced", "", facts, ""]
    for outcome in outcomes:
        lines += _summary_section(outcome)
    return "\n".join(lines) + "\n"


def digest(text: str) -> str:
    """Return the first 16 hexadecimal digits of a text's SHA-256."""
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _summary_section(outcome: Outcome) -> list[str]:
    experiment = outcome.experiment
    section = _section(outcome)
    lines = [*section[:4], experiment.about, ""]
    if outcome.error:
        return [*lines, section[4], ""]
    rows = outcome.result.rows
    shown = [cells(row, "") for row in rows if re.search(experiment.headline, f"{row.setting}|{row.quantity}")]
    if shown:
        columns = [i for i in _SUMMARY_COLUMNS if i not in (3, 6) or any(texts[i].strip("–") for texts in shown)]
        for texts in (HEADINGS, ("---",) * len(HEADINGS), *shown):
            lines.append("| " + " | ".join(_cell(texts[i]) for i in columns) + " |")
        lines.append("")
    lines += [f"<!-- {len(rows)} rows, sha256 {digest(chr(10).join(section))} -->", ""]
    for figure in outcome.result.pictures:
        lines += [f"![{figure.stem}]({figure.name})", ""]
    return lines


def _section(outcome: Outcome) -> list[str]:
    lines = [f"## {outcome.experiment.title}", "", f"`omni reproduce {outcome.experiment.name}`", ""]
    if outcome.error:
        lines += [f"**Not run:** {outcome.error}. {outcome.hint}", ""]
    for note in outcome.result.notes:
        lines += [note, ""]
    rows = outcome.result.rows
    if rows:
        marks, texts = footnotes(rows)
        lines += ["| " + " | ".join(HEADINGS) + " |", "|" + "---|" * len(HEADINGS)]
        for row, mark in zip(rows, marks, strict=True):
            lines.append("| " + " | ".join(_cell(text) for text in cells(row, mark)) + " |")
        lines.append("")
        lines += [f"{i}. {text}" for i, text in enumerate(texts, start=1)]
        lines.append("")
    for figure in outcome.result.pictures:
        lines += [f"![{figure.stem}]({figure.name})", ""]
    return lines


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def html(text: str) -> str:
    """Return a Markdown page as one HTML page."""
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    title = escape(text.splitlines()[0].lstrip("# "))
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )


def data(outcomes: Sequence[Outcome], about: dict[str, Any]) -> dict[str, Any]:
    """Return everything as plain data: how it came about, the experiments, and all rows in one list."""
    experiments = [
        {
            "name": outcome.experiment.name,
            "title": outcome.experiment.title,
            "seconds": outcome.seconds,
            "error": outcome.error or None,
            "figures": [figure.name for figure in outcome.result.pictures],
        }
        for outcome in outcomes
    ]
    rows = [row_dict(row) for outcome in outcomes for row in outcome.result.rows]
    return {**about, "experiments": experiments, "rows": rows}


def write(folder: Path, outcomes: Sequence[Outcome], facts: str, everything: dict[str, Any]) -> None:
    """Write the page, as Markdown and as HTML, its summary, and the rows as JSON."""
    text = markdown(outcomes, facts)
    files.write_text(folder / MARKDOWN_FILE, text)
    files.write_text(folder / SUMMARY_FILE, summary(outcomes, facts))
    files.write_text(folder / HTML_FILE, html(text))
    files.write_json(folder / JSON_FILE, everything)
