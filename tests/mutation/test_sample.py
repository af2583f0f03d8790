# SPDX-License-Identifier: MIT
"""The sample of every nightly run names mutants and tests that are there, of both areas, and its floor is one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.mutation import sample
from tests.mutation.builds import Area
from tests.mutation.sample import COUNTS, FLOOR_PERCENT, LEFT_OUT_PERCENT, Kept, read
from tests.native import ROOT


def test_the_sample_names_tests_that_are_there() -> None:
    kept = read()
    assert {name: sum(entry.area == name for entry in kept) for name in COUNTS} == COUNTS
    assert len({entry.key for entry in kept}) == len(kept)
    gone = [entry.by for entry in kept if not (ROOT / entry.by.split("::")[0]).exists()]
    assert len(gone) <= LEFT_OUT_PERCENT / 100.0 * len(kept)


def checked(monkeypatch: pytest.MonkeyPatch, alive: int, gone: int, slow: int = 0) -> int:
    """The exit code for a sample of 40, of which some survive and some are in the tree no more."""
    area = Area("core", Path(), (), ())
    test = Path(__file__).relative_to(ROOT).as_posix()
    names = [f"{test}::{'slow' if number < slow else 't'}" for number in range(40)]
    kept = [Kept("core", "pid.c", "f", str(number), name, 0.0) for number, name in enumerate(names)]
    monkeypatch.setattr(sample, "fast_tests", lambda _: frozenset({f"{test}::t"}))
    mutants = [type("Mutant", (), {"key": entry.key})() for entry in kept[gone:]]
    monkeypatch.setattr(sample, "prepare_site", lambda: None)
    monkeypatch.setattr(sample, "areas", lambda: {"core": area})
    monkeypatch.setattr(Area, "mutants", lambda _: mutants)
    monkeypatch.setattr(sample, "survivors", lambda _area, _mutants, here: here[:alive])
    return sample.check(kept)


def test_fewer_than_the_floor_asks_for_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    allowed = int(40 * (1.0 - FLOOR_PERCENT / 100.0))
    assert checked(monkeypatch, alive=allowed, gone=0) == 0
    assert checked(monkeypatch, alive=allowed + 1, gone=0) == 1


def test_fewer_by_fast_tests_than_their_floor_asks_for_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    assert checked(monkeypatch, alive=0, gone=0, slow=4) == 0
    assert checked(monkeypatch, alive=0, gone=0, slow=5) == 1


@pytest.mark.full
def test_the_fast_tests_of_a_file_are_those_that_make_test_runs() -> None:
    found = sample.fast_tests(["tests/core/test_pid.py", "tests/fuzz/test_fuzzers.py"])
    assert {name.split("::")[0] for name in found} == {"tests/core/test_pid.py"}


def test_a_sample_that_has_grown_too_old_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    assert checked(monkeypatch, alive=0, gone=10) == 0
    assert checked(monkeypatch, alive=0, gone=20) == 1
