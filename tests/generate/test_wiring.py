# SPDX-License-Identifier: MIT
"""Pins of a robot file: impossible ones are refused with words that help, and the header says what the file says."""

from __future__ import annotations

import copy
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omni_schema import Robot, SchemaError, load_parameters, load_robot, parse_robot, wiring_id
from omni_schema.toml_file import read_toml
from omni_schema.wiring import ANALOG_PINS, LAST_PIN, RESERVED_PINS
from wiring_header import wiring_header

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = ROOT / "shared" / "generate" / "generate.py"
TABLE = load_parameters(ROOT / "shared" / "params.toml")
PINS = [[10, 11], [14, 15], [22, 23]]
THREE_WHEEL = read_toml(ROOT / "shared" / "robots" / "three_wheel.toml")


def robot_with(**wiring: object) -> Robot:
    document: dict[str, Any] = copy.deepcopy(THREE_WHEEL)
    document["wiring"].update(wiring)
    return parse_robot(document, TABLE, "r.toml")


def robot_with_pins(**wiring: object) -> Robot:
    """Return a robot whose motors hang on the processor's pins; None: the key is left out."""
    document: dict[str, Any] = copy.deepcopy(THREE_WHEEL)
    section = document["wiring"]
    for channel in ("in1_channel", "in2_channel"):
        del section[channel]
    section.update({"motor_driver": "in1_in2", "motor_pins": PINS, **wiring})
    document["wiring"] = {key: value for key, value in section.items() if value is not None}
    return parse_robot(document, TABLE, "r.toml")


def constant(header: str, name: str) -> str:
    found = re.search(rf"\b{name}(?:\[[^=]*)? = ([^;]+);", header)
    assert found is not None
    return found.group(1)


@pytest.mark.parametrize(
    ("wiring", "key", "needle"),
    [
        ({"encoder_pins": [[3, 2], [7, 6], [5, 40]]}, "encoder_pins[2][1]", "from 0 to 39"),
        ({"encoder_pins": [[3, 2], [7, 6], [5, "A1"]]}, "encoder_pins[2][1]", "from 0 to 39"),
        ({"encoder_pins": [[3, 2], [7, 6], [5, True]]}, "encoder_pins[2][1]", "from 0 to 39"),
        ({"encoder_pins": [[3, 2], [7, 6], [5, 2]]}, "encoder_pins[2]", "pin 2 is used by the encoder of wheel 1"),
        ({"encoder_pins": [[3, 2], [7, 6], [5, 1]]}, "encoder_pins[2]", "the radio"),
        ({"encoder_pins": [[3, 2], [7, 6], [5, 18]]}, "encoder_pins[2]", "I2C (SDA)"),
        ({"encoder_pins": [[3, 2], [7, 6], [5, 13]]}, "light_pin", "pin 13 is used by the encoder of wheel 3"),
        ({"encoder_decoder": ["auto", "auto"]}, "encoder_decoder", "a list of 3"),
        ({"encoder_decoder": ["auto", "auto", "fpga"]}, "encoder_decoder[2]", "auto, hardware, interrupt"),
        ({"output_enable_pin": 7}, "output_enable_pin", "pin 7 is used by the encoder of wheel 2; move one"),
        ({"output_enable_pin": -1}, "output_enable_pin", "from 0 to 39"),
        ({"stop_button_pin": 9, "output_enable_pin": 9}, "stop_button_pin", "used by the motor driver's output enable"),
        ({"stop_button_pin": 2}, "stop_button_pin", "pin 2 is used by the encoder of wheel 1; move one"),
        ({"stop_button_pin": 1}, "stop_button_pin", "pin 1 is used by the radio"),
        ({"stop_button_pin": 19}, "stop_button_pin", "I2C (SCL)"),
        ({"stop_button_pin": 13}, "light_pin", "pin 13 is used by the stop button; move one"),
        ({"stop_button_pin": 14, "battery_pin": 14, "battery_divider": 5.7}, "battery_pin", "the stop button"),
        ({"stop_button_pin": 40}, "stop_button_pin", "from 0 to 39"),
        ({"stop_button_pin": "none"}, "stop_button_pin", "from 0 to 39"),
        ({"battery_pin": 8, "battery_divider": 5.7}, "battery_pin", "14 to 27"),
        ({"battery_pin": 14}, "battery_divider", "is missing"),
        ({"battery_divider": 5.7}, "battery_divider", "add the pin"),
        ({"battery_pin": 14, "battery_divider": 0.5}, "battery_divider", "from 1 to 100"),
        ({"battery_pin": 19, "battery_divider": 5.7}, "battery_pin", "I2C (SCL)"),
        ({"i2c_speed_Hz": 200000}, "i2c_speed_Hz", "100000, 400000, 1000000"),
        ({"i2c_speed_Hz": 400000.0}, "i2c_speed_Hz", "allowed are"),
        ({"oe_pin": 9}, "oe_pin", "unknown key"),
        ({"motor_driver": "l298"}, "motor_driver", "pca9685 (0), in1_in2 (1), pwm_dir (2)"),
        ({"motor_pins": PINS}, "motor_pins", "is for in1_in2 and pwm_dir"),
        ({"motor_pwm_Hz": 20000}, "motor_pwm_Hz", "is for in1_in2 and pwm_dir"),
        ({"motor_driver": "in1_in2"}, "in1_channel", "remove it and give motor_pins"),
    ],
)
def test_a_wiring_that_cannot_be_is_refused_with_what_to_do(wiring: dict[str, object], key: str, needle: str) -> None:
    with pytest.raises(SchemaError) as caught:
        robot_with(**wiring)
    assert caught.value.key == f"wiring.{key}"
    assert needle in str(caught.value)


