# SPDX-License-Identifier: MIT
"""The table of motor drivers: what it says, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from omni_schema import SchemaError
from omni_schema.motor_drivers import parse_motor_drivers

CHIP = {"doc": "a chip"}
PINS = {
    "doc": "a bridge",
    "pins": ["PH", "EN"],
    "pwm": [True, False],
    "low": "coast",
    "first": "coast",
    "second": "backward",
    "both": "forward",
}


def parsed(**changes: Any) -> Any:
    row = {key: value for key, value in {**PINS, **changes}.items() if value is not None}
    return parse_motor_drivers("params.toml", {"motor_drivers": {"a_chip": CHIP, "antiphase_2": row}})


def test_the_numbers_are_the_order_and_the_class_has_the_words_of_the_name() -> None:
    drivers = parsed()
    assert [(row.number, row.class_name, row.pins) for row in drivers.values()] == [
        (0, "AChip", ()),
        (1, "Antiphase2", ("PH", "EN")),
    ]
    assert drivers["antiphase_2"].bridge == ("coast", "coast", "backward", "forward")


@pytest.mark.parametrize("low", ["forward", "backward"])
def test_a_bridge_that_would_drive_after_a_stop_is_refused(low: str) -> None:
    with pytest.raises(SchemaError, match=r"antiphase_2.low.*after any stop"):
        parsed(low=low)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("both", "foward", "did you mean forward"),
        ("second", None, "is missing"),
        ("pins", ["PH"], "names of two pins"),
        ("pins", None, "is given without pins"),
        ("pwm", [1, 0], "true or false"),
        ("phase", 1, "phase"),
        ("doc", None, "a string is needed"),
    ],
)
def test_a_row_that_makes_no_sense_is_refused_by_its_key(key: str, value: object, said: str) -> None:
    with pytest.raises(SchemaError, match=said):
        parsed(**{key: value})


def test_a_name_that_is_no_class_is_refused() -> None:
    with pytest.raises(SchemaError, match="lower case"):
        parse_motor_drivers("params.toml", {"motor_drivers": {"Chip": CHIP}})
