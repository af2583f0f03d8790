# SPDX-License-Identifier: MIT
"""Can people read the pages? ``python -m tests.docs.prose [--write]``, part of ``make lint``.

Looks at README, CONTRIBUTING and docs: sentences of 25 words or more, and words that only insiders use. What was there
before the check is listed in prose.toml, as a number per page. The numbers can only shrink: more is an error, and so
is a number that is higher than what is there. ``--write`` lowers them; it never raises one.
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

ROOT = Path(__file__).resolve().parents[2]
BASELINE = Path(__file__).with_name("prose.toml")
TOO_LONG = 25
"""Words from which on a sentence is too long."""
GENERATED = ("docs/reference/generated/", "docs/report/results.md")
INSIDE_WORDS: Mapping[str, str] = {
    r"\bsimply\b|\bobviously\b|\btrivially\b|\bof course\b": "leave it out",
    r"\bheals?\b|\bhealed\b": "reinitialise",
    r"\bfoot-?gun\b": "say what goes wrong",
    r"\bbikeshed": "say what was discussed",
    r"\bTODO\b|\bFIXME\b|\bWIP\b": "do it, or open an issue",
    r"\bnitpick": "say what is checked",
}
"""What a reader from outside does not understand, or does not need; and what to do instead."""

_END = re.compile(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*`\[]*[A-Z0-9`])")
_WORD = re.compile(r"[^\W_]")
_LIST_OF_NAMES = re.compile(r"`code`(?:, `code`)+")


def pages() -> list[Path]:
    """Return the pages that people write."""
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [page for page in found if not page.relative_to(ROOT).as_posix().startswith(GENERATED)]


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


def inside_words(markdown: str) -> list[str]:
    """Return what only insiders say, each with what to do instead."""
    text = "\n".join(sentences(markdown))
    return [
        f"{match[0]!r}: {instead}"
        for pattern, instead in INSIDE_WORDS.items()
        for match in re.finditer(pattern, text, re.IGNORECASE)
    ]


def judge(name: str, markdown: str, allowed: int) -> list[str]:
    """Return what is wrong with a page that may have so many long sentences, one line each."""
    found = [f"{name}: {word}" for word in inside_words(markdown)]
    long = long_sentences(markdown)
    if len(long) > allowed:
        found.append(f"{name}: {len(long)} sentences of {TOO_LONG} words or more, {allowed} are allowed:")
        found += [f"    {sentence}" for sentence in long]
    elif len(long) < allowed:
        found.append(f"{name}: {len(long)} long sentences are left, {allowed} are listed: --write lowers the number")
    return found


def write_baseline(counts: Mapping[str, int], before: Mapping[str, int]) -> None:
    """Keep the counts, none higher than before."""
    known = {name: min(count, before.get(name, 0)) for name, count in counts.items()} if before else dict(counts)
    kept = {name: count for name, count in sorted(known.items()) if count}
    head = "# SPDX-License-Identifier: MIT\n# Long sentences that may stay for now: python -m tests.docs.prose\n"
    BASELINE.write_text(head + tomli_w.dumps({"long_sentences": kept}), encoding="utf-8")


def main() -> int:
    """Check the pages, or lower what is allowed."""
    parser = argparse.ArgumentParser(prog="python -m tests.docs.prose", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--write", action="store_true", help="lower the numbers of prose.toml to what is there")
    options = parser.parse_args()
    before = read_toml(BASELINE)["long_sentences"] if BASELINE.is_file() else {}
    texts = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in pages()}
    if options.write:
        write_baseline({name: len(long_sentences(text)) for name, text in texts.items()}, before)
        before = read_toml(BASELINE)["long_sentences"]
    gone = [f"{name}: is listed in {BASELINE.name} and is not there" for name in before if name not in texts]
    found = [line for name, text in texts.items() for line in judge(name, text, before.get(name, 0))]
    print("\n".join(found + gone) or f"{len(texts)} pages, {sum(before.values())} long sentences left to mend")
    return 1 if found or gone else 0


if __name__ == "__main__":
    sys.exit(main())