@pytest.mark.parametrize(
    ("wiring", "key", "needle"),
    [
        ({"motor_pins": None}, "motor_pins", "is missing; a list of 3 pairs [IN1, IN2]"),
        ({"motor_pins": PINS[:2]}, "motor_pins", "a list of 3 pairs"),
        ({"motor_pins": [10, 11, 12]}, "motor_pins[0]", "two pin numbers [IN1, IN2]"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 16]]}, "motor_pins[2][1]", "16, which has no PWM"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 40]]}, "motor_pins[2][1]", "from 0 to 39"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 10]]}, "motor_pins[2]", "pin 10 is used by the motor of wheel 1"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 22]]}, "motor_pins[2]", "pin 22 is used by the motor of wheel 3"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 2]]}, "motor_pins[2]", "the encoder of wheel 1"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 9]]}, "output_enable_pin", "pin 9 is used by"),
        ({"motor_pins": [[10, 11], [14, 15], [22, 13]]}, "light_pin", "pin 13 is used by the motor of wheel 3"),
        ({"motor_pwm_Hz": 20}, "motor_pwm_Hz", "from 1000 to 100000"),
        ({"motor_pwm_Hz": 20000.0}, "motor_pwm_Hz", "a whole number"),
        ({"motor_driver": "pwm_dir", "motor_pins": [[16, 17]] * 3}, "motor_pins[0][0]", "16, which has no PWM"),
    ],
)
def test_motor_pins_that_cannot_be_are_refused_with_what_to_do(
    wiring: dict[str, object], key: str, needle: str
) -> None:
    with pytest.raises(SchemaError) as caught:
        robot_with_pins(**wiring)
    assert caught.value.key == f"wiring.{key}"
    assert needle in str(caught.value)


def test_the_wiring_id_changes_with_every_pin_and_with_nothing_else() -> None:
    ours = wiring_id(robot_with())
    others: list[dict[str, object]] = [
        {"encoder_pins": [[2, 3], [7, 6], [5, 4]]},
        {"in1_channel": [1, 2, 4]},
        {"output_enable_pin": 20},
        {"stop_button_pin": 21},
        {"light_pin": 8},
        {"battery_pin": 14, "battery_divider": 5.7},
    ]
    numbers = {ours, *(wiring_id(robot_with(**wiring)) for wiring in others)}
    pins = [wiring_id(robot_with_pins(motor_driver=name)) for name in ("in1_in2", "pwm_dir")]
    assert len(numbers | set(pins)) == 1 + len(others) + len(pins)
    assert 0 not in numbers
    assert wiring_id(robot_with(i2c_speed_Hz=1_000_000)) == ours
    renamed = parse_robot({**THREE_WHEEL, "robot": {**THREE_WHEEL["robot"], "name": "mine"}}, TABLE, "elsewhere.toml")
    assert wiring_id(renamed) == ours
    assert constant(wiring_header(robot_with()), "id") == f"0x{ours:08X}"


