# SPDX-License-Identifier: MIT
"""Results go on after an interruption, judgements say something, and every judged survivor is still a mutant."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.mutation.builds import areas
from tests.mutation.operators import Mutant
from tests.mutation.records import (
    GOLDEN,
    KILLED,
    REFUSED,
    SAME,
    SURVIVED,
    Judgement,
    Result,
    Results,
    origins,
    read_judgements,
    report,
    score,
    survivor_text,
)


def mutant(number: int) -> Mutant:
    return Mutant("shared/core/src/control/pid.c", "f", "f", "sign", 0, 1, "-", "a = b;", "a = -(b);", number)


@pytest.mark.nightly
def test_every_judged_survivor_is_a_mutant_of_the_tree() -> None:
    known = {found.key for area in areas().values() for found in area.mutants()}
    gone = [judgement for key, judgement in read_judgements().items() if key not in known]
    assert gone == [], "these lines have changed: take them out of tests/mutation/survivors.toml"


def test_results_hold_until_what_they_depend_on_changes(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    Results(path).add(Result("k", KILLED, "source", "file", "tests/a.py::test", "failed"))
    Results(path).add(Result("s", SURVIVED, "source", "tests"))
    Results(path).add(Result("n", REFUSED, "source", ""))
    with path.open("a") as file:
        file.write('{"key": "cut off')
    again = Results(path)
    assert again.killer("k") == "tests/a.py::test"
    assert again.get("k", "source", "other tests", "file") is not None
    assert again.get("k", "source", "tests", "other file") is None
    assert again.get("s", "source", "tests") is not None
    assert again.get("s", "source", "other tests") is None
    assert again.get("s", "source", "tests", longest_s=400.0) is None
    assert again.get("n", "source", "other tests") is not None
    assert again.get("n", "other source", "tests") is None
    assert again.found("s", "source") is not None
    assert again.found("s", "other source") is None
    assert again.found("nobody", "source") is None


def test_a_kill_is_carried_over_while_its_function_and_its_test_are_there(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    here, survivor, old = (replace(mutant(number), text="as it was") for number in range(3))
    Results(path).add(Result(here.key, KILLED, "s", "t", "tests/a.py::test", "failed", here.text, "866d76d"))
    Results(path).add(Result(survivor.key, SURVIVED, "s", "t", text=survivor.text, commit="866d76d"))
    Results(path).add(Result(old.key, KILLED, "s", "t", "tests/a.py::test", "failed"))
    again = Results(path)
    assert again.carried(here, {"tests/a.py::test"}) is not None
    assert again.carried(here, {"tests/a.py::another"}) is None
    assert again.carried(replace(here, text="another"), {"tests/a.py::test"}) is None
    assert again.carried(survivor, {"tests/a.py::test", ""}) is None
    assert again.carried(replace(old, text=""), {"tests/a.py::test"}) is None


def test_the_report_says_from_which_commits_kills_are() -> None:
    pairs = [(mutant(n), Result(mutant(n).key, KILLED, "", "", commit=f"c{n // 2}")) for n in range(4)]
    assert origins(pairs, set()) == "4 verdicts are of the sources as they are."
    words = origins(pairs, {pair[0].key for pair in pairs[1:]})
    assert words.startswith(
        "1 verdicts are of the sources as they are. 3 kills are carried over (2 from c1, 1 from c0)"
    )


def test_only_what_differs_counts_and_recorded_bits_do_not_kill() -> None:
    outcomes = [KILLED, KILLED, KILLED, GOLDEN, SURVIVED, SURVIVED, REFUSED, SAME]
    pairs = [(mutant(n), Result(mutant(n).key, outcome, "", "")) for n, outcome in enumerate(outcomes)]
    last = pairs[5][0]
    judgement = Judgement(
        last.file, last.function, last.operator, last.was, last.becomes, "equivalent", "x", last.number
    )
    figures = score(pairs, {judgement.key: judgement})
    assert (figures.counted, figures.equivalent) == (6, 1)
    assert figures.killed_percent == pytest.approx(50.0)
    assert figures.killed_percent_of_different == pytest.approx(60.0)
    told = report(pairs, {last.key: judgement})
    assert "| `shared/core/src` | 8 | 1 | 1 | 6 | 3 | 1 | 2 | 1 | 50.0 % | 60.0 % |" in told
    assert "`firmware/app`" not in told, "nothing of it has been run: that is no 100 %"


def test_a_judgement_has_a_reason(tmp_path: Path) -> None:
    path = tmp_path / "survivors.toml"
    path.write_text(survivor_text(mutant(1)), encoding="utf-8")
    with pytest.raises(ValueError, match="and why"):
        read_judgements(path)
    path.write_text(survivor_text(mutant(1)).replace('why = ""', 'why = "b is zero"'), encoding="utf-8")
    assert list(read_judgements(path)) == [mutant(1).key]
