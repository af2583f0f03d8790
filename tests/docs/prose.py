# SPDX-License-Identifier: MIT
"""Can people read it? ``python -m tests.docs.prose [--write]``, part of ``make lint``.

Looks at README, CONTRIBUTING and docs, at docstrings, comments and help texts of Python, at comments of C and C++, and
at the parameters' texts. Wrong are sentences of 25 words or more, words that only insiders use, and other words for
what the glossary has a word for. In pages, lines of more than 120 characters are wrong, too.

What was there before the check is listed in prose.toml, as a number per file. The numbers can only shrink: more is an
error, and so is a number that is higher than what is there. ``--write`` lowers them; it never raises one.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import tomli_w
from markdown_it import MarkdownIt
from markdown_it.token import Token

from omni_schema.toml_file import read_toml
from tests.docs.prose_sources import code, pages

BASELINE = Path(__file__).with_name("prose.toml")
GLOSSARY = "docs/glossary.md"
TOO_LONG = 25
"""Words from which on a sentence is too long."""
WIDTH = 120
"""Characters of a line of a page."""
INSIDE_WORDS: Mapping[str, str] = {
    r"\bsimply\b|\bobviously\b|\btrivially\b|\bof course\b": "leave it out",
    r"\bheals?\b|\bhealed\b": "reinitialise",
    r"\bfoot-?gun\b": "say what goes wrong",
    r"\bbikeshed": "say what was discussed",
    r"\bTODO\b|\bFIXME\b|\bWIP\b": "do it, or open an issue",
    r"\bnitpick": "say what is checked",
    r"\bsanity\b": "say what is checked",
    r"\b(?:black|grey|gray|white)lists?\b": "say what is allowed or refused",
    r"\bdog-?food": "say who uses it",
    r"\byak\b|\bboil the ocean\b|\bbelt and braces\b": "say it plainly",
    r"\bblast radius\b|\bhappy path\b|\bgolden path\b": "say what is meant",
    r"\bplumbing\b|\bglue code\b": "say what it connects",
    r"\bhousekeeping\b": "say what is done",
    r"\bguest of the core\b": "say what it may touch",
    r"\bvanilla\b|\bout of the box\b": "say what comes with it",
}
"""What a reader from outside does not understand, or does not need; and what to do instead."""

_END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*`\[]*[A-Z0-9`])")
_WORD = re.compile(r"[^\W_]")
_LIST_OF_NAMES = re.compile(r"`code`(?:, `code`)+")
_VARIANT = re.compile(r"^\| ([^|`]+) \| ([^|]+) \|$", re.MULTILINE)
_VARIANTS_HEAD = "## Words that are not used here"


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


def long_sentences(markdown: str) -> list[str]:
    """Return the sentences that are too long. A list of names in code counts as one word."""
    return [sentence for sentence in sentences(markdown) if _words(sentence) >= TOO_LONG]


def _words(sentence: str) -> int:
    return sum(1 for word in _LIST_OF_NAMES.sub("`code`", sentence).split() if _WORD.search(word))


def wide_lines(markdown: str) -> list[str]:
    """Return the lines that are too wide. Tables, headings, code and lines that cannot be broken may be wide."""
    lines = markdown.splitlines()
    for token in MarkdownIt("commonmark").enable("table").parse(markdown):
        if token.map and token.type in ("fence", "code_block", "table_open", "heading_open", "html_block"):
            lines[token.map[0] : token.map[1]] = [""] * (token.map[1] - token.map[0])
    return [line for line in lines if len(line) > WIDTH and " " in line.strip()[:WIDTH]]


def glossary_variants(glossary: str) -> dict[str, str]:
    """Return the glossary's list of other words for its words: what to find, and the word to use."""
    _, _, table = glossary.partition(_VARIANTS_HEAD)
    rows = _VARIANT.findall(table.partition("\n## ")[0])[1:]
    return {
        rf"\b{re.escape(variant.strip())}s?\b": f"the glossary's word is {term.strip()!r}"
        for variants, term in rows
        for variant in variants.split(",")
    }


def wrong_words(markdown: str, wrong: Mapping[str, str]) -> list[str]:
    """Return which of the wrong words (patterns) stand there, each with what to do instead."""
    text = "\n".join(sentences(markdown))
    return [
        f"{match[0]!r}: {instead}" for pattern, instead in wrong.items() for match in re.finditer(pattern, text, re.I)
    ]


def judge(name: str, found: list[str], allowed: int, what: str) -> list[str]:
    """Return what is wrong with a file that may have so many of ``what``, one line each."""
    if len(found) > allowed:
        return [f"{name}: {len(found)} {what}, {allowed} are allowed:", *(f"    {entry}" for entry in found)]
    if len(found) < allowed:
        return [f"{name}: {len(found)} {what} are left, {allowed} are listed: --write lowers the number"]
    return []


Counts = dict[str, dict[str, int]]
Found = dict[str, tuple[str, dict[str, list[str]]]]


def search() -> Found:
    """Return all that is listed by number: by the table's name what it is, and the findings of each file."""
    long = f"sentences of {TOO_LONG} words or more"
    return {
        "long_sentences": (long, {name: long_sentences(text) for name, text in pages().items()}),
        "long_sentences_in_code": (long, {name: long_sentences(text) for name, text in code().items()}),
        "wide_lines": (
            f"lines of more than {WIDTH} characters",
            {name: wide_lines(text) for name, text in pages().items()},
        ),
    }


def write_baseline(found: Found, before: Counts) -> None:
    """Keep the counts, none higher than before. A table that is new starts with what is there."""
    kept: Counts = {}
    for table, (_, files) in found.items():
        counts = {name: len(entries) for name, entries in sorted(files.items())}
        known = before.get(table)
        lowered = {name: count if known is None else min(count, known.get(name, 0)) for name, count in counts.items()}
        kept[table] = {name: count for name, count in lowered.items() if count}
    head = "# SPDX-License-Identifier: MIT\n# What may stay for now, a number per file: python -m tests.docs.prose\n"
    BASELINE.write_text(head + tomli_w.dumps(kept), encoding="utf-8")


def main() -> int:
    """Check all texts, or lower what is allowed."""
    parser = argparse.ArgumentParser(prog="python -m tests.docs.prose", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--write", action="store_true", help="lower the numbers of prose.toml to what is there")
    options = parser.parse_args()
    before: Counts = read_toml(BASELINE) if BASELINE.is_file() else {}
    found = search()
    if options.write:
        write_baseline(found, before)
        before = read_toml(BASELINE)
    texts = {**pages(), **code()}
    variants = glossary_variants(texts[GLOSSARY])
    texts[GLOSSARY] = texts[GLOSSARY].partition(_VARIANTS_HEAD)[0]
    wrong = [
        f"{name}: {word}" for name, text in texts.items() for word in wrong_words(text, {**INSIDE_WORDS, **variants})
    ]
    for table, (what, files) in found.items():
        listed = before.get(table, {})
        wrong += [line for name, entries in files.items() for line in judge(name, entries, listed.get(name, 0), what)]
        wrong += [f"{name}: is listed in {BASELINE.name} and is not there" for name in listed if name not in files]
    left = ", ".join(f"{sum(before.get(table, {}).values())} {table}" for table in found).replace("_", " ")
    print("\n".join(wrong) or f"{len(texts)} files; left to mend: {left}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
