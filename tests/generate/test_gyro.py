# SPDX-License-Identifier: MIT
"""The section [gyro] of a robot file: what is refused, and what follows from it."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from omni_schema import GyroWiring, Robot, SchemaError, parse_robot
from tests.generate.test_wiring import TABLE, THREE_WHEEL
from wiring_header import wiring_header


def robot_with(parameters: dict[str, Any] | None = None, wiring: dict[str, Any] | None = None, **gyro: Any) -> Robot:
    document: dict[str, Any] = copy.deepcopy(THREE_WHEEL)
    document["gyro"] = {"chip": "ICM-42688-P", "axis": 3} | gyro
    document["gyro"] = {key: value for key, value in document["gyro"].items() if value is not None}
    document["parameters"].update(parameters or {})
    document["wiring"].update(wiring or {})
    return parse_robot(document, TABLE, "r.toml")


def test_it_sets_the_axis_and_brings_the_chip_into_the_image() -> None:
    robot = robot_with(axis=-1, address=0x69)
    assert robot.board.gyro == GyroWiring(TABLE.gyro_chips["ICM-42688-P"], -1, 0x69)
    assert robot.parameter_values()["GYRO_AXIS"] == -1.0
    assert "constexpr uint8_t gyro_address = 0x69;" in wiring_header(robot)


def test_a_file_without_it_has_no_gyro() -> None:
    robot = parse_robot(copy.deepcopy(THREE_WHEEL), TABLE, "r.toml")
    assert robot.board.gyro is None
    assert robot.parameter_values()["GYRO_AXIS"] == 0.0
    assert "constexpr uint8_t gyro_address = 0;" in wiring_header(robot)


@pytest.mark.parametrize(
    ("given", "key", "words"),
    [
        ({"chip": None}, "gyro.chip", "is missing; give one of ICM-42688-P"),
        ({"axis": None}, "gyro.axis", "is missing; give the axis that points up"),
        ({"chip": "ICM-42688"}, "gyro.chip", "ICM-42688-P"),
        ({"axis": 0}, "gyro.axis", "1 x, 2 y, 3 z"),
        ({"axis": 3.0}, "gyro.axis", "1 x, 2 y, 3 z"),
        ({"axis": True}, "gyro.axis", "1 x, 2 y, 3 z"),
        ({"address": 0x40}, "gyro.address", "0x68"),
        ({"bus": 1}, "gyro.bus", "chip"),
        ({"parameters": {"GYRO_AXIS": 2}}, "parameters.GYRO_AXIS", "gyro.axis"),
        ({"wiring": {"stop_button_pin": 17}}, "wiring.stop_button_pin", "the gyro's I2C (SDA)"),
        ({"wiring": {"battery_pin": 16, "battery_divider": 5.0}}, "wiring.battery_pin", "the gyro's I2C (SCL)"),
    ],
)
def test_what_cannot_be_is_refused_with_words_that_help(given: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(SchemaError) as refused:
        robot_with(**given)
    assert key in str(refused.value)
    assert words in str(refused.value)


def test_without_it_its_pins_are_free() -> None:
    document: dict[str, Any] = copy.deepcopy(THREE_WHEEL)
    document["wiring"]["stop_button_pin"] = 17
    assert parse_robot(document, TABLE, "r.toml").board.stop_button_pin == 17


def test_its_parameters_may_be_set_beside_it() -> None:
    assert robot_with(parameters={"GYRO_SCALE": 1.01}).parameter_values()["GYRO_SCALE"] == pytest.approx(1.01)
