# SPDX-License-Identifier: MIT
"""The section ``flow`` of a robot file: what is refused, and what becomes of it in the firmware."""

from __future__ import annotations

import copy
import struct
from pathlib import Path
from typing import Any

import pytest

from omni_schema import Robot, SchemaError, load_parameters, parse_robot
from omni_schema.flow import settings_bytes
from omni_schema.toml_file import read_toml
from tests.native import ROOT
from wiring_header import flow_header, wiring_header

TABLE = load_parameters(ROOT / "shared" / "params.toml")
FILE = read_toml(ROOT / "shared" / "robots" / "three_wheel.toml")
PINPOINT: dict[str, Any] = {"chip": "Pinpoint", "steps_per_mm": 13.25}


def robot(flow: object, parameters: dict[str, float] | None = None, pins: dict[str, int] | None = None) -> Robot:
    document = copy.deepcopy(FILE)
    document["flow"] = flow
    document.setdefault("parameters", {}).update(parameters or {})
    document["wiring"].update(pins or {})
    return parse_robot(document, TABLE, "mine.toml")


def test_a_robot_without_one_has_none() -> None:
    plain = parse_robot(copy.deepcopy(FILE), TABLE, "mine.toml")
    assert plain.board.flow is None
    assert plain.parameter_values()["FLOW_MODE"] == 0.0


def test_the_firmware_gets_its_header_address_and_settings() -> None:
    otos, pinpoint, none = robot({"chip": "OTOS"}), robot(PINPOINT), parse_robot(copy.deepcopy(FILE), TABLE, "r.toml")
    for made, address in ((otos, "0x17"), (pinpoint, "0x31"), (none, "0")):
        assert f"constexpr uint8_t flow_address = {address};" in wiring_header(made)
    assert "flow_chip = otos::chip;" in flow_header("r.toml", otos.board.flow)
    assert "flow_chip = no_flow;" in flow_header("r.toml", None)
    assert pinpoint.board.flow is not None
    text = flow_header("r.toml", pinpoint.board.flow)
    assert '#include "app/drivers/pinpoint.h"' in text
    assert "flow_chip = pinpoint::with(flow_settings);" in text
    assert ", ".join(map(str, settings_bytes(pinpoint.board.flow))) in text


@pytest.mark.parametrize("section", [{"chip": "OTOS"}, PINPOINT], ids=["OTOS", "Pinpoint"])
def test_naming_it_switches_it_on(section: dict[str, Any]) -> None:
    made = robot(section)
    assert made.board.flow is not None
    assert made.board.flow.chip.name == section["chip"]
    assert made.parameter_values()["FLOW_MODE"] == 2.0


@pytest.mark.parametrize(
    ("section", "key", "words"),
    [
        ({}, "flow.chip", "give one of OTOS, Pinpoint"),
        ({"chip": "otos"}, "flow.chip", "OTOS"),
        ({"chip": 3}, "flow.chip", "OTOS, Pinpoint"),
        ({"chip": ["OTOS"]}, "flow.chip", "OTOS, Pinpoint"),
        ({"chip": "OTOS", "FLOW_X": 0.05}, "flow.FLOW_X", "in the section [parameters]"),
        ({"chip": "OTOS", "steps_per_mm": 13.0}, "flow.steps_per_mm", "no wheels"),
        ({"chip": "OTOS", "reversed": []}, "flow.reversed", "no wheels"),
        ({"chip": "Pinpoint"}, "flow.steps_per_mm", "13.263"),
        ({**PINPOINT, "steps_per_mm": 0.0}, "flow.steps_per_mm", "from 0.1"),
        ({**PINPOINT, "steps_per_mm": "many"}, "flow.steps_per_mm", "number"),
        ({**PINPOINT, "x_wheel_mm": 2e3}, "flow.x_wheel_mm", "1000"),
        ({**PINPOINT, "reversed": "x"}, "flow.reversed", "list"),
        ({**PINPOINT, "reversed": ["z"]}, "flow.reversed", '"x" and "y"'),
        ({**PINPOINT, "reversed": ["x", "x"]}, "flow.reversed", '"x" and "y"'),
        ({**PINPOINT, "address": 3}, "flow.address", ""),
    ],
    ids=str,
)
def test_what_is_wrong_is_refused_with_what_to_do(section: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(SchemaError) as told:
        robot(section)
    assert key in str(told.value)
    assert words in str(told.value)


def test_the_mode_is_not_given_twice() -> None:
    with pytest.raises(SchemaError, match=r"flow\.chip"):
        robot({"chip": "OTOS"}, {"FLOW_MODE": 1.0})


@pytest.mark.parametrize("pin", [24, 25])
def test_its_pins_are_its_own(pin: int) -> None:
    with pytest.raises(SchemaError, match="floor-motion"):
        robot({"chip": "OTOS"}, pins={"stop_button_pin": pin})
    assert robot({"chip": "OTOS"}, pins={"stop_button_pin": 12}).board.stop_button_pin == 12


def test_what_a_pinpoint_is_told_is_what_the_file_says() -> None:
    flow = robot({**PINPOINT, "x_wheel_mm": 84.0, "y_wheel_mm": -168.0, "reversed": ["y"]}).board.flow
    assert flow is not None
    told = settings_bytes(flow)
    writes, rest = [], told
    while rest[0]:
        writes.append((rest[1], rest[2 : 1 + rest[0]]))
        rest = rest[1 + rest[0] :]
    assert rest == b"\0"
    assert writes == [
        (14, struct.pack("<f", 13.25)),
        (15, struct.pack("<f", 84.0)),
        (16, struct.pack("<f", -168.0)),
        (4, bytes([32, 0, 0, 0])),
        (4, bytes([4, 0, 0, 0])),
    ]


def test_the_shim_of_the_driver_s_tests_is_told_the_same() -> None:
    flow = robot({**PINPOINT, "x_wheel_mm": 84.0, "y_wheel_mm": -168.0, "reversed": ["y"]}).board.flow
    assert flow is not None
    text = (Path(__file__).parents[1] / "firmware" / "flow_shim.cpp").read_text(encoding="utf-8")
    body = text.split("settings[] = {")[1].split("};")[0]
    numbers = [int(word, 0) for line in body.splitlines() for word in line.split("//")[0].replace(",", " ").split()]
    assert bytes(numbers) == settings_bytes(flow)
