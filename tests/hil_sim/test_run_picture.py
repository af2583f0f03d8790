# SPDX-License-Identifier: MIT
"""The facts below the picture of a run are those that the command line prints."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
from matplotlib.figure import Figure
from rich.console import Console

from hil_sim.run_picture import draw_run
from hil_sim.runs import run_in_process
from hil_sim.scenario import load_scenario
from hil_sim.summary import summarize
from omni.cli.run_output import comparison_table
from omniwheel.number_text import shown


@pytest.mark.parametrize(
    ("value", "factor", "digits", "text"),
    [
        (None, 1.0, 2, "–"),
        (0.0, 100.0, 1, "0.0"),
        (0.0004, 100.0, 1, "<0.1"),
        (0.0006, 100.0, 1, "0.1"),
        (-0.2, 1.0, 0, "-0"),
    ],
)
def test_what_is_more_than_nothing_is_not_shown_as_nothing(
    value: float | None, factor: float, digits: int, text: str
) -> None:
    assert shown(value, factor, digits) == text


def test_a_short_time_at_a_limit_reads_the_same_in_the_picture_and_on_the_command_line(tmp_path: Path) -> None:
    run = run_in_process(replace(load_scenario("demo"), duration_s=1.0))
    summary = summarize(run)
    summary["effort"]["saturated_share"] = 0.0004
    with patch.object(Figure, "savefig", autospec=True) as saved:
        draw_run(summary, run.record, tmp_path / "run.png")
    texts = [text.get_text() for axes in saved.call_args.args[0].axes for text in axes.texts]
    assert any(text.startswith("<0.1 %, ") for text in texts), texts
    printed = Console(file=io.StringIO(), width=100)
    printed.print(comparison_table("", [("run", summary["rmse"], summary["effort"])]))
    assert "<0.1" in printed.file.getvalue()  # type: ignore[attr-defined]
