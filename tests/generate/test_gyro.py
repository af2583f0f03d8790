# SPDX-License-Identifier: MIT
"""The section [gyro] of a robot file: what is refused, and what follows from it."""

from __future__ import annotations

import copy
import hashlib
import math
from pathlib import Path
from typing import Any

import pytest

from omni_schema import GyroChip, GyroWiring, Robot, SchemaError, parse_robot
from omni_schema.gyro_chips import parse_gyro_chips
from omni_schema.gyro_configuration import BOSCH_SHA256, read_configuration
from omni_schema.toml_file import read_toml
from tests.generate.test_wiring import TABLE, THREE_WHEEL
from tests.native import ROOT
from wiring_header import gyro_header, wiring_header


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


@pytest.mark.parametrize("chip", TABLE.gyro_chips.values(), ids=lambda chip: chip.name)
def test_a_chip_is_a_header_a_namespace_and_numbers_for_the_filter(chip: GyroChip, tmp_path: Path) -> None:
    own, digest = configuration(tmp_path / "own.bin")
    more: dict[str, Any] = {"config_file": own.name, "config_sha256": digest} if chip.config_file else {}
    robot = robot_with(chip=chip.name, **more)
    values = robot.parameter_values()
    assert values["GYRO_ND"] == pytest.approx(math.radians(chip.noise_dps))
    assert (values["GYRO_BRW"], values["GYRO_S_SD"]) == pytest.approx((chip.bias_walk, chip.scale_error))
    header = gyro_header(str(tmp_path / "r.toml"), robot.board.gyro)
    assert f'#include "app/drivers/{chip.driver}.h"' in header
    assert f"gyro_registers = {chip.driver}::registers;" in header
    assert ("gyro_configuration_size = 8192" in header) == chip.config_file
    assert (ROOT / "firmware" / "app" / "drivers" / f"{chip.driver}.h").is_file()


def test_a_robot_without_a_gyro_has_no_chips_header() -> None:
    header = gyro_header("r.toml", None)
    assert '#include "app/drivers/gyro_registers.h"' in header
    assert "gyro_configuration_size = 0" in header


# Filters as the drivers' headers state them [Hz], each of first or second order.
FILTERS = {"ICM-42688-P": ((488.0, 2), (500.0, 1)), "LSM6DSO": ((453.2, 2),), "ISM330DHCX": ((453.2, 2),)}
FILTERS["BMI270"] = ((751.0 / 2.0, 2),)


@pytest.mark.parametrize("chip", TABLE.gyro_chips.values(), ids=lambda chip: chip.name)
def test_the_guides_table_says_what_the_row_says(chip: GyroChip) -> None:
    low, high = chip.addresses
    row = (
        f"| `{chip.name}` | {1e3 * chip.noise_dps:g} | {100 * chip.scale_error:g} % | "
        f"{chip.address_pin}: 0x{low:02X} / 0x{high:02X} | {chip.select} | {chip.delay_ms:g} ms |"
    )
    assert row in (ROOT / "docs" / "guides" / "gyro.md").read_text(encoding="utf-8").splitlines()


@pytest.mark.parametrize("chip", TABLE.gyro_chips.values(), ids=lambda chip: chip.name)
def test_the_delay_is_that_of_the_filters(chip: GyroChip) -> None:
    delay_s = sum((math.sqrt(2.0) if order == 2 else 1.0) / (2.0 * math.pi * cut) for cut, order in FILTERS[chip.name])
    assert chip.delay_ms == pytest.approx(1e3 * delay_s, abs=0.03)


def configuration(path: Path) -> tuple[Path, str]:
    content = bytes((7 * at + at // 256) % 256 for at in range(8192))
    path.write_bytes(content)
    return path, hashlib.sha256(content).hexdigest()


@pytest.mark.parametrize(
    "text",
    ["const uint8_t bmi270_config_file[] = {{\n{}\n}};", "x = [0x01]\nbmi270_config_file = [\n    {}\n]\n"],
    ids=["C", "Python"],
)
def test_a_configuration_is_found_in_a_source_file(tmp_path: Path, text: str) -> None:
    own, digest = configuration(tmp_path / "own.bin")
    file = tmp_path / "from_elsewhere"
    file.write_text(text.format(", ".join(f"0x{byte:02x}" for byte in own.read_bytes())), encoding="utf-8")
    assert read_configuration(str(tmp_path / "r.toml"), file.name, digest) == own.read_bytes()


def test_a_configuration_that_is_not_the_right_one_is_refused(tmp_path: Path) -> None:
    robot = str(tmp_path / "r.toml")
    own, digest = configuration(tmp_path / "own.bin")
    with pytest.raises(SchemaError, match="cannot be read"):
        read_configuration(robot, "none.c")
    with pytest.raises(SchemaError, match=f'config_sha256 = "{digest}"'):
        read_configuration(robot, own.name)
    with pytest.raises(SchemaError, match="are not those"):
        read_configuration(robot, own.name, BOSCH_SHA256)
    (tmp_path / "short.bin").write_bytes(own.read_bytes()[:-1])
    with pytest.raises(SchemaError, match="with 0 bytes"):
        read_configuration(robot, "short.bin")
    (tmp_path / "short.c").write_text("uint8_t bmi270_config_file[] = {0x01, 0x02};", encoding="utf-8")
    with pytest.raises(SchemaError, match="with 2 bytes of a configuration; 8192 are needed"):
        read_configuration(robot, "short.c")


def test_a_table_of_chips_that_is_wrong_names_the_key() -> None:
    row = {**read_toml(ROOT / "shared" / "params.toml")["gyro_chips"]["LSM6DSO"]}
    for change, key in (
        ({"addresses": [0x6A]}, "addresses"),
        ({"noise_dps": 0.0}, "noise_dps"),
        ({"driver": "Lsm"}, "driver"),
        ({"config_file": 1}, "config_file"),
        ({"speed": 1}, "speed"),
    ):
        with pytest.raises(SchemaError, match=key):
            parse_gyro_chips("p.toml", {"gyro_chips": {"LSM6DSO": {**row, **change}}})
    with pytest.raises(SchemaError, match="names are those"):
        parse_gyro_chips("p.toml", {"gyro_chips": {"lsm": row}})


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
        ({"chip": "LSM6DSO", "address": 0x68}, "gyro.address", "0x6A (SDO/SA0 to ground)"),
        ({"chip": "BMI270"}, "gyro.config_file", "is missing: a BMI270 measures nothing without"),
        ({"config_file": "bmi270.c"}, "gyro.config_file", "a ICM-42688-P needs none; remove it"),
        ({"chip": "BMI270", "config_file": 3}, "gyro.config_file", "3"),
        ({"chip": "BMI270", "config_file": "a", "config_sha256": "12"}, "gyro.config_sha256", "64 hexadecimal digits"),
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
