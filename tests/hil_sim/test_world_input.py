# SPDX-License-Identifier: MIT
"""What a robot file or a scenario asks of the simulated world that it does not have is refused in words."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil_sim.models.parts import KEYS
from hil_sim.world import SIMULATION_KEYS
from omni.cli import app
from omniwheel.robots import find_robot_file, parameter_table


def robot_file(folder: Path, *lines: str) -> str:
    """Return a copy of the three-wheeled robot's file with lines at the end of its section simulation."""
    path = folder / "mine.toml"
    plain = find_robot_file("three_wheel").read_text(encoding="utf-8")
    path.write_text(plain + "\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("roller_per_row = 9", "(did you mean rollers_per_row?)"),
        ("floor_slope_rad = 2.0", "simulation.floor_slope_rad"),
    ],
)
@pytest.mark.parametrize("command", ["run", "export"])
def test_a_misspelt_key_of_simulation_is_no_ideal_wheel(tmp_path: Path, line: str, words: str, command: str) -> None:
    file, out = robot_file(tmp_path, line), str(tmp_path / "out")
    arguments = {
        "run": ["run", "--core-only", "no_slip", "--robot", file, "--duration", "0.5", "--out", out],
        "export": ["robots", "export", file, f"{out}.urdf"],
    }
    result = CliRunner().invoke(app, arguments[command])
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml"]
    checked = CliRunner().invoke(app, ["robots", "check", file])
    assert words in " ".join(checked.output.split())


def test_every_key_that_the_models_read_may_be_in_a_robot_file() -> None:
    assert set(KEYS) <= SIMULATION_KEYS
    known = {parameter.robot_key for parameter in parameter_table().parameters}
    assert {
        str(key).removeprefix("simulation.") for key in known if str(key).startswith("simulation.")
    } <= SIMULATION_KEYS


@pytest.mark.parametrize("rollers", [1, 2])
def test_a_wheel_of_one_or_two_rollers_is_none(tmp_path: Path, rollers: int) -> None:
    arguments = [
        "run",
        "no_slip",
        "--core-only",
        "--set",
        f"world.rollers_per_row={rollers}",
        "--out",
        str(tmp_path / "out"),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code != 0
    assert "0 (ideal wheels) or 3 to 60" in " ".join(result.output.split())
    assert list(tmp_path.iterdir()) == []


def test_a_plant_without_patches_says_so(tmp_path: Path) -> None:
    scenario = tmp_path / "patched.toml"
    text = '[scenario]\nname = "patched"\ndescription = "ice"\nextends = "no_slip"\n'
    scenario.write_text(text + "\n[[patch]]\nx_m = [0.0, 1.0]\ny_m = [0.0, 1.0]\nfriction = 0.1\n", encoding="utf-8")
    result = CliRunner().invoke(
        app, ["run", "--core-only", str(scenario), "--plant", "slip", "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 2
    assert "[[patch]]" in " ".join(result.output.split())
    assert [path.name for path in tmp_path.iterdir()] == ["patched.toml"]
