# SPDX-License-Identifier: MIT
"""What the robot reports stands in one table: it is checked, and firmware and host follow it."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from mavlink_dialect import telemetry_table, trimmed_dialect
from omni_schema import SchemaError
from omniwheel import telemetry
from omniwheel.dialect import mavlink
from telemetry_table import Field, Report, load_telemetry
from tests.firmware.fake_robot import FakeRobot

LINK = Path(__file__).resolve().parents[2] / "shared" / "link"
TABLE = telemetry_table(LINK)
WITH_CLASS = [report for report in TABLE.reports if report.class_name]
MESSAGES = {message.attrib["name"]: message for message in trimmed_dialect(LINK).iter("message")}


@pytest.fixture(scope="module")
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().ready()
    yield one
    one.close()


@pytest.mark.parametrize("report", TABLE.reports, ids=lambda report: report.name)
def test_the_robot_reports_every_message_of_the_table(robot: FakeRobot, report: Report) -> None:
    assert robot.asked(report.name).get_type() == report.name


def value(field: Field, numbers: random.Random) -> object:
    """Return a value that the field can hold and that no other field has."""

    def one() -> float:
        return numbers.uniform(-100.0, 100.0) if field.type == "float" else numbers.randrange(1, 100)

    if field.shown_as in TABLE.names or field.shown_as in ("state", "bool"):
        return 1
    return [one() for _ in range(field.length)] if field.length else one()


@pytest.mark.parametrize("report", WITH_CLASS, ids=lambda report: report.name)
def test_a_class_shows_the_value_of_every_field(report: Report) -> None:
    numbers = random.Random(5)
    values = {field.name: value(field, numbers) for field in report.fields}
    message = getattr(mavlink, f"MAVLink_{report.name.lower()}_message")(**values)
    kind = getattr(telemetry, report.class_name)
    shown = telemetry.decode(kind, message)
    assert telemetry.decode(telemetry.StatusText, message) is None
    assert type(shown) is kind
    for field in report.fields:
        if not field.host or field.shown_as:
            continue
        raw = values[field.name]
        scale = field.scale or 1.0
        expected = tuple(x * scale for x in raw) if isinstance(raw, list) else raw * scale  # type: ignore[operator]
        assert getattr(shown, field.host) == pytest.approx(expected)


def test_a_class_shows_numbers_as_words() -> None:
    values = dict.fromkeys(mavlink.MAVLink_omni_signing_message.fieldnames, 0)
    words = {0: "off", 1: "on", 2: "damaged", 3: "3"}
    for number, word in words.items():
        message = mavlink.MAVLink_omni_signing_message(**{**values, "state": number, "fingerprint": 0xAB})
        shown = telemetry.SigningStatus.decoded(message)
        assert (shown.state, shown.fingerprint) == (word, "000000ab")


WRONG = {
    "nobody fills a field": ('overruns = "latest.overruns"\n', "", "OMNI_STATUS.fields: says nothing about overruns"),
    "a field that is not there": (
        "overruns =",
        "overrun =",
        "overrun: the message has no such field (did you mean overr",
    ),
    "a message that is not there": ("[messages.OMNI_HEALTH]", "[messages.OMNI_HELTH]", "(did you mean OMNI_HEALTH?)"),
    "an unknown group": ('group = "asked"', 'group = "aksed"', "is 'aksed' (did you mean asked?)"),
    "an unknown key": ("reply = true", "replies = true", "replies: unknown key"),
    "an unknown view": ('as = "hex"', 'as = "hexx"', "is 'hexx' (did you mean hex?)"),
    "an element too far": ('"q[3]"', '"q[4]"', "has 4 elements, counted from 0"),
    "a class without a text": ('doc = "The wheel loops', 'note = "The wheel loops', "note: unknown key"),
    "an attribute twice": ('host = "path_time_s"', 'host = "time_s"', "two fields are called time_s"),
    "no expression": ('ticks = "latest.ticks"', 'ticks = ""', "ticks.from: is missing"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_mistake_in_the_table_is_named(tmp_path: Path, name: str) -> None:
    before, after, said = WRONG[name]
    text = (LINK / "telemetry.toml").read_text(encoding="utf-8")
    assert before in text
    (tmp_path / "telemetry.toml").write_text(text.replace(before, after), encoding="utf-8")
    with pytest.raises(SchemaError, match=re.escape(said)):
        load_telemetry(tmp_path / "telemetry.toml", MESSAGES)
