# SPDX-License-Identifier: MIT
"""A full disk after minutes of driving: what was measured is told, and finished, before the error."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from typer.testing import CliRunner, Result

from omni.cli import app
from omniwheel import FirmwareProcess
from omniwheel.errors import OutputFileError
from omniwheel.robot import connect
from tests.faults.commands import CASES

FULL = "/dev/full"
TUNE = ("tune", "--set", "WS_P=6", "-e", "step", "--rounds", "2", "--plot", FULL)


@pytest.fixture
def url() -> Iterator[str]:
    if not Path(FULL).exists():
        pytest.skip(f"no {FULL} here")
    with FirmwareProcess("three_wheel") as firmware:
        yield firmware.urls[0]


def run(case: str, *words: str) -> Result:
    """Run a command whose robot has driven already."""
    with CASES[case].during():
        return CliRunner().invoke(app, list(words))


def full(*_: Any) -> None:
    raise OutputFileError("cannot write it: No space left on device")


def test_tune_tells_all_rounds_and_keeps_what_it_is_told_to_keep(url: str, tmp_path: Path) -> None:
    done = run("tune", *TUNE, "--keep", "--link", url, "--out", str(tmp_path))
    assert done.exit_code == 1
    assert f"error: cannot write {FULL}" in done.output
    assert "12.00" in done.output
    assert "kept: after" in done.output
    with connect(url) as robot:
        assert robot.parameters["WS_P"] == 6.0


def test_its_json_holds_the_figures_beside_the_error(url: str, tmp_path: Path) -> None:
    done = run("tune", *TUNE, "--revert", "--json", "--link", url, "--out", str(tmp_path))
    assert done.exit_code == 1
    told = json.loads(done.stdout)
    assert told["error"]["type"] == "OutputFileError"
    assert told["rounds"] == 2
    assert told["candidates"][0]["after"]["position_m"] == pytest.approx(0.012)
    assert FULL not in told["pictures"]


@pytest.mark.parametrize(
    ("line", "place", "told"),
    [
        ("autotune", "omniwheel.autotune.page.write_page", "WS_P 1 → 1"),
        ("experiment wheel-step", "omniwheel.experiments.folder.write_outcome", "measured"),
        ("experiment wheel-step", "omniwheel.drive_log.folder.DriveLog._finish", "measured"),
    ],
)
def test_so_do_the_other_commands_that_drive_and_measure(
    url: str, tmp_path: Path, line: str, place: str, told: str
) -> None:
    with patch(place, full):
        done = run(line.split()[0], *line.split(), "--out", str(tmp_path), "--link", url)
        as_json = run(line.split()[0], *line.split(), "--out", str(tmp_path), "--link", url, "--json")
    assert done.exit_code == as_json.exit_code == 1
    assert "No space left" in done.output
    assert told in done.output
    assert len(json.loads(as_json.stdout)) > 1
