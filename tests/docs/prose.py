# SPDX-License-Identifier: MIT
"""Warns of long sentences and of paraphrased terms in README, CONTRIBUTING and docs; part of ``make lint``.

A warning is never an error.

usage: python -m tests.docs.prose
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ("docs/reference/generated/", "docs/report/results.md")
MOST_WORDS = 30
"""Of a sentence without a warning."""

HABITS = {
    r"set-points?": "setpoint",
    r"dead[- ]band": "deadband",
    r"host-in-the-loop": "software-in-the-loop (a process), hardware-in-the-loop (a board), HIL mode",
    r"nobody|somebody|whoever": "the component, sender or client that is meant",
    r"no longer|not any more|earlier version|as it was": "what is, without its history",
    r"for ever": "continuous, permanently",
    r"shall": "should, must, or the value",
}
"""Words that stand for a term of the field, and what is plainer."""

_HABIT = re.compile(rf"\b({'|'.join(HABITS)})\b", re.IGNORECASE)
_END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*`\[]*[A-Z0-9`])")
_WORD = re.compile(r"[\"'(*\[]*[^\W\d_]{2,}([-'][^\W\d_]+)*[\"')*\].,:;!?]*")
"""Letters alone: a name in code, a number or a symbol of a formula is none."""


def pages() -> dict[str, str]:
    """Return the pages that people write, by name."""
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", ROOT / "shared/core/README.md"]
    paths = {path.relative_to(ROOT).as_posix(): path for path in [*files, *sorted((ROOT / "docs").rglob("*.md"))]}
    return {name: path.read_text(encoding="utf-8") for name, path in paths.items() if not name.startswith(GENERATED)}


def _text(token: Token) -> str:
    parts = []
    for child in token.children or []:
        if child.type in ("text", "code_inline"):
            parts.append("`code`" if child.type == "code_inline" else child.content)
        elif child.type in ("softbreak", "hardbreak"):
            parts.append(" ")
    return "".join(parts)


def sentences(markdown: str) -> Iterator[str]:
    """Return the sentences of a page, without code, headings and comments; a cell of a table ends a sentence."""
    heading = False
    for token in MarkdownIt("commonmark").enable("table").parse(markdown):
        heading = token.type == "heading_open" or (heading and token.type != "heading_close")
        if token.type == "inline" and not heading:
            yield from (part.strip() for part in _END.split(_text(token)) if part.strip())


def words(sentence: str) -> int:
    """Return how many words a sentence has."""
    return sum(1 for word in sentence.split() if _WORD.fullmatch(word))


def habit(sentence: str) -> tuple[str, str] | None:
    """Return the first paraphrase of a sentence, and what is plainer; None if there is none."""
    found = _HABIT.search(sentence)
    if found is None:
        return None
    return found[0], next(
        plainer for words_, plainer in HABITS.items() if re.fullmatch(words_, found[0], re.IGNORECASE)
    )


def main() -> None:
    """Print a line for each long sentence, and for each that paraphrases a term."""
    for name, text in pages().items():
        for sentence in sentences(text):
            if found := habit(sentence):
                print(f"warning: {name}: {found[0]!r}, plainer: {found[1]}: {sentence}")
            if words(sentence) > MOST_WORDS:
                print(f"warning: {name}: {words(sentence)} words: {sentence}")


if __name__ == "__main__":
    main()
