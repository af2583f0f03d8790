# SPDX-License-Identifier: MIT
"""Stored parameters after an update of the firmware: found by name; what does not fit is left out and said."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping

import pytest

from omni_schema import load_parameters
from omni_schema.parameters import storage_key
from omniwheel.dialect import mavlink
from omniwheel.paths import params_path
from tests.radio.memory_robot import ERASED, MemoryRobot
from tests.radio.station import usb

TABLE = load_parameters(params_path())
MAGIC = b"OMP4"
STORE = mavlink.MAV_CMD_PREFLIGHT_STORAGE
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def memory(entries: list[tuple[int, float]], schema: int = 0x12345678) -> bytes:
    """Return an otherwise erased memory with this set in it."""
    body = MAGIC + struct.pack("<II", schema, len(entries))
    body += b"".join(struct.pack("<Hf", key, value) for key, value in entries)
    body += struct.pack("<I", zlib.crc32(body))
    return body + ERASED[len(body) :]


def by_name(values: Mapping[str, float]) -> list[tuple[int, float]]:
    return [(storage_key(name), value) for name, value in values.items()]


def values_of(robot: MemoryRobot, *names: str) -> list[float]:
    station = usb(robot)
    found: dict[str, float] = {}
    for name in names:
        station.mav.param_request_read_send(1, 1, name.encode(), -1)
        found |= {m.param_id: m.param_value for m in station.run(50) if m.get_type() == "PARAM_VALUE"}
    return [round(found[name], 6) for name in names]


def said(robot: MemoryRobot) -> list[str]:
    return [m.text for m in usb(robot).run(50) if m.get_type() == "STATUSTEXT" and "stored" in m.text]


def started(image: bytes, *names: str) -> tuple[list[float], list[str]]:
    """Return these values of a robot that starts with this memory, and what it says of stored values."""
    with MemoryRobot(image) as robot:
        robot.run(50)
        texts = said(robot)
        return values_of(robot, *names), texts


def own(*names: str) -> list[float]:
    return started(ERASED, *names)[0]


def test_a_set_of_a_firmware_with_another_table_is_used_without_a_word() -> None:
    """The header's schema CRC is another firmware's: a range has changed, or a parameter was added."""
    values = {"ISMC_LAM_XY": 7.0, "LIM_V": 0.25}
    assert started(memory(by_name(values)), *values) == ([7.0, 0.25], [])


def test_values_of_parameters_that_are_gone_are_left_out_and_counted() -> None:
    image = memory(by_name({"GONE_ONE": 3.0, "ISMC_LAM_XY": 7.0, "GONE_TWO": 4.0}))
    assert started(image, "ISMC_LAM_XY") == ([7.0], ["2 stored values left out: unknown here"])


@pytest.mark.parametrize("value", [1e9, float("nan"), float("-inf")])
def test_a_value_outside_of_the_new_range_is_left_out_by_name_and_the_rest_is_used(value: float) -> None:
    image = memory(by_name({"LIM_V": value, "ISMC_LAM_XY": 7.0}))
    found, texts = started(image, "LIM_V", "ISMC_LAM_XY")
    assert found == [*own("LIM_V"), 7.0]
    assert len(texts) == 1
    assert texts[0].startswith("stored LIM_V ")
    assert texts[0].endswith(" left out")


def test_of_values_that_do_not_fit_together_the_one_to_blame_is_left_out() -> None:
    """Two motors on one channel: each number is in its range."""
    in2 = own("W1_IN2_CH")[0]
    image = memory(by_name({"W1_IN1_CH": in2, "ISMC_LAM_XY": 7.0}))
    found, texts = started(image, "W1_IN1_CH", "ISMC_LAM_XY")
    assert (found, len(texts)) == ([*own("W1_IN1_CH"), 7.0], 1)
    assert texts[0].startswith("stored W1_IN1_CH ")


def test_many_values_that_do_not_fit_are_counted_after_the_first_few() -> None:
    names = [p.name for p in TABLE.parameters if p.kind == "real"][:20]
    texts = started(memory(by_name(dict.fromkeys(names, float("inf")))), "LIM_V")[1]
    assert "14 more stored values left out" in texts


def test_stored_values_that_fit_only_together_are_all_used() -> None:
    """Two channels changed places: one after another, each would clash with the robot's own of the other."""
    names = ("W1_IN1_CH", "W2_IN1_CH")
    first, second = (own(name)[0] for name in names)
    assert started(memory(by_name(dict(zip(names, (second, first), strict=True)))), *names) == ([second, first], [])


def test_the_next_save_keeps_what_was_used() -> None:
    with MemoryRobot(memory(by_name({"LIM_V": 0.25, "GONE": 1.0}))) as robot:
        robot.run(50)
        station = usb(robot)
        station.mav.command_long_send(1, 1, STORE, 0, 1, 0, 0, 0, 0, 0, 0)
        acks = [m.result for m in station.run(200) if m.get_type() == "COMMAND_ACK"]
        assert acks == [ACCEPTED]
        image = robot.storage()[0]
    assert started(bytes(image), "LIM_V") == ([0.25], [])


def test_loading_says_what_it_leaves_out() -> None:
    with MemoryRobot(memory(by_name({"LIM_V": 1e9, "GONE": 1.0}))) as robot:
        robot.run(50)
        said(robot)
        station = usb(robot)
        station.mav.command_long_send(1, 1, STORE, 0, 0, 0, 0, 0, 0, 0, 0)
        heard = station.run(400)
        assert [m.result for m in heard if m.get_type() == "COMMAND_ACK"] == [ACCEPTED]
        texts = [m.text for m in heard if m.get_type() == "STATUSTEXT" and "stored" in m.text]
        assert [text.split()[0] for text in texts] == ["stored", "1"]
