# SPDX-License-Identifier: MIT
"""The original law: what floor, firmware faults and sensors cost, and that the page tells the figures of today."""

from __future__ import annotations

from pathlib import Path

import pytest

from omni_reproduce import original_law
from omni_reproduce.experiment import Context, read_spec

pytestmark = pytest.mark.nightly  # minutes of a whole robot's ticks

SPEC = read_spec("original_law")
PAGE = (Path(__file__).resolve().parents[2] / "docs/report/report-map.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def figures(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], float]:
    result = original_law.run(Context(tmp_path_factory.mktemp("original")))
    return {(row.setting, row.quantity.split(", ")[1]): float(row.ours or "nan") for row in result.rows}


def test_the_chatter_costs_what_the_floor_does_not_hold(figures: dict[tuple[str, str], float]) -> None:
    slips, grips = (f"whole robot, friction coefficient {value}" for value in (0.6, 10))
    assert figures[slips, "truth"] > 20.0 * figures[grips, "truth"]
    assert figures[slips, "own odometry"] < 1.0
    assert figures[grips, "own odometry"] < 1.0


def test_what_is_missing_in_the_feed_forward_is_left_over_lambda(figures: dict[tuple[str, str], float]) -> None:
    assert figures["law alone, mended", "truth"] < 1.5
    once, twice = (figures[f"law alone, without feed-forward{more}", "truth"] for more in ("", ", λ = 7 as earlier"))
    assert twice == pytest.approx(2.0 * once, rel=0.1)
    assert 14.0 < figures["law alone, with its parser's feed-forward", "truth"] < 20.0, "known of that firmware"


def test_the_page_tells_the_figures_of_today(figures: dict[tuple[str, str], float]) -> None:
    def told(setting: str, source: str = "truth", digits: int = 1) -> str:
        return f"{figures[setting, source]:.{digits}f} mm"

    whole = "whole robot, friction coefficient"
    slips = f"{told(f'{whole} 0.6', digits=0)} | {told(f'{whole} 0.6', 'own odometry')}"
    assert f"| friction coefficient 0.6 (the robot file's) | {slips} |" in PAGE
    assert f"| friction coefficient 10 | {told(f'{whole} 10')} | {told(f'{whole} 10', 'own odometry')} |" in PAGE
    for law in SPEC["alone"]["law"].values():
        assert f"| {law['title']} | {told('law alone, ' + law['title'])} |" in PAGE
    words = " ".join(PAGE.split())
    assert f"{told('scenario original_law', digits=0)} over {SPEC['experiment']['seeds']} seeds" in words
    assert f"the same law is off by {told('scenario original_law_fixes')}" in words
