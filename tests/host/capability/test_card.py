# SPDX-License-Identifier: MIT
"""The capability card against the simulated world, which is written from contact forces and knows no card."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from hil_sim.world import IDEAL_WHEELS, NO_POSE_SENSOR, World, world_config
from omni.cli import app
from omniwheel.capability import card, drive_model, problems, sensor_warnings, warnings
from omniwheel.capability.drive_model import Array
from omniwheel.capability.observability import FIXES, FLOW, FLOW_TURN, GYRO, slip_rank, slip_words
from omniwheel.capability.speeds import TURNING, acceleration_bounds, direction, motor_speed, top_speed
from omniwheel.errors import RobotFileError
from omniwheel.robots import read_robot

ROBOTS = ("three_wheel", "four_wheel")
SETTLED_TICKS = 3000
runner = CliRunner()


def world_of(name: str, **overrides: Any) -> World:
    """The robot on ideal wheels, without sag: the card computes with constant loads and lever arms."""
    numbers = {"battery_resistance_ohm": 0.0, **IDEAL_WHEELS, **overrides}
    return World(world_config(read_robot(name), pose_sensor=NO_POSE_SENSOR, **numbers))


def signs(name: str, along: Array) -> Array:
    found: Array = np.sign(np.round(drive_model(read_robot(name)).rows @ along, 9))
    return found


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("motion", ["forward", "turning"])
def test_top_speed_by_the_motors_is_the_worlds_at_full_voltage(name: str, motion: str) -> None:
    along = direction(0.0) if motion == "forward" else TURNING
    model, world = drive_model(read_robot(name)), world_of(name)
    world.drive_voltage(model.supply_V * signs(name, along))
    world.step(SETTLED_TICKS)
    speed = math.hypot(*world.twist[:2]) if motion == "forward" else world.twist[2]
    assert speed == pytest.approx(motor_speed(model, along), rel=0.01)


def test_real_wheels_turn_a_little_slower_than_the_card_says() -> None:
    """Rows of rollers rub where the lever arm jumps; nothing of that is in the card. Translation loses less."""
    real = dict.fromkeys(IDEAL_WHEELS)
    for name in ROBOTS:
        simulation = read_robot(name).simulation
        model, world = drive_model(read_robot(name)), world_of(name, **{key: simulation[key] for key in real})
        world.drive_voltage(model.supply_V * signs(name, TURNING))
        world.step(SETTLED_TICKS)
        assert 0.95 * motor_speed(model, TURNING) < world.twist[2] < 0.99 * motor_speed(model, TURNING)


SEEN = [
    ("three_wheel", (), 0, "no slip"),
    ("three_wheel", (GYRO,), 1, "one combination of the three wheels' slips"),
    ("three_wheel", (FLOW,), 2, "two combinations of the three wheels' slips"),
    ("three_wheel", (FLOW_TURN,), 3, "each wheel's slip"),
    ("three_wheel", (GYRO, FLOW), 3, "each wheel's slip"),
    ("four_wheel", (), 1, "one combination of the four wheels' slips"),
    ("four_wheel", (GYRO,), 2, "two combinations of the four wheels' slips"),
    ("four_wheel", (FLOW,), 3, "three combinations of the four wheels' slips"),
    ("four_wheel", (FIXES,), 4, "each wheel's slip"),
]


@pytest.mark.parametrize(("name", "sensors", "rank", "words"), SEEN)
def test_what_sensors_see_of_slip_is_what_the_kinematics_say(
    name: str, sensors: tuple[str, ...], rank: int, words: str
) -> None:
    """Here by the change of what is measured, with each slip ratio a little more, at a random motion."""
    model = drive_model(read_robot(name))
    rolled = np.random.default_rng(4).uniform(0.5, 1.0, model.wheels)

    def measured(slip: Array) -> Array:
        moved = rolled * (1.0 - slip)
        body, *_ = np.linalg.lstsq(model.rows, moved, rcond=None)
        told = {GYRO: body[2:], FLOW: body[:2], FLOW_TURN: body, FIXES: body}
        return np.concatenate([moved - model.rows @ body, *(told[sensor] for sensor in sensors)])

    still = measured(np.zeros(model.wheels))
    changes = np.array([measured(np.eye(model.wheels)[wheel]) - still for wheel in range(model.wheels)])
    assert np.linalg.matrix_rank(changes, tol=1e-9) == rank == slip_rank(model, sensors)
    assert slip_words(model, sensors) == words


@pytest.mark.parametrize("name", ROBOTS)
def test_the_card_says_what_each_sensor_adds(name: str) -> None:
    without = drive_model(read_robot(name))
    said = card(dataclasses.replace(without, gyro=True)).sensors
    assert [line for line in said if line not in card(without).sensors] == [said[1]]
    assert slip_words(without, (GYRO,)) in said[1]
    both = card(dataclasses.replace(without, gyro=True, flow_axes=2)).sensors
    assert slip_words(without, (GYRO, FLOW)) in both[3]


@pytest.mark.parametrize("axes", [2, 3])
def test_with_floor_motion_it_says_what_that_is_good_for(axes: int) -> None:
    without = drive_model(read_robot("three_wheel"))
    said = card(dataclasses.replace(without, flow_axes=axes)).sensors
    assert [line for line in said if line not in card(without).sensors] == [said[1]]
    assert ("and the turn" in said[1]) == (axes == 3)
    assert ("each wheel's slip" in said[1]) == (axes == 3)


@pytest.mark.parametrize(
    ("section", "parameters", "words"),
    [
        ("x_wheel_mm = 60.0\ny_wheel_mm = -45.0", "", []),
        ("x_wheel_mm = 60.0\ny_wheel_mm = -45.0", "\n[parameters]\nFLOW_X = 0.05", ["leave FLOW_X and FLOW_Y at 0"]),
        ("x_wheel_mm = 0.06", "", ["is in millimetres", "y_wheel_mm is 0"]),
    ],
    ids=["fine", "a place", "metres"],
)
def test_a_pinpoint_that_is_hardly_meant_so_is_warned_of(
    tmp_path: Path, section: str, parameters: str, words: list[str]
) -> None:
    """And the file is fine: the command that checks it prints them."""
    text = Path(read_robot("three_wheel").source).read_text().replace("[parameters]", parameters or "[parameters]")
    path = tmp_path / "mine.toml"
    path.write_text(f'{text}\n[flow]\nchip = "Pinpoint"\nsteps_per_mm = 13.263\n{section}\n')
    found = sensor_warnings(read_robot(str(path)))
    assert len(found) == len(words)
    for warning, word in zip(found, words, strict=True):
        assert word in warning


def gained(name: str, torque_N_m: float, **overrides: float) -> float:
    """Return the world's forward acceleration [m/s^2] with these torques, from 20 to 40 ms after rest."""
    world = world_of(name, roller_friction_N_s_m=0.0, motor_coulomb_N_m=0.0, motor_viscous_N_m_s=0.0, **overrides)
    world.drive_torque(torque_N_m * signs(name, direction(0.0)))
    world.step(20)
    before = world.twist[0]
    world.step(20)
    return float(world.twist[0] - before) / 0.02


