# SPDX-License-Identifier: MIT
"""The front of the command line: groups, quick help, completion, negative numbers, and examples that can be typed."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from omniwheel.cli import app
from omniwheel.cli.command_table import TABLE
from omniwheel.cli.negative_numbers import _arguments_last

ROOT_COMMAND: Any = typer.main.get_command(app)
HEAVY = {"numpy", "pymavlink", "matplotlib", "scipy", "serial", "hil_sim", "omni_reproduce", "optuna", "unicorn"}
"""Packages that take long to import. Help and completion need none of them."""
NAMES = [entry.name for entry in TABLE]


def commands(command: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield every command and group with the words that lead to it."""
    yield words, command
    if hasattr(command, "list_commands"):
        context = command.make_context("omni", [], resilient_parsing=True)
        for name in command.list_commands(context):
            found = command.get_command(context, name)
            if not found.hidden:
                yield from commands(found, (*words, name))


ALL = list(commands(ROOT_COMMAND))


def examples() -> list[str]:
    """Return the lines that begin with ``omni`` in the examples of all commands."""
    found = []
    for _, command in ALL:
        plain = re.sub(r"(?<!\\)\[/?[a-z]*\]", "", command.epilog or "").replace("\\[", "[")
        found += [line.strip() for line in plain.splitlines() if line.strip().startswith("omni ")]
    return found


def imported_by(*words: str, **environment: str) -> tuple[set[str], str]:
    """Return the packages that a command line imports, and what it prints."""
    program = (
        "import sys, atexit\n"
        "atexit.register(lambda: print('\\n@', *{name.split('.')[0] for name in sys.modules}, file=sys.stderr))\n"
        f"sys.argv = ['omni', *{list(words)!r}]\n"
        "from omniwheel.cli import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env={**os.environ, **environment}
    )
    return set(done.stderr.rsplit("@", 1)[-1].split()), done.stdout


def completed(line: str) -> list[str]:
    """Return what the Tab key offers at the end of a line in bash."""
    words = line.split(" ")
    environment = {"_OMNI_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    imported, output = imported_by(**environment)
    assert "matplotlib" not in imported
    return output.split()


def test_the_help_page_names_every_command_in_its_group() -> None:
    text = CliRunner().invoke(app, ["--help"], env={"COLUMNS": "80"}).output
    panels = re.split(r"╭─ (.+?) ─+╮", text)
    shown = dict(zip(panels[1::2], panels[2::2], strict=True))
    for entry in TABLE:
        assert re.search(rf"^│ {re.escape(entry.name)} ", shown[entry.group], re.MULTILINE), entry


@pytest.mark.parametrize("words", [["--help"], ["--version"], []])
def test_help_and_version_import_nothing_heavy(words: list[str]) -> None:
    imported, output = imported_by(*words)
    assert output
    assert "omniwheel" in imported
    assert not imported & HEAVY


def test_completing_a_command_imports_nothing_heavy() -> None:
    environment = {"_OMNI_COMPLETE": "complete_bash", "COMP_WORDS": "omni mon", "COMP_CWORD": "1"}
    imported, output = imported_by(**environment)
    assert sorted(output.split()) == ["monitor", "montecarlo"]
    assert not imported & HEAVY


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("omni che", ["check-image"]),
        ("omni params get ISMC_LAM", ["ISMC_LAM_TH", "ISMC_LAM_XY"]),
        ("omni params set ISMC_LAM_X", ["ISMC_LAM_XY="]),
        ("omni params set CTL_MODE=i", ["CTL_MODE=ismc"]),
        ("omni robots check three", ["three_wheel"]),
        ("omni sim dem", ["demo"]),
        ("omni drive trajectory cir", ["circle"]),
        ("omni sim demo --preset report_t", ["report_torque"]),
        ("omni monitor --link tcp", ["tcp:127.0.0.1:5760"]),
    ],
)
def test_the_tab_key_offers_what_begins_so(line: str, offered: list[str]) -> None:
    assert sorted(completed(line)) == offered