def test_robots_that_come_with_the_source_differ_in_their_wiring_where_they_differ_in_their_wheels() -> None:
    robots = [load_robot(path, TABLE) for path in sorted((ROOT / "shared" / "robots").glob("*.toml"))]
    by_id: dict[int, set[int]] = {}
    for robot in robots:
        by_id.setdefault(wiring_id(robot), set()).add(robot.wheels)
    assert all(len(wheels) == 1 for wheels in by_id.values())
    assert len(by_id) > 1


@pytest.mark.parametrize(("driver", "number"), [("in1_in2", "1"), ("pwm_dir", "2")])
def test_motor_pins_are_in_the_header(driver: str, number: str) -> None:
    header = wiring_header(robot_with_pins(motor_driver=driver, motor_pwm_Hz=25_000))
    assert constant(header, "motor_driver") == number
    assert constant(header, "motor_pins") == "{{10, 11}, {14, 15}, {22, 23}}"
    assert constant(header, "motor_pwm_Hz") == "25000"


def test_a_direction_needs_no_pwm() -> None:
    robot = robot_with_pins(motor_driver="pwm_dir", motor_pins=[[10, 16], [11, 17], [12, 20]])
    assert robot.board.motor_pins == ((10, 16), (11, 17), (12, 20))
    assert robot.parameter_values()["MOT_DRIVER"] == 2.0


@given(st.permutations(range(LAST_PIN + 1)), st.sampled_from(sorted(ANALOG_PINS)))
def test_a_wiring_loads_exactly_if_no_pin_has_two_uses(pins: list[int], battery: int) -> None:
    wiring = {
        "encoder_pins": [pins[0:2], pins[2:4], pins[4:6]],
        "output_enable_pin": pins[6],
        "light_pin": pins[7],
        "stop_button_pin": pins[8],
        "battery_pin": battery,
        "battery_divider": 5.7,
    }
    used = [*pins[:9], battery, *RESERVED_PINS]
    if len(set(used)) == len(used):
        header = wiring_header(robot_with(**wiring))
        assert [int(number) for number in re.findall(r"\d+", constant(header, "encoder_pins"))] == pins[:6]
        assert constant(header, "output_enable_pin") == str(pins[6])
        assert constant(header, "light_pin") == str(pins[7])
        assert constant(header, "stop_button_pin") == str(pins[8])
        assert constant(header, "battery_pin") == str(battery)
        assert constant(header, "battery_divider") == "5.7f"
    else:
        with pytest.raises(SchemaError, match="move one of the two"):
            robot_with(**wiring)


def test_what_is_not_wired_says_so_in_the_header() -> None:
    document: dict[str, Any] = copy.deepcopy(THREE_WHEEL)
    document["wiring"] = {}
    header = wiring_header(parse_robot(document, TABLE, "r.toml"))
    assert constant(header, "encoder_pins") == "{{255, 255}, {255, 255}, {255, 255}}"
    assert (constant(header, "output_enable_pin"), constant(header, "battery_pin")) == ("-1", "-1")
    assert constant(header, "stop_button_pin") == "-1"
    assert constant(header, "motor_pins") == "{{255, 255}, {255, 255}, {255, 255}}"
    assert (constant(header, "light_pin"), constant(header, "i2c_speed_Hz")) == ("13", "400000")


def generate(out: Path, *robots: str) -> subprocess.CompletedProcess[str]:
    files = [word for robot in robots for word in ("--robot", str(ROOT / "shared" / "robots" / f"{robot}.toml"))]
    command = [sys.executable, str(GENERATOR), "--out", str(out), "--part", "wiring", *files]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_generator_writes_one_robots_header(tmp_path: Path) -> None:
    assert generate(tmp_path, "four_wheel").returncode == 0
    header = (tmp_path / "include" / "omni" / "wiring_gen.h").read_text(encoding="utf-8")
    assert constant(header, "robot_name") == '"four_wheel"'
    assert constant(header, "wheels") == "4"


def test_the_generator_wants_exactly_one_robot(tmp_path: Path) -> None:
    done = generate(tmp_path, "three_wheel", "four_wheel")
    assert done.returncode == 1
    assert "one robot file" in done.stderr
    assert not (tmp_path / "include").exists()
