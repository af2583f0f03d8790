# SPDX-License-Identifier: MIT
"""The experiment on real logs where there are none, and on synthetic ones in their place."""

from __future__ import annotations

from pathlib import Path

import pytest

from omni_reproduce import real_logs
from omni_reproduce.experiment import Context
from omniwheel.errors import LogError
from tests.host.logs import synthetic


def test_without_logs_it_says_how_to_give_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_REAL_LOGS", str(tmp_path))
    (row,) = real_logs.run(Context(tmp_path)).rows
    assert row.ours is None
    assert "OMNI_REAL_LOGS" in row.explanation


def test_a_folder_that_is_none_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMNI_REAL_LOGS", str(tmp_path / "nowhere"))
    with pytest.raises(LogError, match="no folder"):
        real_logs.run(Context(tmp_path))


@pytest.mark.full
def test_a_folder_of_other_runs_is_taken_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Synthetic runs under the real ones' names and columns."""
    data, out = tmp_path / "data", tmp_path / "out"
    data.mkdir()
    out.mkdir()
    for seed in (1, 2):
        synthetic.write(data, f"run{seed}", synthetic.Known(), seed)
        (data / f"truth_run{seed}.csv").rename(data / f"truth{seed}.csv")
    monkeypatch.setenv("OMNI_REAL_LOGS", str(data))
    done: list[float] = []
    result = real_logs.run(Context(out, quick=True, progress=done.append))
    figures = {(row.setting, row.quantity): row.ours for row in result.rows}
    median = "RMS distance, median of the runs"
    nominal, found = figures["nominal geometry", median], figures["identified on the other runs", median]
    assert nominal is not None
    assert found is not None
    assert found < 0.015 < nominal
    assert figures["identified on all runs", "effective wheel distance"] == pytest.approx(0.12, rel=0.05)
    assert done[-1] == 1.0
    assert [path.name for path in result.pictures] == ["real_logs.png"]
    assert (out / "real_logs.png").read_bytes().startswith(b"\x89PNG")
    assert "## What can be trusted" in (out / "real_logs.md").read_text(encoding="utf-8")
    # A run without truth cannot be scored; the others can.
    (data / "run3.csv").write_bytes((data / "run2.csv").read_bytes())
    assert "Left out, without truth: run3.csv." in real_logs.run(Context(out)).notes
    (data / "truth2.csv").unlink()
    (row,) = real_logs.run(Context(out)).rows
    assert f"1 runs with truth in {data}" in row.explanation
