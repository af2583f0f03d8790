# SPDX-License-Identifier: MIT
"""Numbers and addresses in the robot's texts read as they are, and a text is never longer than a STATUSTEXT."""

from __future__ import annotations

import ctypes
import math
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tests.native import kept_library

CAPACITY = 50
WORDS = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=70)


@pytest.fixture(scope="module")
def texts() -> ctypes.CDLL:
    shim = Path(__file__).parent / "text_shim.cpp"
    library = ctypes.CDLL(str(kept_library("text", [shim])))
    for name in ("number", "address", "float"):
        getattr(library, f"text_of_{name}").restype = ctypes.c_char_p
    library.text_of_float.argtypes = [ctypes.c_float]
    library.text_joined.restype = ctypes.c_char_p
    library.text_length.restype = ctypes.c_size_t
    return library


@pytest.mark.full
@given(number=st.integers(0, 2**32 - 1))
def test_whole_numbers_and_addresses_read_as_they_are(texts: ctypes.CDLL, number: int) -> None:
    assert texts.text_of_number(number).decode() == str(number)
    assert texts.text_of_address(number).decode() == f"0x{number:08X}"


def four_decimals(value: float) -> str:
    """Python's decimal numbers, rounded to four places; the product with 10000 is a float, too."""
    scaled = Decimal(float(np.float32(abs(value)) * np.float32(10000))).quantize(Decimal(1), ROUND_HALF_UP)
    digits = f"{scaled / 10000:f}"
    whole = digits.rstrip("0").rstrip(".") if "." in digits else digits
    return ("-" if value < 0 else "") + whole


@given(value=st.floats(-99999, 99999, width=32))
@example(value=0.5)
@example(value=-0.25)
@example(value=2.0005)
@example(value=-12.0)
def test_a_float_has_up_to_four_decimals(texts: ctypes.CDLL, value: float) -> None:
    value = float(np.float32(value))
    said = texts.text_of_float(value).decode()
    expected = four_decimals(value)
    if expected.lstrip("-") == "0" and value != 0:
        assert said == ("-0.0000" if value < 0 else "0.0000"), "small, but not nothing"
    else:
        assert said == expected


@given(value=st.floats(1e5, 3.9e9, width=32))
def test_a_large_float_is_a_whole_number(texts: ctypes.CDLL, value: float) -> None:
    assert texts.text_of_float(value).decode() == str(int(value))
    assert texts.text_of_float(-value).decode() == str(-int(value))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (math.nan, "NaN"),
        (math.inf, "infinity"),
        (-math.inf, "-infinity"),
        (4.0e9, "huge"),
        (-1e30, "-huge"),
        (3.4e38, "huge"),
        (100000.0, "100000"),
        (0.0, "0"),
    ],
)
def test_numbers_at_the_edges(texts: ctypes.CDLL, value: float, words: str) -> None:
    assert texts.text_of_float(value).decode() == words


@given(first=WORDS, second=WORDS)
@example(first="a" * CAPACITY, second="b")
@example(first="a" * (CAPACITY - 1), second="bc")
def test_what_does_not_fit_is_cut(texts: ctypes.CDLL, first: str, second: str) -> None:
    assert texts.text_joined(first.encode(), second.encode()).decode() == (first + second)[:CAPACITY]
    assert texts.text_length() == min(len(first + second), CAPACITY)
