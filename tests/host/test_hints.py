# SPDX-License-Identifier: MIT
"""What a newcomer mistypes first is answered with what to do, not with what the computer met."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni.cli.command_table import TABLE, load
from omni_schema.errors import did_you_mean
from tests.host.stepped import robot


def said_by(line: str) -> tuple[int, str]:
    """Return exit code and output of a command line, the output in one line."""
    result = CliRunner().invoke(app, line.split(), env={"COLUMNS": "200"})
    return result.exit_code, " ".join(result.output.split())


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("run nosuch", "hint: give one of these names, or a .toml file of your own; `omni run --list` describes"),
        ("plot nothing", "hint: give a .tlog or .mcap file or the folder of a run; `omni runs` lists them"),
        ("monitor", "`omni sitl` simulates one"),
        ("montor", "no such command: montor (did you mean monitor?)"),
        ("run --set FOO=1", "unknown parameter FOO hint: `omni robots show --params NAME` prints all"),
        ("run --set slip_max=0.1", "unknown parameter slip_max (did you mean world.slip_max?)"),
        ("run --set ISMC_LAMXY=8", "unknown parameter ISMC_LAMXY (did you mean ISMC_LAM_XY?)"),
        ("run --set LAM=8", "unknown parameter LAM (did you mean ISMC_LAM_XY or ISMC_LAM_TH?)"),
        ("sitl --robot fast", "unknown robot or file fast (did you mean fast_three_wheel?)"),
        ("params set LIM_V 0.1", "write the name, = and the value without spaces"),
        ("run --seed 99999999999999999999", "9223372036854775807"),
    ],
)
def test_the_hint_says_what_to_type_next(typed: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omniwheel.ports.serial_ports", list)
    monkeypatch.delenv("OMNI_LINK", raising=False)
    code, output = said_by(typed)
    assert code == 2
    assert said in output
    assert "Errno" not in output


def test_a_list_of_parameters_that_would_be_empty_is_an_error() -> None:
    with robot():
        code, output = said_by("params list LIMV")
    assert code == 2
    assert "no parameter's name contains LIMV (did you mean LIM_V?)" in output


KNOWN = ("LIM_V", "ISMC_LAM_XY", "ISMC_LAM_TH", "P_LAM_XY_OF_WHEEL", "P_LAM_TH_OF_WHEEL")


@pytest.mark.parametrize(
    ("name", "guess"),
    [
        ("LIMV", " (did you mean LIM_V?)"),
        ("lam", " (did you mean ISMC_LAM_XY, ISMC_LAM_TH or P_LAM_XY_OF_WHEEL?)"),
        ("LI", ""),
        ("zzz", ""),
    ],
)
def test_near_names_come_before_names_that_contain_the_word(name: str, guess: str) -> None:
    assert did_you_mean(name, KNOWN) == guess


def pages(command: Any, words: list[str]) -> Iterator[list[str]]:
    """Yield the words of a command and of each one below it."""
    yield words
    for name, inner in getattr(command, "commands", {}).items():
        yield from pages(inner, [*words, name])


@pytest.mark.parametrize("entry", TABLE, ids=lambda entry: entry.name)
def test_no_help_page_shows_a_range_that_nobody_can_read(entry: Any) -> None:
    """Nor a default: what has no limit says so."""
    for words in pages(load(entry), [entry.name]):
        output = said_by(" ".join([*words, "--help"]))[1]
        assert not re.search(r"\d{8}|\de\+\d|\[default: inf\]", output), words


@pytest.mark.full
def test_the_list_of_scenarios_tells_which_robot_drives() -> None:
    code, output = said_by("run --list")
    assert code == 0
    assert "demo three_wheel Eight-petal rose" in output
    assert "fast fast_three_wheel A fast robot" in output


def test_help_tells_a_simpler_model_from_another_simulator() -> None:
    output = said_by("run --help")[1]
    assert "Model of motors, body and floor" in output
    assert "External simulator" in output
