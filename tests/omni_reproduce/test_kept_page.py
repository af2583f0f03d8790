# SPDX-License-Identifier: MIT
"""docs/report/results.md and its pictures are of today: the quick experiments in full give the very text of that page.

The others, which take minutes, are compared by ``make nightly ARGS=reproduce``.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from omni_reproduce import page
from omni_reproduce.experiment import Context, Result, Row
from omni_reproduce.registry import EXPERIMENTS, Experiment, select
from omni_reproduce.study import Outcome
from omniwheel.errors import OmniError
from tests.omni_reproduce import kept_page

QUICK_IN_FULL = ("models", "direct_torque", "diagrams")
"""Experiments that take seconds with all their seeds. What changes core or world changes some of these, too."""
TITLE = "Two"
TWO = Experiment("two", TITLE, "", about="What it is.", headline="shown")


def result(shown: float, hidden: float = 1.0) -> Result:
    return Result((Row("two", "a", "shown", "m", shown), Row("two", "a", "hidden", "m", hidden)))


def section(made: Result) -> str:
    return kept_page.sections(page.summary([Outcome(TWO, made, 0.0)], ""))[TITLE]


KEPT = section(result(1.0))
PAGE = f"# A page\n\n## One\n\nFirst.\n\n## {TITLE}\n\n{KEPT}\n\n## Three\n\nLast.\n"


@pytest.mark.full
@pytest.mark.parametrize("name", QUICK_IN_FULL)
def test_the_kept_page_has_the_text_of_today(name: str, tmp_path: Path) -> None:
    """After a change: ``python -m tests.omni_reproduce.kept_page --write``, and look at the difference."""
    (experiment,) = select([name])
    kept = kept_page.sections(kept_page.PAGE.read_text(encoding="utf-8"))[experiment.title]
    assert kept_page.differences(experiment.title, kept, kept_page.section_of(experiment, Context(tmp_path))) == []


def test_every_experiment_has_its_section() -> None:
    kept = kept_page.sections(kept_page.PAGE.read_text(encoding="utf-8"))
    assert list(kept) == [experiment.title for experiment in EXPERIMENTS]


def test_every_kept_picture_is_on_the_page() -> None:
    text = kept_page.PAGE.read_text(encoding="utf-8")
    shown = set(re.findall(r"images/reproduce/(\w+\.png)\)", text))
    assert shown == {picture.name for picture in kept_page.PICTURES.glob("*.png")}


def test_a_section_is_replaced_and_the_others_stay() -> None:
    for title, body in kept_page.sections(PAGE).items():
        assert kept_page.with_section(PAGE, title, body) == PAGE
    assert kept_page.with_section(PAGE, TITLE, "New.") == PAGE.replace(KEPT, "New.")
    with pytest.raises(KeyError, match="no section 'Four'"):
        kept_page.with_section(PAGE, "Four", "New.")


class Stub:
    """An experiment that gives ``made``, or without it lacks what it needs; counts its runs."""

    def __init__(self, made: Result | None) -> None:
        self.made, self.runs = made, 0

    def __call__(self, _context: Context) -> Result:
        self.runs += 1
        if self.made is None:
            raise OmniError("no logs", hint="fetch them")
        return self.made


@pytest.fixture
def compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Compares a stub with the page above; returns what was noted, after as many runs as asked."""
    kept = tmp_path / "page.md"
    kept.write_text(PAGE, encoding="utf-8")
    monkeypatch.setattr(kept_page, "PAGE", kept)

    def compare(stub: Stub, *, write: bool = False) -> kept_page.Comparison:
        monkeypatch.setattr(Experiment, "run", lambda _self, context: stub(context))
        comparison = kept_page.Comparison(tmp_path / "results.json", write)
        comparison.take(TWO, Context(tmp_path))
        return comparison

    return compare


def test_one_changed_digit_is_a_difference(compared: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert compared(Stub(result(1.01))).differ == ["two"]
    assert "-| a | shown | m | 1.00 |\n+| a | shown | m | 1.01 |" in capsys.readouterr().out
    assert compared(Stub(result(1.0))).differ == []


def test_a_row_that_the_summary_leaves_out_is_compared_too(compared: Any) -> None:
    assert compared(Stub(result(1.0, hidden=1.01))).differ == ["two"]


def test_what_was_equal_is_not_run_again_until_its_section_changes(compared: Any, tmp_path: Path) -> None:
    stub = Stub(result(1.0))
    compared(stub)
    compared(stub)
    assert stub.runs == 1
    (tmp_path / "page.md").write_text(PAGE.replace("| m | 1.00 |", "| m | 3.00 |"), encoding="utf-8")
    assert compared(stub).differ == ["two"]
    assert stub.runs == 2


def test_what_is_written_is_equal_afterwards(compared: Any, tmp_path: Path) -> None:
    assert compared(Stub(result(2.0)), write=True).differ == []
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == PAGE.replace(KEPT, section(result(2.0)))
    assert json.loads((tmp_path / "results.json").read_text(encoding="utf-8")).keys() == {"two"}


def test_what_cannot_be_run_here_is_named_and_is_neither_equal_nor_different(
    compared: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    comparison = compared(Stub(None))
    assert (comparison.not_run, comparison.differ) == (["two"], [])
    assert "two: not run: no logs; fetch them" in capsys.readouterr().out
    assert not (tmp_path / "results.json").exists()
