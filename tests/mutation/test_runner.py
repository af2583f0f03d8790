# SPDX-License-Identifier: MIT
"""A test that waits for ever is told from one that is slow because the machine is busy."""

from __future__ import annotations

import os
from collections.abc import Iterator
from itertools import count, repeat

import pytest

from tests.mutation import runner


def heard(monkeypatch: pytest.MonkeyPatch, times: Iterator[float], words_after: int) -> tuple[list[str], bool]:
    """Return what is heard from a child that is silent so many times, while it uses the processor like that."""
    reader, writer = os.pipe()
    silences = count(1)

    def processor_s(session: int) -> float:
        assert session == 77
        if next(silences) == words_after:
            os.write(writer, b"done \n")
        return next(times)

    monkeypatch.setattr(runner, "processor_s", processor_s)
    try:
        return runner._listen(reader, 0.01, 77)
    finally:
        os.close(reader)
        os.close(writer)


def test_who_is_silent_and_computes_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert heard(monkeypatch, map(float, count(2, 2)), words_after=3) == (["done "], False)


def test_who_is_silent_and_waits_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert heard(monkeypatch, repeat(5.0), words_after=3) == ([], True)


def test_who_computes_for_ever_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert heard(monkeypatch, map(float, count(2, 2)), words_after=runner.PATIENCE + 1) == ([], True)
