# SPDX-License-Identifier: MIT
"""What C and C++ say to people: all comments of the project's own sources and headers, as paragraphs of Markdown."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("shared", "firmware", "hil_sim", "host/native", "bench", "tests")
SUFFIXES = (".c", ".h", ".cpp", ".hpp", ".ino")

_TOKEN = re.compile(
    r"""(?P<string>"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')|(?P<block>/\*.*?\*/)|(?P<line>//[^\n]*)""", re.DOTALL
)
_STAR = re.compile(r"^[ \t]*\*(?!/)[ \t]?", re.MULTILINE)
_TAG = re.compile(r"@(?:param\s+\S+|return\b|brief\b)")
_FILE = re.compile(r"@file \S+")
_LICENCE = re.compile(r"^\s*SPDX-License-Identifier:.*$", re.MULTILINE)
_FOR_TOOLS = re.compile(r"^[/*!<\s]*(?:NOLINT|cppcheck-|clang-format|IWYU)")
"""A comment for a tool: a linter's exception."""


def comments(source: str) -> Iterator[str]:
    """Yield the comments of a source, without their marks; lines of ``//`` that follow one another are one comment."""
    lines: list[str] = []
    end = -1
    for match in _TOKEN.finditer(source):
        if match["string"]:
            continue
        if lines and (
            match["block"] or source[end : match.start()].strip() or source.count("\n", end, match.start()) > 1
        ):
            yield "\n".join(lines)
            lines = []
        if match["line"]:
            alone = not source[source.rfind("\n", 0, match.start()) + 1 : match.start()].strip()
            if lines and not alone:  # behind code: a comment of its own
                yield "\n".join(lines)
                lines = []
            text = re.sub(r"^//[/!]?<?[ \t]?", "", match["line"])
            if alone:
                lines.append(text)
                end = match.end()
            else:
                yield text
        elif not match["block"].startswith("/*@"):
            yield _STAR.sub("", re.sub(r"^/\*+<?", "", match["block"])[:-2])
    if lines:
        yield "\n".join(lines)


def c_text(source: str) -> str:
    """Return all that a source says to people."""
    found = (_LICENCE.sub("", comment) for comment in comments(source))
    said = (comment for comment in found if not _FOR_TOOLS.match(comment))
    texts = (_FILE.sub("", without_laws(comment)) for comment in said)
    return "\n\n".join("\n\n".join(_TAG.split(text)) for text in texts)


def without_laws(block: str) -> str:
    """Return a comment without its laws: indented lines behind an empty one, and indented equations."""
    kept: list[str] = []
    law = True
    for line in block.splitlines():
        law = not line.strip() or (line.startswith("  ") and (law or " = " in line))
        kept.append("" if law else line.strip())
    return "\n".join(kept)


def c_code() -> dict[str, str]:
    """Return what each source says, by the file's name."""
    paths = (path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*")) if path.suffix in SUFFIXES)
    return {path.relative_to(ROOT).as_posix(): c_text(path.read_text(encoding="utf-8")) for path in paths}