@pytest.mark.parametrize("words", [words for words, _ in ALL], ids=lambda words: " ".join(("omni", *words)))
def test_every_help_page_fits_80_columns_and_says_what_the_command_does(words: tuple[str, ...]) -> None:
    result = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "80"})
    assert result.exit_code == 0, result.output
    assert max(len(line) for line in result.output.splitlines()) <= 80
    assert len(result.output.split("Options")[0].split()) > 5


@pytest.mark.parametrize("line", examples())
def test_every_example_of_a_help_page_can_be_typed(line: str) -> None:
    """Each is parsed to its end: commands, options and types. What it does is the matter of other tests."""
    words = shlex.split(line.split(" | ")[0].split("  #")[0])[1:]
    command, context = ROOT_COMMAND, ROOT_COMMAND.make_context("omni", list(words))
    while hasattr(command, "resolve_command") and (rest := [*context._protected_args, *context.args]):
        name, command, left = command.resolve_command(context, rest)
        context = command.make_context(name, left, parent=context)
    assert not hasattr(command, "resolve_command") or command.invoke_without_command


@given(st.lists(st.floats(-9, 9).map(lambda value: f"{value:.3f}"), min_size=1, max_size=4), st.randoms())
def test_numbers_stay_in_their_order_wherever_the_options_stand(numbers: list[str], draw: Any) -> None:
    groups = [[number] for number in numbers]
    options = [["--for", "-2"], ["--json"], ["-l", "tcp:x:1"], ["--start", "1", "-2", "3"], ["--world=-1"]]
    for option in options:
        groups.insert(draw.randint(0, len(groups)), option)
    words = [word for group in groups for word in group]
    found = _arguments_last(words, {"--for": 1, "--json": 0, "-l": 1, "--start": 3, "--world": 1})
    assert found[found.index("--") + 1 :] == numbers
    assert sorted(found[: found.index("--")]) == sorted(word for option in options for word in option)


@pytest.mark.parametrize(
    "words",
    [
        ["drive", "velocity", "-0.1", "0", "-.5", "--for", "1"],
        ["drive", "pose", "--for", "1", "-0.5", "0", "-1e-1"],
        ["drive", "duty", "-0.3", "0", "0"],
        ["drive", "velocity", "--", "-0.1", "0", "0"],
    ],
)
def test_negative_numbers_need_no_dashes_before_them(words: list[str]) -> None:
    """They get as far as the link, which is not there; as options they would be a usage error."""
    result = CliRunner().invoke(app, [*words[:2], "--link", "tcp:127.0.0.1:1", *words[2:]], env={"COLUMNS": "200"})
    assert result.exit_code == 1, result.output
    assert "tcp:127.0.0.1:1" in result.stderr


def test_an_unknown_option_is_still_an_error() -> None:
    result = CliRunner().invoke(app, ["drive", "velocity", "0", "0", "-0.1", "--fro", "2"])
    assert result.exit_code == 2
    assert "--fro" in result.stderr


SEVERAL_MEANINGS = {"--link", "--port", "--param", "--set"}
"""The robot's link or ports to offer; a serial or a TCP port; a range to search; omni host-control has -p for --set."""


def test_an_option_has_the_same_short_form_in_every_command() -> None:
    forms: dict[str, set[tuple[str, ...]]] = {}
    for _, command in ALL:
        for option in (p for p in command.params if p.param_type_name == "option"):
            short = tuple(name for name in option.opts if not name.startswith("--"))
            forms.setdefault(option.opts[0], set()).add(short)
    assert {name for name, shorts in forms.items() if len(shorts) > 1} <= SEVERAL_MEANINGS


def test_a_time_is_always_called_duration() -> None:
    for words, command in ALL:
        for option in command.params:
            if {"--for", "--seconds"} & set(option.opts):
                assert option.opts[0] == "--duration", words
