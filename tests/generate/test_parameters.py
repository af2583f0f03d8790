# SPDX-License-Identifier: MIT
"""The reader of params.toml: what it accepts, what it refuses and how it says so."""

import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omni_schema import SchemaError, load_parameters, parse_parameters
from omni_schema.parameters import storage_key

ROOT = Path(__file__).resolve().parents[2]
PARAMS = ROOT / "shared" / "params.toml"


def entry(**changes: Any) -> dict[str, Any]:
    base = {"kind": "real", "unit": "m", "min": 0.0, "max": 2.0, "default": 1.0, "doc": "A length"}
    return {**base, **changes}


def parse(name: str = "LENGTH", **changes: Any) -> Any:
    return parse_parameters({"schema_version": 1, name: entry(**changes)}, "p.toml")


def test_the_projects_own_table_loads() -> None:
    table = load_parameters(PARAMS)
    assert table.schema_version == 1
    assert [p.index for p in table.parameters] == list(range(len(table)))
    for parameter in table.parameters:
        assert len(parameter.name) <= 16
        assert parameter.minimum <= parameter.default <= parameter.maximum
        assert parameter.doc


def test_an_experiment_is_one_that_tune_has() -> None:
    assert parse().parameters[0].experiment == "step"
    assert parse(experiment="wheel-step").parameters[0].experiment == "wheel-step"
    with pytest.raises(SchemaError, match=r"experiment.*wheel-step"):
        parse(experiment="wheelstep")


def test_per_wheel_names_expand_in_order() -> None:
    table = parse("W{n}_LEN", per_wheel=True)
    assert list(table) == ["W1_LEN", "W2_LEN", "W3_LEN", "W4_LEN"]
    assert [p.wheel for p in table.parameters] == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("changes", "key", "needle"),
    [
        ({"kind": "rael"}, "LENGTH.kind", "did you mean real?"),
        ({"minn": 0.0}, "LENGTH.minn", "did you mean min?"),
        ({"min": 3.0}, "LENGTH.min", "above max"),
        ({"default": 2.5}, "LENGTH.default", "from 0 to 2 m"),
        ({"default": float("nan")}, "LENGTH.default", "finite number"),
        ({"default": "1"}, "LENGTH.default", "finite number"),
        ({"default": True}, "LENGTH.default", "finite number"),
        ({"max": 1e39}, "LENGTH.max", "float32"),
        ({"kind": "int", "default": 0.5}, "LENGTH.default", "whole number"),
        ({"kind": "int", "max": 2.0**25}, "LENGTH.max", "holds exactly"),
        ({"kind": "bool"}, "LENGTH.max", "min = 0 and max = 1"),
        ({"kind": "enum"}, "LENGTH.values", "is needed"),
        ({"values": {"a": 1}}, "LENGTH.values", "no other kind"),
        ({"kind": "enum", "values": {"a": 1, "b": 1}}, "LENGTH.values", "twice"),
        ({"kind": "enum", "values": {"off": 0, "on": 2}}, "LENGTH.default", "off (0), on (2)"),
        ({"lock": "armed"}, "LENGTH.lock", '"disarmed"'),
        ({"per_wheel": True}, "LENGTH.per_wheel", "{n}"),
        ({"robot_key": "wheels"}, "LENGTH.robot_key", "section.key"),
        ({"doc": "two\nlines"}, "LENGTH.doc", "one line"),
    ],
)
def test_errors_name_file_key_and_what_is_allowed(changes: dict[str, Any], key: str, needle: str) -> None:
    with pytest.raises(SchemaError) as caught:
        parse(**changes)
    assert caught.value.key == key
    assert str(caught.value).startswith(f"p.toml: {key}: ")
    assert needle in str(caught.value)


@pytest.mark.parametrize("name", ["length", "1LENGTH", "A_NAME_TOO_LONG_X", "A-B", ""])
def test_bad_names_are_refused(name: str) -> None:
    with pytest.raises(SchemaError, match="A-Z 0-9 _"):
        parse(name)


def test_a_missing_key_is_named() -> None:
    broken = entry()
    del broken["unit"]
    with pytest.raises(SchemaError, match=r"LENGTH\.unit: is missing"):
        parse_parameters({"schema_version": 1, "LENGTH": broken}, "p.toml")


