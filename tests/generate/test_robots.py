# SPDX-License-Identifier: MIT
"""Robot files: the two that come with the project, and what a user's broken copy is told."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from omni_schema import SchemaError, load_parameters, load_robot, parse_robot
from omni_schema.toml_file import read_toml

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = sorted((ROOT / "shared" / "robots").glob("*.toml"))
TABLE = load_parameters(ROOT / "shared" / "params.toml")
THREE_WHEEL = read_toml(ROOT / "shared" / "robots" / "three_wheel.toml")


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_every_robot_of_the_project_loads(path: Path) -> None:
    robot = load_robot(path, TABLE)
    assert robot.name == path.stem
    assert list(robot.parameter_values()) == list(TABLE)
    for name, value in robot.parameter_values().items():
        assert TABLE[name].problem_with(value) is None
    assert len(robot.board.encoder_pins) == robot.wheels


def test_both_platforms_are_there() -> None:
    assert {"three_wheel", "four_wheel"} <= {path.stem for path in ROBOTS}


def test_the_file_sets_parameters_and_the_rest_keeps_its_default() -> None:
    document = copy.deepcopy(THREE_WHEEL)
    document["parameters"] = {"CTL_MODE": "pid", "LIM_WHEEL": 2.5}
    values = parse_robot(document, TABLE, "r.toml").parameter_values()
    assert [values[f"W{n}_ANGLE"] for n in (1, 2, 3)] == [0.0, 120.0, 240.0]
    assert values["CTL_MODE"] == TABLE["CTL_MODE"].values["pid"]
    assert values["LIM_WHEEL"] == 2.5
    assert values["SAFE_CMD_TO"] == TABLE["SAFE_CMD_TO"].default


def edit(section: str, key: str, value: object) -> Callable[[dict[str, Any]], None]:
    def apply(document: dict[str, Any]) -> None:
        document.setdefault(section, {})[key] = value

    return apply


@pytest.mark.parametrize(
    ("change", "key", "needle"),
    [
        (edit("geometry", "wheels", 5), "geometry.wheels", "from 3 to 4"),
        (edit("geometry", "wheels", "three"), "geometry.wheels", "3 to 4"),
        (edit("geometry", "wheel_radius", 0.05), "geometry.wheel_radius", "did you mean wheel_radius_m?"),
        (edit("geometry", "wheel_radius_m", -0.05), "geometry.wheel_radius_m", "-0.05"),
        (edit("geometry", "wheel_angle_deg", [0.0, 120.0]), "geometry.wheel_angle_deg", "list of 3"),
        (edit("geometry", "wheel_angle_deg", [0.0, 120.0, 900.0]), "geometry.wheel_angle_deg[2]", "-360 to 360 deg"),
        (edit("motor", "resistance_ohm", float("nan")), "motor.resistance_ohm", "finite"),
        (edit("wiring", "encoder_pins", [[3, 2], [7, 6], [5, 5]]), "wiring.encoder_pins[2]", "two different"),
        (edit("wiring", "encoder_pins", [[3, 2]]), "wiring.encoder_pins", "3 pairs"),
        (edit("parameters", "CTL_MOD", 1), "parameters.CTL_MOD", "did you mean CTL_MODE?"),
        (edit("parameters", "CTL_MODE", "ismk"), "parameters.CTL_MODE", "did you mean ismc?"),
        (edit("parameters", "WHEEL_RADIUS", 0.05), "parameters.WHEEL_RADIUS", "geometry.wheel_radius_m"),
        (edit("simulation", "mass_kg", "heavy"), "simulation.mass_kg", "from 0.05 to 1000 kg"),
        (edit("simulation", "friction_coefficient", "wet"), "simulation.friction_coefficient", "finite number"),
        (edit("parameters", "MASS", 3.0), "parameters.MASS", "simulation.mass_kg"),
        (edit("robot", "name", "My Robot"), "robot.name", "a-z 0-9 _"),
        (edit("robot", "colour", "red"), "robot.colour", "unknown key"),
        (edit("geometry", "LIM_V", 1.0), "geometry.LIM_V", "write it in the section [parameters]"),
        (lambda document: document.update(LIM_V=1.0), "LIM_V", "write it in the section [parameters]"),
        (edit("geometri", "wheels", 3), "geometri", "did you mean geometry?"),
    ],
)
def test_errors_name_file_key_and_what_is_allowed(
    change: Callable[[dict[str, Any]], None], key: str, needle: str
) -> None:
    document = copy.deepcopy(THREE_WHEEL)
    change(document)
    with pytest.raises(SchemaError) as caught:
        parse_robot(document, TABLE, "r.toml")
    assert caught.value.key == key
    assert needle in str(caught.value)


@pytest.mark.parametrize(
    ("value", "needle"),
    [
        ("9" * 400, "too large"),
        ("9" * 5000, "cannot be read"),
        ("0x" + "f" * 5000, "too large"),
        ("[" * 20 + "]" * 20, "deeper than 16"),
        ("[" * 5000 + "]" * 5000, "nested too deep"),
    ],
    ids=["integer beyond floats", "5000 digits", "huge hexadecimal", "deep list", "deeper than Python reads"],
)
def test_what_no_check_could_handle_is_refused_while_reading(tmp_path: Path, value: str, needle: str) -> None:
    path = tmp_path / "r.toml"
    path.write_text(f"[geometry]\nwheels = {value}\n")
    with pytest.raises(SchemaError, match=needle):
        load_robot(path, TABLE)


def test_keys_nested_without_end_are_refused_while_reading(tmp_path: Path) -> None:
    path = tmp_path / "r.toml"
    path.write_text(f"a{'.a' * 900} = 1\n")
    with pytest.raises(SchemaError, match="deeper than 16"):
        load_robot(path, TABLE)


@pytest.mark.parametrize(("section", "key"), [("robot", "name"), ("geometry", "wheels")])
def test_what_must_be_there_is_asked_for(section: str, key: str) -> None:
    document = copy.deepcopy(THREE_WHEEL)
    del document[section][key]
    with pytest.raises(SchemaError, match=rf"{section}\.{key}: is missing"):
        parse_robot(document, TABLE, "r.toml")


def test_a_section_that_is_no_table_is_refused() -> None:
    with pytest.raises(SchemaError, match="a table"):
        parse_robot({**THREE_WHEEL, "motor": 3}, TABLE, "r.toml")
