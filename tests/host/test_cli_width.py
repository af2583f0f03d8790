# SPDX-License-Identifier: MIT
"""Tables on a terminal of 80 columns: no line is wider, and names stay in one piece, however long they are.

The width of what every example of a help page prints is checked where the examples are run (test_cli_examples).
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni.cli.study_output import print_table
from omni_reproduce.registry import EXPERIMENTS
from omniwheel.presets import preset_names
from omniwheel.robots import parameter_table, robot_names
from tests.host.stepped import robot
from tests.quick_scenario import QUICK

LONG = "a-run-whose-name-says-everything-about-the-floor-and-the-weather"


def shown(*words: str) -> str:
    """Return what a command prints on a terminal of 80 columns."""
    result = CliRunner().invoke(app, list(words), env={"COLUMNS": "80"})
    assert result.exit_code in (0, 1), result.output
    return result.stdout


def check(text: str, names: Iterable[str]) -> None:
    """Fail if a line is too wide, a cell was cut, or a name is not there as it is."""
    assert max(map(len, text.splitlines())) <= 80
    words = set(text.replace("…", " … ").split())
    assert not set(names) - words


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("params list --presets", preset_names()),
        ("robots", robot_names()),
        ("reproduce --list", [entry.name for entry in EXPERIMENTS]),
    ],
)
def test_a_list_has_its_names_whole(line: str, names: list[str]) -> None:
    check(shown(*line.split()), names)


@pytest.mark.full
def test_parameters_take_one_or_two_lines_each() -> None:
    """Only enums with many values take more; what each parameter means is there with --long."""
    with robot():
        text = shown("params", "list")
    check(text, parameter_table())
    assert len(text.splitlines()) < 1.3 * len(parameter_table())
    with robot():
        long = shown("params", "list", "--long")
    check(long, parameter_table())
    assert parameter_table()["BAT_V_MIN"].doc in " ".join(long.split())


@pytest.mark.full
def test_runs_are_listed_and_compared_by_their_whole_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("quick.toml").write_text(QUICK, encoding="utf-8")
    CliRunner().invoke(app, ["run", "--core-only", "quick.toml"])
    run = next(Path("runs").iterdir())
    for name in (LONG, f"{LONG}-2"):
        shutil.copytree(run, Path("runs") / name)
    check(shown("runs"), [run.name, LONG, f"{LONG}-2"])
    check(shown("runs", LONG, f"{LONG}-2"), [LONG, f"{LONG}-2"])


def test_columns_of_a_study_that_do_not_fit_go_into_another_table(capsys: pytest.CaptureFixture[str]) -> None:
    headings = ("what", *(f"heading {number:02}" for number in range(12)))
    rows = [(f"row {row}", *(f"{row}.{number:07}" for number in range(12))) for row in range(3)]
    print_table("Title", headings, rows)
    text = capsys.readouterr().out
    check(text, [cell for row in rows for cell in row[1:]])
    assert text.count("row 1") == text.count("what") > 1
    assert text.count("Title") == 1


def test_what_a_row_is_about_stands_in_each_table(capsys: pytest.CaptureFixture[str]) -> None:
    headings = ("one", "two", *(f"heading {number:02}" for number in range(12)))
    print_table("Title", headings, [("1.5", "2.5", *("0.0" for _ in range(12)))], keys=2)
    text = capsys.readouterr().out
    check(text, ["1.5", "2.5"])
    assert text.count("1.5") == text.count("2.5") > 1
