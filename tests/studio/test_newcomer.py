# SPDX-License-Identifier: MIT
"""A newcomer's whole way, in a real browser: first start, drive, tune, autotune, compare, save, come back."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import Page

from tests.studio.parts import Opener, studio, until
from tests.studio.test_page import arm, set_gain

GAIN = "ISMC_LAM_XY"
LONG_S = 900.0
"""For what takes minutes on a busy computer."""
RECORDED = "state.recording.completed"


def connect(page: Page) -> None:
    page.click("#welcome-connect")
    until(page, "document.getElementById('scenario').options.length > 0")
    page.select_option("#scenario", "fast")
    page.click("#simulate-form button")
    until(page, "state.link.phase === 'connected' && robot?.pose?.[0] > 0.9")  # with its first fix
    assert page.is_hidden("#welcome")


def drive_recorded(page: Page) -> None:
    """Record the path that the robot proposes, from arming to its end."""
    assert page.input_value("#path") == "rose"
    done = page.evaluate(f"studio.{RECORDED}")
    page.click("#record")
    until(page, "state.recording.on")
    arm(page)
    page.click("#start-path")
    until(page, "robot.phase === 'path'")
    until(page, "robot.phase === 'done'", LONG_S)
    page.click("#record")
    until(page, f"!state.recording.on && {RECORDED} > {done}", LONG_S)
    page.click("#disarm")
    until(page, "robot.state === 'disarmed'")


def autotune(page: Page) -> None:
    page.select_option("#experiment-kind", "autotune")
    page.get_by_label("Side of the free square").fill("3")
    page.get_by_label("Comparison of old and new gains").select_option(index=0)
    page.click("#experiment-look")
    until(page, "!document.getElementById('experiment-start').disabled")
    page.click("#experiment-start")
    until(page, "state.experiment?.running")
    until(page, "!state.experiment.running", LONG_S)
    assert page.evaluate("studio.state.experiment.trouble") == ""


def compared(page: Page, name: str) -> tuple[float, float]:
    """Return both runs' values of a parameter, as the table of what differs shows them."""
    row = page.locator("#run-compared tr").filter(has=page.get_by_role("cell", name=name, exact=True))
    _, one, other = row.get_by_role("cell").all_text_contents()
    return float(one), float(other)


@pytest.mark.nightly
def test_from_the_first_start_to_the_second(tmp_path: Path, open_page: Opener) -> None:
    with studio("--out", str(tmp_path / "runs")) as program:
        page = open_page(program.url)
        until(page, "state")
        assert "No robot is connected" in (page.text_content("#welcome") or "")
        page.click("#start-path")
        until(page, "document.getElementById('notice').textContent.includes('press Connect first')")
        connect(page)
        drive_recorded(page)
        set_gain(page, GAIN, "7")
        until(page, f"studio.parameters.value_of('{GAIN}') === 7")
        page.keyboard.press("Tab")
        page.click("#undo")
        until(page, f"studio.parameters.value_of('{GAIN}') === 6")
        autotune(page)
        # Autotune goes back where it finds nothing better; the person then tries a gain of their own.
        tuned = 8.0
        set_gain(page, GAIN, "8")
        until(page, f"studio.parameters.value_of('{GAIN}') === 8")
        drive_recorded(page)
        page.get_by_label("Open studio", exact=True).click()
        until(page, "studio.runs.shown.length === 1")
        page.get_by_label("Compare studio-2", exact=True).click()
        until(page, "studio.runs.shown.length === 2 && document.querySelector('#run-compared table')")
        assert page.is_visible("#run-align")
        before, after = compared(page, GAIN)
        assert before == 6
        assert after == pytest.approx(tuned, rel=1e-4)
        page.click("#store")
        until(page, "document.getElementById('notice').textContent.startsWith('Stored')")
        with page.expect_download() as download:
            page.click("#save")
        saved = download.value.path().read_text()
        page.click("#add-xy")
        panels = page.locator("#panels .panel").count()
        page.click("#choose")
        page.click("#disconnect")
        until(page, "state.link.phase === 'none'")
        assert page.text_content("#notice") == ""
    with studio("--out", str(tmp_path / "runs")) as program:
        page = open_page(program.url)
        until(page, "state")
        connect(page)
        assert page.locator("#panels .panel").count() == panels  # the view of this robot
        assert page.evaluate(f"studio.parameters.value_of('{GAIN}')") == 6  # a simulated robot begins anew
        file = {"name": "tuned.toml", "mimeType": "text/plain", "buffer": saved.encode()}
        page.set_input_files("#load", file)
        until(page, f"Math.abs(studio.parameters.value_of('{GAIN}') - {tuned}) < 1e-4")
        page.get_by_label(f"Remove plot {panels}").click()
