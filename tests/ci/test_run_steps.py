# SPDX-License-Identifier: MIT
"""The runner of CI's steps: order, failures, the limit, the table."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tests.ci.run_steps import STEPS, Run, Step


def run(tmp_path: Path, *steps: Step, limit_s: float = 60.0) -> tuple[Run, bool]:
    found = Run(steps, limit_s, tmp_path)
    return found, found.all_passed()


def test_a_step_begins_after_those_that_it_needs(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    second = Step("second", f"test -e '{mark}'", after=("first",))
    assert run(tmp_path, second, Step("first", f"sleep 0.3; touch '{mark}'"))[1]


def test_a_failure_stops_what_comes_after_it_and_nothing_else(tmp_path: Path) -> None:
    bad, other = Step("bad", "echo words; exit 3"), Step("other", "true")
    found, passed = run(
        tmp_path, bad, Step("then", "true", after=("bad",)), Step("last", "true", after=("then",)), other
    )
    assert not passed
    assert {name: outcome.passed for name, outcome in found.outcomes.items()} == {
        "bad": False, "then": None, "last": None, "other": True,
    }  # fmt: skip
    assert (tmp_path / "bad.log").read_text() == "words\n"
    assert found.ends_of_failed()[1:] == ["words"]


def test_at_the_limit_all_processes_of_a_step_are_ended(tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    endless = Step("endless", f"(while :; do touch '{alive}'; sleep 0.05; done) & wait")
    found, passed = run(tmp_path, endless, Step("never", "true", after=("endless",)), limit_s=1.0)
    assert not passed
    assert alive.exists()
    alive.unlink()
    assert [outcome.passed for outcome in found.outcomes.values()] == [None, None]
    assert len(found.table()) == 3
    subprocess.run(["sleep", "0.3"], check=True)  # six times its period
    assert not alive.exists()


def test_processor_time_counts_what_a_step_starts(tmp_path: Path) -> None:
    found, _ = run(tmp_path, Step("busy", "bash -c 'for ((k = 0; k < 60000; k++)); do :; done'"))
    assert found.outcomes["busy"].cpu_s > 0.02


def test_steps_name_earlier_steps() -> None:
    names = [step.name for step in STEPS]
    for place, step in enumerate(STEPS):
        assert set(step.after) <= set(names[:place])
