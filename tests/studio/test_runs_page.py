# SPDX-License-Identifier: MIT
"""A person and earlier drives: recorded, listed, opened and compared at the page, in a real browser."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page

from tests.studio.parts import Opener, Program, running, studio, until
from tests.studio.recorded import GAIN, write_run

WHOLE = "studio.runs.plots.samples_of('0|tracking.pose.x').time"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("kept") / "runs"
    write_run(root / "slow", gain=4.0, seconds=20.0, began="2026-01-01T10:00:00+00:00")
    write_run(root / "quick", gain=12.0, seconds=10.0, began="2026-01-02T10:00:00+00:00")
    return root


@pytest.fixture(scope="module")
def program(folder: Path) -> Iterator[Program]:
    """A studio without a robot."""
    with studio("--out", str(folder)) as found:
        yield found


@pytest.fixture
def page(program: Program, open_page: Opener) -> Page:
    found = open_page(program.url)
    until(found, "document.querySelectorAll('#run-list tbody tr').length === 2")
    return found


def let_pass(page: Page, seconds: float) -> None:
    """Wait until the robot's clock has gone on."""
    until(page, f"studio.plots.newest > {page.evaluate('studio.plots.newest') + seconds}")


RMSE = {"position_rmse_m": 0.37e-3, "heading_rmse_rad": 0.01, "largest_error_m": 1e-3}


def test_errors_in_the_pose_say_what_they_were_measured_by(tmp_path: Path, open_page: Opener) -> None:
    write_run(tmp_path / "path", 4.0, 2.0, asked="trajectory rose", numbers=RMSE)
    write_run(tmp_path / "keys", 4.0, 2.0, asked="recorded in the studio", numbers=RMSE)
    write_run(tmp_path / "recorded", 4.0, 2.0, asked="recorded in the studio, trajectory", numbers=RMSE)
    write_run(tmp_path / "step", 4.0, 2.0, asked="wheel-step", numbers=RMSE)
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "summary.json").write_text(json.dumps(DEMO))
    with studio("--out", str(tmp_path)) as program:
        page = open_page(program.url)
        until(page, "document.querySelectorAll('#run-list tbody tr').length === 5")
        figures = dict(
            zip(names(page), page.locator("#run-list tbody tr td:nth-child(5)").all_text_contents(), strict=True)
        )
        assert {name for name, text in figures.items() if "RMSE" in text} == {"path", "recorded", "demo"}
        assert "0.37 mm (robot's own estimate)" in figures["path"]
        assert "2.28 mm (true pose)" in figures["demo"]
        page.get_by_label("Open path").click()
        until(page, "studio.runs.shown.length === 1")
        page.get_by_label("Compare step").click()
        until(page, "document.querySelector('#run-compared table')")
        row = page.locator("#run-compared tr", has_text="position RMSE").locator("td").all_text_contents()
        assert row == ["position RMSE [mm]", "0.37 (robot's own estimate)", "–"]


DEMO = {
    "scenario": "fast",
    "seed": 1,
    "robot": "three_wheel",
    "duration_s": 10.0,
    "completed": True,
    "faults": [],
    "parameters": {},
    "rmse": {"position_m": 2.28e-3, "theta_rad": 0.01},
    "effort": {"peak_wheel_rad_s": 5.0},
}
"""What of a simulated run's summary the list reads."""


def names(page: Page) -> list[str]:
    return list(page.locator("#run-list tbody tr td:first-child").all_text_contents())


def test_runs_are_listed_newest_first_and_found(page: Page, folder: Path) -> None:
    assert names(page) == ["quick", "slow"]
    row = page.locator("#run-list tbody tr").first.text_content() or ""
    assert "duration 10 s" in row
    assert "tcp:" in row
    assert str(folder) in (page.text_content("#run-hint") or "")
    page.fill("#run-search", "slow")
    until(page, "document.querySelectorAll('#run-list tbody tr').length === 1")
    assert names(page) == ["slow"]


def test_a_run_is_opened_zoomed_and_saved(page: Page) -> None:
    page.get_by_label("Open slow").click()
    until(page, f"{WHOLE}.length > 100")
    times = page.evaluate(WHOLE)
    assert times[0] == pytest.approx(0.0, abs=0.01)
    assert times[-1] == pytest.approx(20.0, abs=0.1)
    marks = page.evaluate("studio.runs.plots.marked")
    assert [mark["changes"][GAIN] for mark in marks if GAIN in mark["changes"]] == [[4.0, 5.0]]
    assert "state armed" in [mark.get("text") for mark in marks]
    page.locator("#run-panels .u-over").first.hover()
    page.mouse.wheel(0, -600)
    until(page, "studio.runs.plots.paused")
    assert page.is_enabled("#run-whole")
    page.click("#run-whole")
    until(page, "!studio.runs.plots.paused")
    with page.expect_download() as download:
        page.click("#run-csv")
    lines = download.value.path().read_text().splitlines()
    assert lines[0].startswith("time [s],0|tracking.pose.x [m]")
    assert len(lines) > 100
    page.click("#run-close")
    assert page.is_hidden("#run-view")


def test_two_runs_are_laid_over_each_other_with_what_differs(page: Page) -> None:
    page.get_by_label("Open slow").click()
    until(page, "studio.runs.shown.length === 1")
    page.get_by_label("Compare quick").click()
    until(page, "studio.runs.shown.length === 2 && document.querySelector('#run-compared table')")
    until(page, "studio.runs.plots.samples_of('1|tracking.pose.x').time.length > 100")
    until(page, f"{WHOLE}.length > 100")
    table = page.text_content("#run-compared") or ""
    assert "duration [s]2010" in table
    assert f"{GAIN}412" in table
    legend = page.locator("#run-panels .u-legend").first.text_content() or ""
    assert "A: pose x" in legend
    assert "B: pose x" in legend