@pytest.mark.parametrize("version", [None, "1", 0, True])
def test_the_schema_version_must_be_a_positive_number(version: object) -> None:
    with pytest.raises(SchemaError, match="schema_version"):
        parse_parameters({"schema_version": version}, "p.toml")


def test_a_name_that_two_entries_give_is_refused() -> None:
    document = {"schema_version": 1, "W{n}_A": entry(per_wheel=True), "W2_A": entry()}
    with pytest.raises(SchemaError, match="W2_A: is defined twice"):
        parse_parameters(document, "p.toml")


def test_missing_and_malformed_files_say_so(tmp_path: Path) -> None:
    with pytest.raises(SchemaError, match="no such file"):
        load_parameters(tmp_path / "none.toml")
    broken = tmp_path / "broken.toml"
    broken.write_text("schema_version = = 1")
    with pytest.raises(SchemaError, match="not valid TOML"):
        load_parameters(broken)
    broken.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(SchemaError, match="UTF-8"):
        load_parameters(broken)


def test_the_crc_follows_meaning_and_not_documentation() -> None:
    base = parse().crc
    assert parse(doc="Other words").crc == base
    assert parse("WIDTH").crc != base
    for changes in ({"max": 3.0}, {"default": 0.5}, {"unit": "cm"}, {"lock": "disarmed"}):
        assert parse(**changes).crc != base


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_value_is_taken_exactly_if_it_is_in_range(value: float) -> None:
    parameter = parse(min=-10.0, max=10.0, default=0.0)["LENGTH"]
    if -10.0 <= value <= 10.0:
        assert parameter.parse("f", "k", value) == value
    else:
        with pytest.raises(SchemaError, match="from -10 to 10 m"):
            parameter.parse("f", "k", value)


def test_values_are_rounded_to_what_the_robot_stores() -> None:
    assert parse(default=0.1)["LENGTH"].default == struct.unpack("<f", struct.pack("<f", 0.1))[0]


def test_an_enums_values_are_its_range() -> None:
    mode = {"kind": "enum", "unit": "", "default": 1, "values": {"a": 1, "b": 3}, "doc": "A mode"}
    parameter = parse_parameters({"schema_version": 1, "MODE": mode}, "p.toml")["MODE"]
    assert (parameter.minimum, parameter.maximum) == (1.0, 3.0)


def test_enums_take_names_and_suggest_close_ones() -> None:
    parameter = parse("MODE", kind="enum", min=0, max=1, default=0, values={"off": 0, "angle": 1})["MODE"]
    assert parameter.parse("f", "k", "angle") == 1.0
    assert parameter.parse("f", "k", 1) == 1.0
    with pytest.raises(SchemaError, match="did you mean angle"):
        parameter.parse("f", "k", "angel")


def test_a_name_with_the_storage_key_of_another_is_refused() -> None:
    """P0 and so on: the first two that share 16 bits, found by trying."""
    seen: dict[int, str] = {}
    names = (f"P{number}" for number in range(70_000))
    first, second = next((seen[storage_key(n)], n) for n in names if seen.setdefault(storage_key(n), n) != n)
    with pytest.raises(SchemaError, match=f"{second}.*has the storage key of {first}"):
        parse_parameters({"schema_version": 1, first: entry(), second: entry()}, "p.toml")
    with pytest.raises(SchemaError, match=f"{second}.*has the storage key of {first}"):
        parse_parameters({"schema_version": 1, "retired": [first], second: entry()}, "p.toml")


def test_a_retired_name_does_not_come_back() -> None:
    with pytest.raises(SchemaError, match="OLD_GAIN: is listed under retired"):
        parse_parameters({"schema_version": 1, "retired": ["OLD_GAIN"], "OLD_GAIN": entry()}, "p.toml")


@pytest.mark.parametrize("retired", ["OLD_GAIN", 3, ["old gain"], [1]])
def test_retired_names_are_a_list_of_names(retired: object) -> None:
    with pytest.raises(SchemaError, match=r"retired: is .*; a list of parameter names is needed"):
        parse_parameters({"schema_version": 1, "retired": retired, "LENGTH": entry()}, "p.toml")
