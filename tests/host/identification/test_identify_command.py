# SPDX-License-Identifier: MIT
"""``omni identify`` and the robot file it writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from omni.cli import app
from omniwheel.errors import RobotFileError
from omniwheel.robot_text import edited
from omniwheel.robots import read_robot

TEMPLATE = """[robot]
name = "mine"

[motor]   # a comment
constant_N_m_A = 1.05   # old
supply_V = 12.0

[simulation]
mass_kg = 3.5
"""


def omni(*arguments: object, code: int = 0) -> Any:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, result.output
    return json.loads(result.stdout) if "--json" in arguments else result


def test_a_file_is_edited_in_place() -> None:
    text = edited(
        TEMPLATE, {"motor.constant_N_m_A": (2.0, "given"), "simulation.inertia_kg_m2": (0.051234567, "found")}
    )
    assert "constant_N_m_A = 2.0  # given\n" in text
    assert "mass_kg = 3.5\ninertia_kg_m2 = 0.0512346  # found\n" in text
    assert "[motor]   # a comment" in text
    assert "supply_V = 12.0" in text
    with pytest.raises(RobotFileError, match=r"\[geometry\]"):
        edited(TEMPLATE, {"geometry.wheel_distance_m": (0.2, "found")})


@pytest.mark.full
def test_a_simulated_robot_becomes_a_robot_file(tmp_path: Path) -> None:
    told = omni("identify", "simulate", "--seed", 5, "--duration", 14, "--name", "mine", "--out", tmp_path, "--json")
    found = told["parameters"]
    assert len(found) == 15
    # Wheels creep under the drag of their rollers, and the rollers' loads change: neither is in the model.
    rollers = {"drag_xy_V_s", "dry_drag_V"}
    assert found["dry_drag_V"]["value"] == pytest.approx(found["dry_drag_V"]["truth"], rel=0.15)
    lengths = {name for name in found if name.startswith("wheel_")}
    for name in lengths:
        assert found[name]["value"] == pytest.approx(found[name]["truth"], rel=3e-3)
    others = set(found) - rollers - lengths
    assert sum(found[name]["inside"] for name in others) >= len(others) - 1
    assert told["validation"] > 0.99
    omni("robots", "check", told["file"])
    robot = read_robot(told["file"])
    constant = told["parameters"]["motor_constant_N_m_A"]
    assert robot.motor["constant_N_m_A"] == pytest.approx(constant["value"], rel=1e-5)
    assert robot.motor["constant_N_m_A"] == pytest.approx(constant["truth"], rel=0.15)
    assert robot.geometry["wheel_distance_m"] == pytest.approx(
        told["parameters"]["wheel_distance_m"]["truth"], rel=2e-3
    )
    assert len(robot.geometry["wheel_radius_scale"]) == 3
    again = omni("identify", "simulate", "--duration", 14, "--name", "mine", "--out", tmp_path, code=2)
    assert "exists already" in again.output


def test_bad_input_is_told_before_anything_moves(tmp_path: Path) -> None:
    assert "No such file" in omni("identify", "telemetry", tmp_path / "absent.tlog", code=2).output
    omni("identify", "telemetry", tmp_path / "absent.tlog", "--robot", "nobody", code=2)
    omni("identify", "simulate", "--duration", 1, code=2)
    omni("identify", "live", "--on-stand", "--link", "tcp:127.0.0.1:1", code=2)
    # No link is opened: an hour's drive must not be lost, nor replace what was kept.
    (tmp_path / "kept.tlog").write_bytes(b"kept")
    (tmp_path / "kept.toml").write_bytes(b"kept")
    link = ("--link", "tcp:127.0.0.1:1", "--out", tmp_path)
    assert "exists already" in omni("identify", "live", *link, "--log", tmp_path / "kept.tlog", code=2).output
    assert "exists already" in omni("identify", "live", *link, "--name", "kept", code=2).output
    assert "is not a valid robot name" in omni("identify", "live", *link, "--name", "Not a name", code=2).output
    assert "cannot write" in omni("identify", "simulate", "--out", tmp_path / "absent", code=2).output
    assert (tmp_path / "kept.tlog").read_bytes() == b"kept"


@pytest.mark.full
def test_a_live_robot_is_driven_and_identified(sitl: str, tmp_path: Path) -> None:
    """The world of `omni sitl` lets wheels slip by 0..10 %: motors feel a little less mass than the robot weighs."""
    log = tmp_path / "drive.tlog"
    given = ("--robot", "three_wheel", "--out", tmp_path, "--json")
    told = omni("identify", "live", "--link", sitl, "--duration", 6, "--log", log, "--name", "live", *given)
    found = {name: entry["value"] for name, entry in told["parameters"].items()}
    motor = read_robot("three_wheel").motor
    gain = motor["constant_N_m_A"] + motor["resistance_ohm"] / motor["constant_N_m_A"]
    assert found["speed_gain_V_s"] == pytest.approx(gain, rel=2e-3)
    assert found["coulomb_V"] == pytest.approx(0.05 * motor["resistance_ohm"] / motor["constant_N_m_A"], rel=0.03)
    assert found["motor_inertia_kg_m2"] == pytest.approx(motor["inertia_kg_m2"], rel=0.1)
    again = omni("identify", "telemetry", log, "--name", "again", *given)
    assert again["parameters"] == told["parameters"]
