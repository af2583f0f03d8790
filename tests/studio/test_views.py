# SPDX-License-Identifier: MIT
"""XY plots, and what the plots of a robot show: kept on the computer and there again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from omni.studio.actions import BadRequestError
from omni.studio.views import LONGEST_KEY, MOST_PLOTS, checked_view, read_view, view_file, write_view
from omniwheel.errors import OutputFileError
from tests.studio.parts import Opener, Program, take_over, until

PLOT = {"keys": ["tracking.pose.x"], "xy": False}
VIEW = {"plots": [PLOT, {"keys": ["tracking.pose.x", "tracking.pose.y"], "xy": True}], "span_s": 30.0}


def test_a_view_is_written_and_read_again(tmp_path: Path) -> None:
    path = view_file(tmp_path / "history" / "robot-42.jsonl", "")
    assert path == tmp_path / "views" / "robot-42.json"
    assert view_file(tmp_path / "history" / "link-tcp.jsonl", "/some/where/fast.toml").stem == "simulated-fast"
    assert read_view(path) is None
    write_view(path, checked_view({**VIEW, "more": "is left out"}))
    assert read_view(path) == VIEW
    for broken in ("", "[", "null", '{"plots": 1}', json.dumps({**VIEW, "span_s": -1})):
        path.write_text(broken)
        assert read_view(path) is None


def test_a_view_that_cannot_be_kept_is_said(tmp_path: Path) -> None:
    (tmp_path / "views").write_text("a file where the folder should be")
    with pytest.raises(OutputFileError):
        write_view(tmp_path / "views" / "robot-42.json", VIEW)


@pytest.mark.parametrize(
    "view",
    [
        None,
        {},
        {"plots": [PLOT]},
        {"plots": [PLOT], "span_s": "10"},
        {"plots": [PLOT], "span_s": True},
        {"plots": [PLOT], "span_s": 0},
        {"plots": [PLOT], "span_s": float("inf")},
        {"plots": [PLOT] * (MOST_PLOTS + 1), "span_s": 10},
        {"plots": [{"keys": ["a" * (LONGEST_KEY + 1)], "xy": False}], "span_s": 10},
        {"plots": [{"keys": ["a"] * 13, "xy": False}], "span_s": 10},
        {"plots": [{"keys": ["a"], "xy": True}], "span_s": 10},
        {"plots": [{"keys": [1], "xy": False}], "span_s": 10},
        {"plots": [["a"]], "span_s": 10},
    ],
)
def test_nonsense_is_not_kept(view: Any) -> None:
    with pytest.raises(BadRequestError):
        checked_view(view)


def test_an_xy_plot_and_the_span_are_there_again_in_another_browser(shared_studio: Program, open_page: Opener) -> None:
    page = open_page(shared_studio.url)
    until(page, "robot?.pose && state.link.phase === 'connected'")
    take_over(page)  # the page of the test before may still be there, and only the one that commands keeps its view
    until(page, "state.commands === 'this page'")
    number = page.locator("#panels .panel").count() + 1
    page.click("#add-xy")
    page.get_by_label(f"x of XY plot {number}").select_option("tracking.reference.x")
    page.get_by_label(f"y of XY plot {number}").select_option("tracking.reference.y")
    page.select_option("#span", "5")
    until(page, "studio.plots.samples_of('tracking.reference.y').time.length > 10")
    wanted = page.evaluate("studio.plots.view")
    assert wanted["plots"][-1] == {"keys": ["tracking.reference.x", "tracking.reference.y"], "xy": True}
    other = open_page(shared_studio.url)  # which remembers nothing itself
    until(other, "studio.plots.view.span_s === 5")
    assert other.evaluate("studio.plots.view") == wanted
    assert other.input_value("#span") == "5"
    assert other.locator("#panels .panel").count() == number
    pairs = "async () => (await import('/page/xy.js')).paired([1, undefined, 2, 3], [undefined, 5, undefined, 6])"
    assert page.evaluate(pairs) == {"x": [1, 2, 3], "y": [5, 5, 6]}
    page.get_by_label(f"Remove plot {number}").click()
    page.select_option("#span", "10")
