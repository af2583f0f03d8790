# SPDX-License-Identifier: MIT
"""``omni robots show --params``: what another simulator, or the firmware itself, reads of a robot file."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

import omniwheel.robot
from omni.cli import app
from omniwheel.firmware_process import first_ready_line
from omniwheel.paths import firmware_path
from omniwheel.robots import read_robot


@pytest.mark.pc_only
def test_the_firmware_takes_the_lines_as_they_are(tmp_path: Path) -> None:
    printed = CliRunner().invoke(app, ["robots", "show", "--params", "four_wheel"])
    assert printed.exit_code == 0
    (tmp_path / "robot.params").write_text(printed.stdout, encoding="ascii")
    command = [str(firmware_path()), "--params", str(tmp_path / "robot.params"), "--link", "tcp:127.0.0.1:0"]
    with subprocess.Popen([*command, "--end-with-stdin"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        links = first_ready_line(process)
        assert links is not None
        with omniwheel.robot.connect(links[0]) as robot:
            values = dict(robot.parameters)
        process.kill()
    assert values == pytest.approx(read_robot("four_wheel").parameter_values(), rel=1e-6)


def test_the_same_as_json() -> None:
    printed = CliRunner().invoke(app, ["robots", "show", "--params", "three_wheel", "--json"])
    said = json.loads(printed.stdout)
    assert said["name"] == "three_wheel"
    assert said["parameters"] == pytest.approx(read_robot("three_wheel").parameter_values(), rel=1e-6)


def test_a_robot_that_is_not_there_is_told() -> None:
    printed = CliRunner().invoke(app, ["robots", "show", "--params", "three_weel"])
    assert printed.exit_code == 2
    assert "three_wheel" in printed.output