@pytest.mark.parametrize("name", ROBOTS)
def test_acceleration_by_grip_is_what_the_floor_holds(name: str) -> None:
    grip = {bound.cause: bound.value for bound in acceleration_bounds(drive_model(read_robot(name)), direction(0.0))}
    assert gained(name, 20.0) == pytest.approx(grip["grip"], rel=0.01)


@pytest.mark.parametrize("name", ROBOTS)
def test_acceleration_by_the_motors_moves_mass_and_wheels(name: str) -> None:
    free = dataclasses.replace(drive_model(read_robot(name)), coulomb_N_m=0.0)
    motors = {bound.cause: bound.value for bound in acceleration_bounds(free, direction(0.0))}["motors"]
    reached = gained(name, free.stall_torque_N_m, friction_coefficient=1e3, slip_stiffness_N_s_m=1e6)
    assert reached == pytest.approx(motors, rel=0.02)


def test_three_wheels_are_fastest_forward_and_slowest_sideways() -> None:
    model = drive_model(read_robot("three_wheel"))
    forward, sideways = top_speed(model, 0.0).value, top_speed(model, math.pi / 2).value
    assert sideways == pytest.approx(3.0 * 0.0508)  # LIM_WHEEL times the radius: one wheel points that way
    assert forward == pytest.approx(sideways / math.cos(math.pi / 6))


@pytest.mark.parametrize("name", ROBOTS)
def test_a_shipped_robot_has_no_problem_and_its_kinematics_are_even(name: str) -> None:
    model = drive_model(read_robot(name))
    assert problems(model) == []
    assert card(model).value("condition") == pytest.approx(math.sqrt(2.0))


def edited_robot(tmp_path: Path, old: str, new: str) -> str:
    text = Path(read_robot("three_wheel").source).read_text()
    assert text.count(old) == 1
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new))
    return str(path)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("[0.0, 120.0, 240.0]", "[90.0, 90.0, 90.0]", "wheel_angle_deg"),
        ("[0.0, 120.0, 240.0]", "[0.0, 1.0, 2.0]", "wheel_angle_deg"),
        ("constant_N_m_A = 1.05", "constant_N_m_A = 33.0", "constant_N_m_A"),
        ("resistance_ohm = 2.7", "resistance_ohm = 0.027", "resistance_ohm"),
    ],
)
def test_check_fails_an_absurd_robot_and_names_the_key(tmp_path: Path, old: str, new: str, named: str) -> None:
    result = runner.invoke(app, ["robots", "check", edited_robot(tmp_path, old, new)], env={"COLUMNS": "400"})
    assert isinstance(result.exception, RobotFileError) or result.exit_code == 2
    assert named in (str(result.exception) + result.output)


def test_an_inherited_limit_is_said(tmp_path: Path) -> None:
    fast = edited_robot(tmp_path, "viscous_friction_N_m_s = 1.0", "viscous_friction_N_m_s = 0.001")
    said = " ".join(warnings(drive_model(read_robot(fast))))
    assert "LIM_WHEEL = 3 holds the robot at 0.176 m/s forward" in said
    assert "could 0.6" in said


def test_check_shows_the_card_and_draws_it(tmp_path: Path) -> None:
    picture = tmp_path / "speeds.png"
    result = runner.invoke(app, ["robots", "check", "three_wheel", "--plot", str(picture), "--json"])
    assert result.exit_code == 0, result.output
    shown = json.loads(result.stdout)
    assert shown["card"]["speed_any"]["limited_by"] == "LIM_WHEEL"
    assert len(shown["speed_by_direction"]) == 72
    assert picture.read_bytes().startswith(b"\x89PNG")
