# SPDX-License-Identifier: MIT
"""Rows of [sensors] with a reading: what they may say, and the members, copies and message fields made of them."""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from c_readings import board_readings, input_copies, input_members, message_copies, tick_readings, world_members
from mavlink_dialect import own_document
from omni_schema import SchemaError
from omni_schema.readings import MESSAGE, Reading, add_message_fields, parse_reading, refuse_equal_names
from omni_schema.world import load_world

SHARED = Path(__file__).resolve().parents[2] / "shared"
BOARDS = ("big", "small")
GYRO = {"reading": "gyro_rad_s", "unit": "rad/s", "valid": "gyro_valid", "boards": ["small"]}
FLOW = {"reading": "flow_m_s", "unit": "m/s", "channels": ["x", "y"], "valid": "flow_valid"}

C_MEMBERS = """
#include <stdbool.h>
#include <stdint.h>
typedef float omni_real_t;
typedef int32_t omni_int_t;
typedef double hil_real_t;
typedef int32_t hil_int_t;
typedef struct omni_inputs_t {{ {inputs} }} omni_inputs_t;
typedef struct hil_sensors_t {{ {sensors} }} hil_sensors_t;
typedef struct mavlink_omni_hil_sensors_t {{
    float gyro_rad_s;
    uint8_t gyro_valid;
    float flow_m_s[2];
    uint8_t flow_valid;
}} mavlink_omni_hil_sensors_t;
"""
FIRMWARE = """
#include <cstring>
{board}
{tick}
using namespace omni;
static bool begun;
void BoardReadings::begin_gyro() {{ begun = true; }}
uint8_t BoardReadings::read_gyro(float *gyro_rad_s) {{ *gyro_rad_s = 2.5f; return 1; }}

static bool in_process_and_by_link() {{
    const hil_sensors_t sensors{{1.5, 1, {{3.0, 4.0}}, 2}};
    omni_inputs_t direct{{}}, by_link{{}};
    take_readings(&direct, &sensors);
    mavlink_omni_hil_sensors_t message{{}};
    fill_readings(&message, &sensors);
    TickReadings there;
    there.from_message(message);
    there.to_inputs(&by_link);
    const bool gyro = by_link.gyro_rad_s == 1.5f && by_link.gyro_valid == 1;
    const bool flow = by_link.flow_m_s[0] == 3.0f && by_link.flow_m_s[1] == 4.0f && by_link.flow_valid == 2;
    return gyro && flow && std::memcmp(&direct, &by_link, sizeof direct) == 0;
}}

static bool by_board() {{
    BoardReadings board;
    TickReadings own;
    own.gyro_valid = 1;
    own.from_board(board);
    const bool nothing_yet = !begun && own.gyro_valid == 0;
    board.use_big();
    board.use_small();
    own.from_board(board);
    omni_inputs_t inputs{{}};
    own.to_inputs(&inputs);
    return nothing_yet && begun && inputs.gyro_rad_s == 2.5f && inputs.gyro_valid == 1 && inputs.flow_valid == 0;
}}

int main() {{
    return (in_process_and_by_link() ? 0 : 1) + (by_board() ? 0 : 2);
}}
"""


def reading(name: str, row: dict[str, Any]) -> Reading:
    parsed = parse_reading("w", name, row, "what it is")
    assert parsed is not None
    return parsed


def message(length: int = 1) -> ET.Element:
    return ET.fromstring(f'<message name="{MESSAGE}"><field type="uint8_t[{length}]" name="counts">c</field></message>')


