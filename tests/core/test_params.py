# SPDX-License-Identifier: MIT
"""The parameter table: names, defaults, and what may be set."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib

COUNT = int(lib.OMNI_PARAM_COUNT)
TABLE = [lib.omni_param_table[i] for i in range(COUNT)]
NAMES = [ffi.string(info.name) for info in TABLE]
indices = st.integers(0, COUNT - 1)
LOCKED = next(i for i in range(COUNT) if TABLE[i].locked_while_armed)
REAL = int(lib.OMNI_PARAM_ISMC_LAM_XY)
WHOLE = int(lib.OMNI_PARAM_TRJ_PETALS)


def check(index: int, value: float, armed: bool = False) -> int:
    return int(lib.omni_param_check(index, value, armed))


@pytest.mark.parametrize("index", range(COUNT))
def test_every_parameter_is_found_by_name(index: int) -> None:
    assert lib.omni_param_find(NAMES[index]) == index


@given(indices, st.binary(max_size=4))
def test_a_name_of_sixteen_characters_needs_no_terminator(index: int, behind: bytes) -> None:
    name = NAMES[index].ljust(16, b"\0") + behind
    assert lib.omni_param_find(ffi.from_buffer("char[]", name)) == index


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=20).map(str.encode))
def test_other_names_are_not_found(name: bytes) -> None:
    expected = NAMES.index(name[:16]) if name[:16] in NAMES else -1
    assert lib.omni_param_find(name) == expected


@pytest.mark.parametrize("name", [b"", b"ISMC_LAM", b"ISMC_LAM_XYZ", b"ismc_lam_xy", b" ISMC_LAM_XY"])
def test_part_of_a_name_is_not_the_name(name: bytes) -> None:
    assert lib.omni_param_find(name) == -1


def test_presets_are_found_by_name() -> None:
    for i in range(lib.omni_builtin_robot_count):
        assert lib.omni_builtin_robot_find(lib.omni_builtin_robots[i].name) == i
    assert lib.omni_builtin_robot_find(b"three_wheel") >= 0
    assert lib.omni_builtin_robot_find(b"three") == -1
    assert lib.omni_builtin_robot_find(b"") == -1


def test_defaults_are_the_tables() -> None:
    values = ffi.new("float[]", COUNT)
    lib.omni_params_defaults(values)
    assert list(values) == [info.initial for info in TABLE]


def test_defaults_and_presets_pass_the_check() -> None:
    for index in range(COUNT):
        assert check(index, TABLE[index].initial) == lib.OMNI_OK
        for robot in range(lib.omni_builtin_robot_count):
            assert check(index, lib.omni_builtin_robots[robot].values[index]) == lib.OMNI_OK


@pytest.mark.full
@given(indices)
def test_both_ends_of_the_range_belong_to_it_and_nothing_beyond(index: int) -> None:
    low, high = np.float32(TABLE[index].minimum), np.float32(TABLE[index].maximum)
    assert check(index, float(low)) == lib.OMNI_OK
    assert check(index, float(high)) == lib.OMNI_OK
    assert check(index, float(np.nextafter(low, np.float32(-math.inf)))) == lib.OMNI_ERR_RANGE
    assert check(index, float(np.nextafter(high, np.float32(math.inf)))) == lib.OMNI_ERR_RANGE


@given(indices, st.floats(width=32, allow_nan=False, allow_infinity=False), st.booleans())
def test_check_says_what_the_table_says(index: int, value: float, armed: bool) -> None:
    info = TABLE[index]
    whole = info.kind != lib.OMNI_PARAM_INT or value == math.floor(value)
    if not (info.minimum <= value <= info.maximum and whole):
        expected = lib.OMNI_ERR_RANGE
    else:
        expected = lib.OMNI_ERR_LOCKED if armed and info.locked_while_armed else lib.OMNI_OK
    assert check(index, value, armed) == expected


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("index", [REAL, WHOLE, LOCKED])
def test_values_that_are_not_finite_are_refused(index: int, value: float) -> None:
    assert check(index, value) == lib.OMNI_ERR_NOT_FINITE


@pytest.mark.parametrize("index", [-1, COUNT, 2**31 - 1, -(2**31)])
def test_an_index_outside_the_table_is_unknown(index: int) -> None:
    assert check(index, 0.0) == lib.OMNI_ERR_UNKNOWN


def test_whole_numbers_only_where_they_are_meant() -> None:
    assert check(WHOLE, 7.0) == lib.OMNI_OK
    assert check(WHOLE, 7.5) == lib.OMNI_ERR_RANGE
    assert check(REAL, 7.5) == lib.OMNI_OK


def test_gains_may_change_while_armed_but_wiring_may_not() -> None:
    assert check(REAL, 7.5, armed=True) == lib.OMNI_OK
    assert check(LOCKED, TABLE[LOCKED].initial, armed=True) == lib.OMNI_ERR_LOCKED
    assert check(LOCKED, TABLE[LOCKED].initial, armed=False) == lib.OMNI_OK
