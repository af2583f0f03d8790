# SPDX-License-Identifier: MIT
"""The commands that the pages show: each command exists, and each option of its line is one of its options."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from omni import checks
from omni.cli import app
from tests.docs.prose import pages

ROOT: Any = typer.main.get_command(app)
CHECKS: Any = typer.main.get_command(checks.app)
SOURCES = Path(__file__).resolve().parents[2]
_CODE = re.compile(r"```[a-z]*\n(.*?)```|`([^`\n]+)`", re.DOTALL)
_PROMPT = re.compile(r"^\s*(?:\$ )?(?:\.venv/bin/)?((?:omni|python -m omni\.checks) .*)$")
_OPTION = re.compile(r"(--?[a-zA-Z][\w-]*)(?:=.*)?$")


def command_lines(markdown: str) -> Iterator[str]:
    """Return the lines of a page that begin with ``omni``, in blocks and within sentences, without remarks."""
    for block, span in _CODE.findall(markdown):
        text = (block or span).replace("\\\n", " ")
        for line in text.splitlines():
            found = _PROMPT.match(line)
            if found:
                yield re.split(r"\s+(?:#|[|&;>]|2>)", found[1])[0].strip()


def wrong(line: str) -> list[str]:
    """Return what does not exist of a line: its command, or options. ``drive --host-control`` stands for a command."""
    words = shlex.split(line.replace("...", " ").replace("drive --host-control", "host-control"))
    command, words = (ROOT, words[1:]) if words[0] == "omni" else (CHECKS, words[3:])
    context = command.make_context("omni", [], resilient_parsing=True)
    while hasattr(command, "list_commands") and words and not words[0].startswith("-"):
        if words[0] in ("COMMAND", "NAME", "…"):
            return []
        inner = command.get_command(context, words[0])
        if inner is None:
            return [f"no command {words[0]}"]
        command, words = inner, words[1:]
        context = command.make_context(command.name, [], resilient_parsing=True)
    known = {name for each in (command, ROOT) for found in each.params for name in (*found.opts, *found.secondary_opts)}
    given = (_OPTION.match(word) for word in words if word != "--")
    return [f"no option {found[1]}" for found in given if found and found[1] not in known | {"--help"}]


PAGES = [name for name, text in pages().items() if name != "CHANGELOG.md" and list(command_lines(text))]
"""The pages that show commands. The changelog tells of old ones, too."""


@pytest.mark.parametrize("name", PAGES)
def test_the_commands_of_a_page_exist(name: str) -> None:
    found = {line: wrong(line) for line in command_lines(pages()[name])}
    assert {line: reasons for line, reasons in found.items() if reasons} == {}


def test_the_options_that_pages_name_alone_exist() -> None:
    """An option within a sentence may be one of any program here."""
    code = "\n".join(
        path.read_text(encoding="utf-8")
        for folder in ("host", "hil_sim", "omni_reproduce", "bench", "tests", "firmware", ".ci")
        for path in sorted((SOURCES / folder).rglob("*"))
        if path.is_file() and path != Path(__file__) and (path.suffix in {".py", ".cpp", ".c"} or folder == ".ci")
    )
    known = set(re.findall(r"--[a-z][\w-]*", code)) | {"--help"}
    named = {(name, option) for name, text in pages().items() for option in re.findall(r"`(--[a-z][\w-]*)[^`]*`", text)}
    assert len(named) > 60
    assert {(name, option) for name, option in named if option not in known} == set()


def test_an_option_that_does_not_exist_is_found() -> None:
    assert wrong("omni params list --lnog") == ["no option --lnog"]
    assert wrong("omni drvie") == ["no command drvie"]
    assert wrong("omni drive velocity -0.1 0 0 --duration 2") == []
    assert list(command_lines("`omni stop`, then\n\n```\n$ omni monitor  # watch\nomni: no\n```\n")) == [
        "omni stop",
        "omni monitor",
    ]