def test_readings_arrive_through_the_process_the_message_and_the_board_s_driver(tmp_path: Path) -> None:
    rows = [reading("gyro", GYRO), reading("flow", FLOW)]
    text = C_MEMBERS.format(inputs=input_members(rows), sensors=world_members(rows))
    copies = [line for line in (input_copies(rows) + message_copies(rows)).splitlines() if not line.startswith("#")]
    text += "\n".join(copies)
    text += FIRMWARE.format(board=board_readings(rows, BOARDS, "w"), tick=tick_readings(rows))
    text = text.replace("#pragma once", "")
    source = tmp_path / "way.cpp"
    source.write_text(text, encoding="utf-8")
    words = ["c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(tmp_path / "way")]
    subprocess.run(words, check=True, timeout=120)
    assert subprocess.run([str(tmp_path / "way")], check=False, timeout=20).returncode == 0


def test_the_message_of_today_has_every_reading_s_field_and_gets_none_added() -> None:
    link, world = SHARED / "link", load_world(SHARED / "world.toml")
    assert [r.name for r in world.readings] == ["counts", "battery_V", "gyro_rad_s", "flow_moved"]
    written = (link / "omni.xml").read_text(encoding="utf-8")
    assert ET.tostring(own_document(link)) == ET.tostring(ET.fromstring(written))


def test_a_new_reading_is_an_extension_with_its_flag() -> None:
    element = message()
    add_message_fields("w", element, [reading("gyro", GYRO), reading("flow", FLOW)])
    assert [child.tag for child in element] == ["field", "extensions", *["field"] * 4]
    added = [(field.get("type"), field.get("name"), field.get("units")) for field in element.iter("field")][1:]
    assert added == [
        ("float", "gyro_rad_s", "rad/s"),
        ("uint8_t", "gyro_valid", None),
        ("float[2]", "flow_m_s", "m/s"),
        ("uint8_t", "flow_valid", None),
    ]


def test_a_row_without_a_reading_says_nothing_else() -> None:
    assert parse_reading("w", "pose", {"doc": "fixes"}, "fixes") is None
    with pytest.raises(SchemaError, match=r"sensors\.pose\.reading: is missing"):
        parse_reading("w", "pose", {"doc": "fixes", "unit": "m"}, "fixes")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"reading": "Gyro rate"}, "is no name"),
        ({"kind": "reel"}, "did you mean real"),
        ({"each": "motor"}, 'only "wheel"'),
        ({"each": "wheel", "channels": ["x"]}, "do not go together"),
        ({"channels": "xyz"}, "a list of names"),
        ({"channels": ["x", "x"]}, "different names"),
        ({"channels": list("abcdefghi")}, "at most 8"),
        ({"valid": ""}, "valid"),
        ({"valod": "gyro_valid"}, "valid"),
    ],
)
def test_a_wrong_row_is_refused_and_said(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(SchemaError, match=said):
        parse_reading("w", "gyro", GYRO | changes, "what it is")


def test_a_driver_needs_a_flag_to_say_that_it_has_nothing() -> None:
    row = {key: value for key, value in GYRO.items() if key != "valid"}
    with pytest.raises(SchemaError, match=r"sensors\.gyro\.valid: is missing; a driver"):
        parse_reading("w", "gyro", row, "what it is")


def test_a_new_reading_without_a_flag_is_refused_since_a_robot_would_take_0_for_it() -> None:
    row = {"reading": "gyro_rad_s"}
    with pytest.raises(SchemaError, match=r"sensors\.gyro\.valid: is missing: a robot"):
        add_message_fields("w", message(), [reading("gyro", row)])


def test_a_field_of_another_type_and_a_message_that_gets_too_long_are_refused() -> None:
    with pytest.raises(SchemaError, match=r"needs OMNI_HIL_SENSORS.counts as float; omni.xml has uint8_t\[1\]"):
        add_message_fields("w", message(), [reading("gyro", GYRO | {"reading": "counts"})])
    add_message_fields("w", message(250), [reading("gyro", GYRO)])
    with pytest.raises(SchemaError, match="256 bytes long; at most 255 fit"):
        add_message_fields("w", message(251), [reading("gyro", GYRO)])


def test_two_sensors_cannot_have_one_name() -> None:
    same = GYRO | {"reading": "other_rad_s"}
    with pytest.raises(SchemaError, match=r"has 'gyro_valid', which sensors\.gyro has already"):
        refuse_equal_names("w", [reading("gyro", GYRO), reading("second", same)])


def test_a_board_that_does_not_exist_is_named() -> None:
    with pytest.raises(SchemaError, match=r"sensors\.gyro\.boards: names 'smal'.*there are big, small"):
        board_readings([reading("gyro", GYRO | {"boards": ["smal"]})], BOARDS, "w")


@pytest.mark.parametrize("main", sorted((SHARED.parent / "firmware" / "boards").glob("*/main.cpp")), ids=str)
def test_every_board_begins_the_drivers_of_the_table(main: Path) -> None:
    assert f".use_{main.parent.name}();" in main.read_text(encoding="utf-8")