def test_a_plot_of_what_one_run_does_not_hold_is_there_again_with_the_next(page: Page) -> None:
    wanted = ["truth.pose.x", "tracking.pose.x"]
    page.evaluate("(keys) => localStorage.setItem('omniwheel-run-plots', JSON.stringify([keys]))", wanted)
    page.get_by_label("Open slow").click()
    until(page, "studio.runs.plots.keys.length === 1")
    assert page.evaluate("studio.runs.plots.keys") == ["0|tracking.pose.x"]
    assert page.evaluate("studio.runs.plots.view.plots[0].keys") == wanted
    assert page.evaluate("JSON.parse(localStorage.getItem('omniwheel-run-plots'))") == [wanted]


def test_a_log_from_elsewhere_is_opened_and_a_broken_one_is_said(page: Page, folder: Path) -> None:
    log = (folder / "quick" / "telemetry.tlog").read_bytes()
    page.set_input_files("#run-file", {"name": "mine.tlog", "mimeType": "", "buffer": log})
    until(page, "studio.runs.shown[0]?.startsWith('file:')")
    until(page, f"{WHOLE}.length > 100")
    page.set_input_files("#run-file", {"name": "no.tlog", "mimeType": "", "buffer": b"what is this?" * 1000})
    until(page, "document.getElementById('notice').textContent.includes('2.tlog')")
    assert page.evaluate(f"{WHOLE}.length") > 100  # what was open still is
    hole = log[:5000] + b"\0" * 500 + log[5500:]
    page.set_input_files("#run-file", {"name": "hole.tlog", "mimeType": "", "buffer": hole})
    until(page, "document.getElementById('notice').textContent.includes('hole.tlog is damaged')")
    until(page, f"{WHOLE}.length > 100")


@pytest.mark.parametrize("colours", ["light", "dark"])
@pytest.mark.parametrize("width", [1500, 390])
def test_runs_can_be_used_by_keyboard_and_screen_reader(
    program: Program, browser: Browser, colours: Literal["light", "dark"], width: int
) -> None:
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=colours)
    page.goto(program.url)
    page.get_by_label("Open slow").click()
    until(page, "studio.runs.shown.length === 1")
    page.get_by_label("Compare quick").click()
    until(page, "document.querySelector('#run-compared table')")
    found = Axe().run(page).response["violations"]
    wide = page.evaluate("document.documentElement.scrollWidth")
    page.close()
    assert [(one["id"], one["help"], [node["html"] for node in one["nodes"]]) for one in found] == []
    assert wide <= width


def test_a_recording_is_started_seen_ended_and_opened(tmp_path: Path, open_page: Opener) -> None:
    with studio("sitl", "--out", str(tmp_path / "runs")) as program:
        page = open_page(program.url)
        until(page, "robot?.pose")
        assert (page.text_content("#fact-recording") or "").startswith("off")
        page.click("#record")
        until(page, "state.recording.on")
        assert str(tmp_path / "runs" / "studio") in (page.text_content("#fact-recording") or "")
        let_pass(page, 1.5)
        page.click("#record")
        until(page, "!state.recording.on")
        page.get_by_label("Open studio").click()
        until(page, f"{WHOLE}.length > 20")
        program.end()
    document = json.loads((tmp_path / "runs" / "studio" / "drive.json").read_text())
    assert (document["end"], document["asked"]) == ("done", "recorded in the studio"), "it has followed no poses"
    assert document["numbers"]["duration_s"] > 1.0
    assert (tmp_path / "runs" / "studio" / "run.png").is_file()


def test_a_lost_robot_ends_the_recording_which_is_kept(tmp_path: Path, open_page: Opener) -> None:
    link = str(tmp_path / "robot")
    with studio("--link", link, "--out", str(tmp_path / "runs")) as program:
        page = open_page(program.url)
        assert page.is_disabled("#record")
        with running("sitl", "--link", f"pty:{link}"):
            until(page, "robot?.pose")
            page.click("#record")
            until(page, "state.recording.on")
            let_pass(page, 1.0)
        until(page, "!state.recording.on")
        until(page, "document.querySelector('#run-list tbody')?.textContent.includes('the link was lost')")
        page.get_by_label("Open studio").click()
        until(page, f"{WHOLE}.length > 20")


def test_a_comparison_that_comes_late_is_not_shown_beside_other_runs(page: Page) -> None:
    page.evaluate(
        """() => { const { socket } = studio.runs, ask = socket.ask.bind(socket);
        socket.ask = (action, content) => (action === "compare_runs"
          ? new Promise((done) => { window.answer = () => done({ numbers: [["late", "1", "2"]], parameters: [] }); })
          : ask(action, content)); }"""
    )
    page.get_by_label("Open slow").click()
    until(page, "studio.runs.shown.length === 1")
    page.get_by_label("Compare quick").click()
    until(page, "studio.runs.shown.length === 2 && window.answer")
    page.get_by_label("Open quick").click()
    until(page, "studio.runs.shown.length === 1")
    page.evaluate("async () => { window.answer(); await new Promise((done) => setTimeout(done, 100)); }")
    assert page.text_content("#run-compared") == ""
