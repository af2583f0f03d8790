# SPDX-License-Identifier: MIT
"""An option that commands share is declared once, and a name has no further meaning than those that are known."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from omni import checks
from omni.cli.command_table import TABLE, load
from tests.structure.options import declarations, declared_twice, meanings

MEANINGS = {
    "--budget": 2,
    "--duration": 11,
    "--for": 6,
    "--link": 4,
    "--log": 2,
    "--loss": 2,
    "--mass": 2,
    "--out": 8,
    "--param": 2,
    "--plot": 2,
    "--port": 2,
    "--radio": 2,
    "--robot": 7,
    "--seed": 2,
    "--set": 2,
    "--source": 2,
    "--store": 2,
    "--turn": 2,
    "--workers": 2,
    "--yes": 2,
}
"""Options that say different things in different commands, and how many. A number here may fall and never rise."""


def commands(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield what is no group, by the words one types."""
    subcommands = getattr(command, "commands", None)
    if subcommands is None:
        yield name, command
        return
    for word, subcommand in subcommands.items():
        yield from commands(subcommand, f"{name} {word}")


def test_no_option_is_declared_in_two_places() -> None:
    assert declared_twice() == []


def test_no_option_has_a_meaning_more() -> None:
    every = {name: command for entry in (*TABLE, *checks.TABLE) for name, command in commands(load(entry), entry.name)}
    found = {word: len(texts) for word, texts in meanings(every).items() if len(texts) > 1}
    assert found == MEANINGS


@pytest.mark.parametrize("said", ["'Seed of all.'", "f'Seed of {all}.'"])
def test_the_same_words_in_two_places_are_found(tmp_path: Path, said: str) -> None:
    for name in ("one.py", "two.py"):
        (tmp_path / name).write_text(f"import typer\nA = typer.Option('--seed', '-s', help={said})\n")
    (tmp_path / "three.py").write_text("import typer\nA = typer.Option('--seed', help='Seed of another thing.')\n")
    assert [place for _, _, place in declarations(tmp_path)] == ["one.py:2", "three.py:2", "two.py:2"]
    assert declared_twice(tmp_path) == ["--seed at one.py:2 and two.py:2"]


def every_command() -> dict[str, Any]:
    return {name: command for entry in (*TABLE, *checks.TABLE) for name, command in commands(load(entry), entry.name)}


def test_one_thing_has_one_name() -> None:
    """The main result goes to --out, a picture beside it to --plot, and a robot is at --link."""
    for name, command in every_command().items():
        for option in command.params:
            words, said = set(getattr(option, "opts", ())), getattr(option, "help", "") or ""
            assert not words & {"--report", "--minutes", "--param"} or name in ("sweep", "optimize"), name
            assert "--folder" not in words or name.split()[0] == "runs", name
            if "--plot" in words:
                assert option.metavar == "FILE.png", name
            if said.startswith(("The XBee", "Robot: /dev")):
                assert "--link" in words, name
