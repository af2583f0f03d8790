# SPDX-License-Identifier: MIT
"""The results of a whole bring-up: bringup.json for programs and bringup.md for people."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from omniwheel import files
from omniwheel.bringup.result import Result
from omniwheel.number_text import finite

TITLE = "Bring-up"
FILES = {"bringup.json": b'{\n  "ok": ', "bringup.md": f"# {TITLE}".encode()}
"""What is written, and how each file begins."""


def as_markdown(results: Sequence[Result], title: str) -> str:
    """Return a table per check."""
    lines = [f"# {title}", ""]
    for result in results:
        lines += [f"## {result.check}: {'pass' if result.ok else 'FAIL'}", "", "| | Item | Result |", "|---|---|---|"]
        lines += [f"| {'✓' if f.ok else '✗'} | {f.name} | {f.seen} |" for f in result.findings]
        lines += ["", *(f"- {advice}" for advice in result.advice)]
        lines += [""] if result.advice else []
    return "\n".join(lines).rstrip() + "\n"


def as_dict(results: Sequence[Result]) -> dict[str, object]:
    """Return plain values for JSON."""
    return {"ok": all(result.ok for result in results), "checks": [result.as_dict() for result in results]}


def write_results(results: Sequence[Result], folder: Path, title: str) -> tuple[Path, Path]:
    """Write both files, over older ones; return their paths. Raises OutputFileError."""
    json_path, text_path = (folder / name for name in FILES)
    files.write_json(json_path, finite(as_dict(results)))
    files.write_text(text_path, as_markdown(results, title))
    return json_path, text_path
