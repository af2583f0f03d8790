# SPDX-License-Identifier: MIT
"""What people type, and where the commands run: odd numbers, odd paths, no home, terminals without UTF-8."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni import cli
from omni.cli.common import parse_assignments
from omniwheel.errors import HistoryError, OutputPathError
from omniwheel.flashing.source import core_dir
from omniwheel.history import RobotHistory, history_file

NOWHERE = "tcp:127.0.0.1:9"
ODD_NUMBERS = ["2_8", "nan", "٢", "1__0", "1e_3"]


def run(*words: str, code: int = 0) -> Any:
    result = CliRunner().invoke(cli.app, list(words), env={"COLUMNS": "400"})
    assert result.exit_code == code, (result.output, result.exception)
    return result


@pytest.fixture
def no_home(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", fail)
    for name in ("OMNI_STATE_DIR", "XDG_STATE_HOME", "PLATFORMIO_CORE_DIR"):
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("number", ODD_NUMBERS)
def test_an_odd_number_is_no_argument(number: str) -> None:
    run("drive", "velocity", number, "0", "0", "--link", NOWHERE, code=2)
    assert number in run("drive", "velocity", "0", "0", "0", "--duration", number, "--link", NOWHERE, code=2).output


@pytest.mark.parametrize("number", ODD_NUMBERS)
def test_an_odd_number_is_no_parameter_value(number: str) -> None:
    assert parse_assignments([f"MOT_R={number}"]) == {"MOT_R": number}


@pytest.mark.parametrize(("text", "value"), [("-.5", -0.5), ("+1e-3", 1e-3), ("3.", 3.0), ("inf", float("inf"))])
def test_a_number_is_read(text: str, value: float) -> None:
    assert parse_assignments([f"MOT_R={text}"]) == {"MOT_R": value}


def test_degrees_beyond_a_turn_are_answered_in_degrees() -> None:
    result = run("drive", "pose", "0", "0", "370deg", "--link", NOWHERE, code=2)
    assert "10deg" in result.stderr


@pytest.mark.usefixtures("no_home")
def test_a_user_without_a_home_has_no_history_and_no_traceback() -> None:
    assert history_file(7, NOWHERE) is None
    with pytest.raises(HistoryError):
        RobotHistory(None).entries()
    with pytest.raises(OutputPathError):
        RobotHistory(None).append([{"session": "a"}])
    assert core_dir().name == ".platformio"


@pytest.mark.parametrize("encoding", ["ascii", "iso-8859-1"])
def test_a_character_that_the_terminal_lacks_ends_no_command(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    out = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    error = io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="strict")
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", error)
    monkeypatch.setattr(cli, "app", lambda: [print("a → b", file=stream, flush=True) for stream in (out, error)])
    cli.main()
    assert out.buffer.getvalue() == error.buffer.getvalue() == b"a ? b\n"


@pytest.fixture
def bracketed(tmp_path: Path) -> Path:
    """Return a folder of runs whose name looks like rich's markup, with one run in it."""
    folder = tmp_path / "[wheels]" / "x[/red]"
    (folder / "one").mkdir(parents=True)
    drive = {"asked": "pose", "controller": "", "began": "2026-01-01T00:00:00+00:00", "end": "done", "numbers": {}}
    (folder / "one" / "drive.json").write_text(json.dumps(drive), encoding="utf-8")
    return folder


@pytest.mark.parametrize("name", ["a/b", "", ".", ".."])
def test_a_run_cannot_be_named_so(name: str, bracketed: Path) -> None:
    assert repr(name) in run("runs", "one", "--rename", name, "--folder", str(bracketed), code=2).stderr
    assert (bracketed / "one").is_dir()


def test_brackets_in_a_path_are_shown_as_they_are(bracketed: Path) -> None:
    assert str(bracketed / "two") in run("runs", "one", "--rename", "two", "--folder", str(bracketed)).output
    assert str(bracketed / "two") in run("runs", "two", "--delete", "--yes", "--folder", str(bracketed)).output
    assert str(bracketed) in run("runs", "--folder", str(bracketed)).output
