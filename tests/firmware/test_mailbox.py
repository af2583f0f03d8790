# SPDX-License-Identifier: MIT
"""A value handed from the background to the tick: whatever their turns, the tick's own is never written to."""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.native import kept_library

HERE = Path(__file__).parent


@cache
def library() -> ctypes.CDLL:
    loaded = ctypes.CDLL(str(kept_library("mailbox", [HERE / "mailbox_shim.cpp"])))
    loaded.mailbox_take.restype = ctypes.c_bool
    return loaded


@pytest.mark.full
@given(st.lists(st.sampled_from(["publish", "withdraw", "take", "prepare"]), max_size=40))
def test_the_tick_has_the_latest_value_that_was_not_withdrawn_and_keeps_it(turns: list[str]) -> None:
    lib = library()
    lib.mailbox_reset()
    offered: int | None = None
    has = -1
    for number, turn in enumerate(turns):
        if turn == "prepare":
            assert lib.mailbox_prepare(1000 + number) == has, "the tick's own value was written to"
        elif turn == "publish":
            assert lib.mailbox_prepare(number) == has, "the tick's own value was written to"
            lib.mailbox_publish()
            offered = number
        elif turn == "withdraw":
            lib.mailbox_withdraw()
            offered = None
        else:
            assert lib.mailbox_take() == (offered is not None)
            has = has if offered is None else offered
            offered = None
        assert lib.mailbox_taken() == has
