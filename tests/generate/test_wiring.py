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

from omni_schema import Robot, SchemaError, load_parameters, parse_robot
from omni_schema.toml_file import read_toml
from omni_schema.wiring import ANALOG_PINS, LAST_PIN, RESERVED_PINS
from wiring_header import wiring_header

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = ROOT / "shared" / "generate" / "generate.py"
TABLE = load_parameters(ROOT / "shared" / "params.toml")
THREE_WHEEL = read_toml(ROOT / "shared" / "robots" / "three_wheel.toml")


def robot_with(**wiring: object) -> Robot:
    document: dict[str, Any] = copy.deepcopy(THREE_WHEEL)
    document["wiring"].update(wiring)
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
    ],
)
def test_a_wiring_that_cannot_be_is_refused_with_what_to_do(wiring: dict[str, object], key: str, needle: str) -> None:
    with pytest.raises(SchemaError) as caught:
        robot_with(**wiring)
    assert caught.value.key == f"wiring.{key}"
    assert needle in str(caught.value)


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
