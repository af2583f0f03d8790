# SPDX-License-Identifier: MIT
"""After the last fix: slip ratios that return to their mean drift less, and the page says what the command says."""

from __future__ import annotations

import numpy as np
import pytest

from bench.figures import lost_fix as lost_fix_figures
from hil_sim.processes import worker_pool
from tests.native import ROOT

PAGE = ROOT / "docs" / "concepts" / "derivations" / "mean_slip.md"
SEEDS = range(lost_fix_figures.FIRST_SEED, lost_fix_figures.FIRST_SEED + lost_fix_figures.SEEDS)


@pytest.mark.full
@pytest.mark.parametrize("title", ["slip to 30 %, drawn each second", "no slip"])
def test_a_return_to_the_mean_drifts_less(title: str) -> None:
    """The position after 30 s, in the worlds where it is worth most; seeds of neither page nor choice."""
    setting = next(each for each in lost_fix_figures.SETTINGS if each.title == title)
    stays, returns = (
        np.sqrt(np.mean([lost_fix_figures.drift(setting, parameters, seed)[-1, 0] ** 2 for seed in range(1, 13)]))
        for parameters in ({"EKF_RETURN": 0.0}, {})
    )
    assert returns < 0.9 * stays


def test_the_page_has_a_line_for_each_world() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert lost_fix_figures.head() in page
    for setting in lost_fix_figures.SETTINGS:
        assert f"| {setting.title} | " in page


@pytest.mark.full
def test_the_command_prints_the_table(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    fast = lost_fix_figures.SETTINGS[-1:]
    monkeypatch.setattr(lost_fix_figures, "SETTINGS", fast)
    lost_fix_figures.main(["--seeds", "2"])
    first = lost_fix_figures.FIRST_SEED
    with worker_pool() as pool:
        row = lost_fix_figures.row(fast[0], range(first, first + 2), pool)
    assert capsys.readouterr().out == f"{lost_fix_figures.head()}\n{row}\n"
    with pytest.raises(SystemExit, match="2"):
        lost_fix_figures.main(["--seeds", "0"])


@pytest.mark.nightly
def test_the_page_says_what_the_command_says() -> None:
    page = PAGE.read_text(encoding="utf-8")
    with worker_pool() as pool:
        for setting in lost_fix_figures.SETTINGS:
            assert lost_fix_figures.row(setting, SEEDS, pool) in page
