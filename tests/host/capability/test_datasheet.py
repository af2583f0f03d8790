# SPDX-License-Identifier: MIT
"""Robot files from data-sheet numbers: the model gives the sheet's numbers back, by formula and in the world."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omni.cli import app
from omniwheel.capability import card, drive_model, problems, warnings
from omniwheel.datasheet import GearMotor, RobotAnswers, catalogue, find_motor, motor_model, write_designed_robot
from omniwheel.datasheet.units import length_m, torque_N_m
from omniwheel.errors import DataSheetError, RobotFileError
from omniwheel.robots import read_robot, robot_names

runner = CliRunner()
BODY = ["--wheel-diameter", "96mm", "--wheel-distance", "160mm", "--mass", "4"]


@given(
    voltage=st.floats(3.0, 48.0),
    speed=st.floats(1.0, 300.0),
    torque=st.floats(0.05, 20.0),
    idle_share=st.floats(0.005, 0.2),
    efficiency=st.floats(0.3, 1.0),
)
def test_the_model_meets_both_ends_of_the_torque_speed_line(
    voltage: float, speed: float, torque: float, idle_share: float, efficiency: float
) -> None:
    constant = voltage * (1.0 - idle_share) / speed
    stall_A = torque / (constant * efficiency)
    sheet = GearMotor(voltage, speed, torque, stall_A, idle_share * stall_A)
    m = motor_model(sheet)
    friction = m.viscous_N_m_s * speed + m.coulomb_N_m
    assert m.constant_N_m_A * (voltage - m.constant_N_m_A * speed) / m.resistance_ohm == pytest.approx(friction)
    assert m.constant_N_m_A * voltage / m.resistance_ohm - m.coulomb_N_m == pytest.approx(torque)


def test_without_currents_the_no_load_current_is_assumed() -> None:
    model = motor_model(GearMotor(12.0, 34.56, 1.373))
    assert model.idle_assumed
    assert model.constant_N_m_A == pytest.approx(12.0 * 0.96 / 34.56)


@pytest.mark.parametrize(
    ("sheet", "said"),
    [
        (GearMotor(12.0, 34.6, 14.0, 5.5, 0.2), "14 N m at stall is impossible"),
        (GearMotor(12.0, -1.0, 1.4), "no-load speed is -1"),
        (GearMotor(12.0, 34.6, 1.4, 5.5, 3.0), "below half of it"),
        (GearMotor(math.nan, 34.6, 1.4), "voltage is nan"),
    ],
)
def test_numbers_that_contradict_are_refused(sheet: GearMotor, said: str) -> None:
    with pytest.raises(DataSheetError, match=said):
        motor_model(sheet)


@pytest.mark.parametrize("name", list(catalogue()))
def test_a_motor_of_the_catalogue_turns_in_the_world_as_its_sheet_says(name: str, tmp_path: Path) -> None:
    motor = find_motor(name)
    path = write_designed_robot("mine", RobotAnswers(3, 0.096, 0.16, 4.0, motor), tmp_path)
    robot = read_robot(path)
    # Lifted: no weight on the wheels, so that only the motor's own friction holds them.
    world = World(
        world_config(robot, pose_sensor=NO_POSE_SENSOR, friction_coefficient=1e-9, battery_resistance_ohm=0.0)
    )
    world.drive_voltage([motor.voltage_V] * 3)
    world.step(2000)
    assert world.wheel_rad_s == pytest.approx([motor.no_load_rad_s] * 3, rel=0.01)


@pytest.mark.parametrize("wheels", [3, 4])
def test_a_designed_robot_passes_its_check_and_its_limits_can_be_reached(wheels: int, tmp_path: Path) -> None:
    answers = RobotAnswers(wheels, 0.096, 0.16, 4.0, find_motor("pololu_37d_30"), supply_V=11.1)
    model = drive_model(read_robot(write_designed_robot("mine", answers, tmp_path)))
    assert problems(model) == []
    assert warnings(model) == []
    shown = card(model)
    assert shown.value("speed_any") < shown.value("speed_motors")
    assert shown.value("speed_any") > 0.8 * shown.value("speed_motors")


def test_a_bridge_s_current_gives_the_limit_in_the_model_s_current(tmp_path: Path) -> None:
    """The limit's torque is that share of the sheet's stall torque which the bridge leaves of its stall current."""
    motor = find_motor("pololu_37d_30")
    assert motor.stall_current_A is not None
    robot = read_robot(write_designed_robot("mine", RobotAnswers(3, 0.096, 0.16, 4.0, motor, bridge_A=3.0), tmp_path))
    model = drive_model(robot)
    torque_N_m = model.limited_torque_N_m + model.coulomb_N_m
    whole_N_m = motor.stall_torque_N_m + model.coulomb_N_m
    assert torque_N_m == pytest.approx(0.9 * 3.0 / motor.stall_current_A * whole_N_m, rel=0.01)
    assert robot.simulation["bridge_trip_A"] == pytest.approx(model.current_limit_A / 0.9, rel=1e-4)
    assert card(model).value("current_limit") == model.current_limit_A
    assert warnings(model) == []


@pytest.mark.parametrize("bridge_A", [None, 9.0])
def test_a_bridge_that_never_chops_gives_no_limit(bridge_A: float | None, tmp_path: Path) -> None:
    answers = RobotAnswers(3, 0.096, 0.16, 4.0, find_motor("pololu_37d_30"), bridge_A=bridge_A)
    model = drive_model(read_robot(write_designed_robot("mine", answers, tmp_path)))
    assert model.current_limit_A == 0.0
    assert "current_limit" not in {row.key for row in card(model).rows}


@pytest.mark.parametrize("bridge_A", [0.0, -1.0, math.nan])
def test_a_bridge_s_current_that_cannot_be_is_refused(bridge_A: float, tmp_path: Path) -> None:
    answers = RobotAnswers(3, 0.096, 0.16, 4.0, find_motor("pololu_37d_30"), bridge_A=bridge_A)
    with pytest.raises(DataSheetError, match="above 0"):
        write_designed_robot("mine", answers, tmp_path)


def test_a_bridge_s_current_without_the_motor_s_is_refused(tmp_path: Path) -> None:
    motor = replace(find_motor("pololu_37d_30"), stall_current_A=None, no_load_current_A=None)
    with pytest.raises(DataSheetError, match="without --stall-current"):
        write_designed_robot("mine", RobotAnswers(3, 0.096, 0.16, 4.0, motor, bridge_A=2.0), tmp_path)
    assert not list(tmp_path.iterdir())


def test_limits_of_the_current_that_make_no_sense_are_warned_of(tmp_path: Path) -> None:
    model = drive_model(
        read_robot(
            write_designed_robot("mine", RobotAnswers(3, 0.096, 0.16, 4.0, find_motor("pololu_37d_30")), tmp_path)
        )
    )
    for limit_A, said in ((50.0, "never acts"), (0.05, "will not turn")):
        (told,) = [text for text in warnings(replace(model, current_limit_A=limit_A)) if text.startswith("LIM_I")]
        assert said in told
    watched = replace(model, continuous_A=0.5 * model.stall_current_A, heat_s=8.0)
    assert card(watched).value("hot") == pytest.approx(-8.0 * math.log(0.75))


def test_the_file_says_where_each_number_came_from(tmp_path: Path) -> None:
    path = write_designed_robot("mine", RobotAnswers(3, 0.096, 0.16, 4.0, find_motor("pololu_37d_30")), tmp_path)
    sections = path.read_text().split("\n\n")
    numbers = [line for part in sections for line in part.splitlines() if "=" in line and not line.startswith("#")]
    bare = [line for line in numbers if "#" not in line and "wiring" not in line]
    assert {line.split(" =")[0] for line in bare} <= {
        "name", "description", "in2_channel", "output_enable_pin", "i2c_speed_Hz",
    }  # fmt: skip
    assert "data sheet rev. 1.2" in path.read_text()


@pytest.mark.parametrize(
    ("text", "value"),
    [("14kg.cm", 1.372931), ("14 kgf·cm", 1.372931), ("190 oz-in", 1.341695), ("140 kg*mm", 1.372931)],
)
def test_torques_are_read_with_their_units(text: str, value: float) -> None:
    assert torque_N_m(text) == pytest.approx(value)


@pytest.mark.parametrize("text", ["", "fourteen", "14 stone", "1e", "1 2", "--", "mm"])
def test_what_is_no_quantity_is_refused(text: str) -> None:
    with pytest.raises(DataSheetError, match="is not"):
        torque_N_m(text)
    with pytest.raises(DataSheetError, match="is not"):
        length_m(text)


def run(tmp_path: Path, *words: str, answers: str = "") -> tuple[int, str]:
    result = runner.invoke(app, ["robots", "new", "mine", "--out", str(tmp_path), *words], input=answers)
    return (2 if isinstance(result.exception, RobotFileError) else result.exit_code), result.output + str(
        result.exception
    )


def test_new_takes_data_sheet_numbers(tmp_path: Path) -> None:
    numbers = "--no-load-rpm 330 --stall-torque 14kg.cm --stall-current 5.5 --voltage 12 --gear 30 --encoder 64CPR"
    code, output = run(tmp_path, *numbers.split(), *BODY, "--json")
    assert code == 0, output
    (warning,) = json.loads(output[: output.rindex("}") + 1])["warnings"]
    assert "5.5 A per motor" in warning
    assert read_robot(tmp_path / "mine.toml").parameter_values()["ENC_CPR"] == 1920


@pytest.mark.parametrize(("encoder", "counts"), [("64cpr", 1920), ("16 PPR", 1920), ("16lines", 1920), ("64PPR", 7680)])
def test_an_encoder_is_what_the_sheet_calls_it(tmp_path: Path, encoder: str, counts: int) -> None:
    numbers = "--no-load-rpm 330 --stall-torque 14kg.cm --voltage 12 --gear 30"
    code, output = run(tmp_path, *numbers.split(), "--encoder", encoder, *BODY, "--json")
    assert code == 0, output
    assert read_robot(tmp_path / "mine.toml").parameter_values()["ENC_CPR"] == counts
    assert ("--encoder 64CPR" in output) is (counts == 7680)


@pytest.mark.parametrize("words", [("--stall-torque", "14"), ("--encoder", "64")])
def test_a_number_without_its_unit_is_refused(tmp_path: Path, words: tuple[str, str]) -> None:
    numbers = {
        "--no-load-rpm": "330",
        "--voltage": "12",
        "--gear": "30",
        "--stall-torque": "14kg.cm",
        "--encoder": "64CPR",
    }
    numbers |= dict([words])
    code, output = run(tmp_path, *(word for pair in numbers.items() for word in pair), *BODY)
    assert code == 2, output
    assert "unit" in output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [("--from", name) for name in robot_names()] + [("--motor", "pololu_37d_30", *BODY)])
def test_comments_on_the_wires_hold_for_any_robot(tmp_path: Path, words: tuple[str, ...]) -> None:
    """A new file begins as a copy: what was done to another robot once is not true of this one."""
    code, output = run(tmp_path, *words)
    assert code == 0, output
    _, _, wiring = (tmp_path / "mine.toml").read_text(encoding="utf-8").partition("[wiring]")
    comments = re.findall(r"#(.*)", wiring.partition("\n[")[0])
    assert not [text for text in comments if re.search(r"\b(moved|first build|was|were|our|ours)\b", text)]


def test_new_asks_for_what_is_missing(tmp_path: Path) -> None:
    answers = "12\n330\n14kg.cm\n5.5\n\n30\n64CPR\n96mm\n160mm\n4\n"
    code, output = run(tmp_path, "--ask", answers=answers)
    assert code == 0, output
    assert read_robot(tmp_path / "mine.toml").wheels == 3


def test_a_bad_answer_is_asked_for_again(tmp_path: Path) -> None:
    answers = "twelve\n0\n12\n330\n14\n14kg.cm\n-1\n5.5\n\n30\n64\n64CPR\n96 miles\n96mm\n160mm\n4\n"
    code, output = run(tmp_path, "--ask", answers=answers)
    assert code == 0, output
    assert read_robot(tmp_path / "mine.toml").parameter_values()["ENC_CPR"] == 1920


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--motor", "pololu_37d_3"], "pololu_37d_30"),
        (["--motor", "pololu_37d_30"], "--wheel-diameter is missing"),
        (["--no-load-rpm", "330", *BODY], "--voltage is missing"),
        (["--motor", "pololu_37d_30", *BODY[:-1], "-4"], "mass"),
        (["--motor", "pololu_37d_30", "--from", "three_wheel"], "--from"),
    ],
)
def test_new_refuses_and_leaves_no_file(tmp_path: Path, words: list[str], said: str) -> None:
    code, output = run(tmp_path, *words)
    assert code == 2, output
    assert said in output
    assert list(tmp_path.iterdir()) == []


def answers(voltage_V: float, no_load_rad_s: float, lines: float) -> RobotAnswers:
    motor = GearMotor(voltage_V, no_load_rad_s, 0.5, encoder_lines=lines)
    return RobotAnswers(3, 0.08, 0.12, 2.0, motor)


def test_a_small_battery_is_not_taken_for_an_empty_one(tmp_path: Path) -> None:
    """The default of 9 V kept robots of 6 V from arming."""
    values = read_robot(write_designed_robot("small", answers(6.0, 40.0, 2500.0), tmp_path)).parameter_values()
    assert values["BAT_V_MIN"] == pytest.approx(4.5)
    assert values["SAFE_STALL_V"] == pytest.approx(2.0)


@pytest.mark.parametrize(("lines", "warned"), [(6.0, True), (2500.0, False)])
def test_a_robot_that_notices_a_blocked_wheel_late_is_told(lines: float, warned: bool, tmp_path: Path) -> None:
    model = drive_model(read_robot(write_designed_robot("coarse", answers(12.0, 10.0, lines), tmp_path)))
    assert any("A blocked wheel is noticed after" in warning for warning in warnings(model)) is warned
    assert (model.blocked_s > 0.4) is warned
