# SPDX-License-Identifier: MIT
"""A seeded run, which is the same every time, is left out if it has passed with the same sources."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests import kept
from tests.fuzz import fuzz


def test_another_seed_size_or_source_is_another_run() -> None:
    runs = [
        ("app", 1, 100, "a"),
        ("app", 2, 100, "a"),
        ("app", 1, 101, "a"),
        ("app", 1, 100, "b"),
        ("store", 1, 100, "a"),
    ]
    assert len({fuzz.run_digest(*run) for run in runs}) == len(runs)
    reader = {fuzz.run_digest(fuzz.ROBOT_FILE, 1, 100, sources) for sources in "ab"}
    assert len(reader) == 1  # it is made of Python


def test_only_runs_that_have_not_passed_are_built_and_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    built: list[str] = []
    broken = {"store"}
    monkeypatch.setattr(fuzz, "missing", lambda *_: [])
    monkeypatch.setattr(fuzz, "sources_digest", lambda: "sources")
    monkeypatch.setattr(fuzz, "build", built.extend)

    def run(target: str, _: list[str]) -> bool:
        done.append(target)
        return target not in broken

    monkeypatch.setattr(fuzz, "run", run)
    for function in (kept.has_passed, kept.note_passed):
        monkeypatch.setattr(function, "__defaults__", (tmp_path / "kept.txt",))

    def main(mode: str, *words: str) -> tuple[int, list[str], list[str]]:
        done.clear()
        built.clear()
        monkeypatch.setenv(kept.VARIABLE, mode)
        monkeypatch.setattr(sys, "argv", ["fuzz", *words])
        return fuzz.main(), list(done), list(built)

    both = ("app", "store")
    programs = ["seeded_app", "seeded_store"]
    assert main(kept.WRITE, *both) == (1, list(both), programs)
    assert main("", *both) == (1, ["store"], ["seeded_store"])
    broken.clear()
    assert main(kept.WRITE, *both) == (0, ["store"], ["seeded_store"])
    assert main("", *both) == (0, [], [])
    assert main("", "--seed", "2", *both) == (0, list(both), programs)
    assert main("", "--seconds", "5", *both) == (0, list(both), ["fuzzers"])
    assert main(kept.IGNORE, *both) == (0, list(both), programs)
