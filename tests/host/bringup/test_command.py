# SPDX-License-Identifier: MIT
"""The commands against a robot on a stand: output, reports, exit codes. What they judge is tested elsewhere."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omni.cli.bringup import Check
from omni.cli.bringup_person import TerminalPerson
from omniwheel.bringup import Finding, HandMotion, Result
from omniwheel.bringup.results_page import write_results
from omniwheel.robot import Robot
from tests.host.stepped import connect, robot

runner = CliRunner()


def run(*words: str, code: int = 0, answers: str = "") -> Any:
    result = runner.invoke(app, ["bringup", *words], input=answers, env={"COLUMNS": "300"})
    assert result.exit_code == code, (result.output, result.stderr, result.exception)
    return result


@pytest.fixture
def stand() -> Iterator[str]:
    """A robot that believes that its wires are right, on a stand."""
    with robot("stand", end_s=600.0) as url:
        yield url


def test_the_help_describes_every_check() -> None:
    text = run("--help").output
    assert [check.value for check in Check if check is not Check.ALL and f" {check.value}: " not in text] == []


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (["i2c", "--yes"], "--yes"),
        (["encoders", "--duty", "0.2"], "--duty"),
        (["motors", "--watch"], "--watch"),
        (["--duty", "0.2"], "--duty"),
        (["oe", "--duty", "0.5"], "--duty"),
        (["radio", "--robot", "four_wheel"], "--robot"),
    ],
)
def test_an_option_that_a_check_does_not_have_is_refused(words: list[str], option: str) -> None:
    assert option in run(*words, "--link", "tcp:127.0.0.1:1", code=2).stderr


def test_i2c_and_link_print_json_and_pass(stand: str) -> None:
    report = json.loads(run("i2c", "--json", "--link", stand).stdout)
    assert report["ok"]
    assert report["measured"]["addresses"] == [0x40]
    assert "PCA9685" in run("i2c", "--link", stand).stdout


def test_another_robot_file_fails_with_exit_code_1(stand: str) -> None:
    report = json.loads(run("link", "--robot", "four_wheel", "--json", "--link", stand, code=1).stdout)
    assert "WHEELS" in report["measured"]["differences"]


def test_nobody_at_the_terminal_moves_nothing(stand: str) -> None:
    with connect(stand) as robot:
        before = robot.version
    assert before
    assert "add --yes" in run("motors", "--link", stand, code=1).stderr
    assert "add --yes" not in run("button", "--link", stand, code=1).stderr, "that command has no such option"


def test_all_ends_at_the_first_failure_and_leaves_a_report(stand: str, tmp_path: Path) -> None:
    run("--robot", "four_wheel", "--yes", "--out", str(tmp_path), "--link", stand, code=1)
    report = json.loads((tmp_path / "bringup.json").read_text(encoding="utf-8"))
    assert [check["check"] for check in report["checks"]] == ["link"]
    assert not report["ok"]
    assert "# Bring-up of four_wheel" in (tmp_path / "bringup.md").read_text(encoding="utf-8")


def test_a_report_holds_every_finding_and_all_advice(tmp_path: Path) -> None:
    found = (Finding("bus", True, "free"), Finding("PCA9685", False, "nothing answers", "check the wires"))
    json_path, text_path = write_results([Result("i2c", found, {"loss": float("nan")})], tmp_path, "Bring-up")
    text = text_path.read_text(encoding="utf-8")
    assert "i2c: FAIL" in text
    assert "- check the wires" in text
    assert json.loads(json_path.read_text(encoding="utf-8"))["checks"][0]["measured"]["loss"] is None


@pytest.mark.parametrize(("simulated", "lines"), [(True, 2), (False, 1)])
def test_who_asks_for_a_hand_says_what_does_it_in_simulation(
    simulated: bool, lines: int, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = SimpleNamespace(status=SimpleNamespace(simulated=simulated))
    TerminalPerson(cast(Robot, robot)).move_by_hand(HandMotion.WHEEL, "Turn wheel 1 by hand")
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == lines
    assert ("omni sitl" in said[-1]) is simulated
