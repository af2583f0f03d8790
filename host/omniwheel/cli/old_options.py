# SPDX-License-Identifier: MIT
"""Options and keys by the names that they had until the latest release: options with a note on what to type instead."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from omniwheel.cli.command_table import OLD_OPTIONS, OldOption


def with_new_names(words: Sequence[str], say: Callable[[str], None]) -> list[str]:
    """Return a command line (without ``omni``) with old options under their new names; ``say`` gets a note on each.

    What stands behind ``--`` is no option and stays.
    """
    end = words.index("--") if "--" in words else len(words)
    line = list(words[:end])
    for entry in OLD_OPTIONS:
        path = entry.command.split()
        if line[: len(path)] == path and _replace(line, entry):
            say(f"{entry.old} of omni {entry.command} is now {entry.new}; the old name goes away with the next release")
    return [*line, *words[end:]]


def with_old_key(document: Mapping[str, Any], key: str, old: str = "report") -> dict[str, Any]:
    """Return a JSON document with the value of ``key`` under its old name, too. It goes with the next release."""
    return {**document, old: document[key]}


def _replace(line: list[str], entry: OldOption) -> bool:
    found = False
    for at, word in enumerate(line):
        name, joined, value = _parts(word, entry.old)
        if name != entry.old:
            continue
        found = True
        if joined:
            line[at] = f"{entry.new}={_scaled(value, entry.factor)}"
            continue
        line[at] = entry.new
        if at + 1 < len(line):
            line[at + 1] = _scaled(line[at + 1], entry.factor)
    return found


def _parts(word: str, old: str) -> tuple[str, bool, str]:
    """Split ``--old=value``, and ``-ovalue`` of a short option; the second tells whether a value is there."""
    if not old.startswith("--") and word.startswith(old) and not word.startswith("--"):
        return old, word != old, word[len(old) :]
    name, equals, value = word.partition("=")
    return name, bool(equals), value


def _scaled(value: str, factor: float) -> str:
    if factor == 1.0:
        return value
    try:
        return f"{float(value) * factor:.12g}"
    except ValueError:  # what is wrong with it is said of the new option
        return value
