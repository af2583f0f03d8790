# SPDX-License-Identifier: MIT
"""What plots show: the range of a constant, gaps in the telemetry, curves that can be told apart."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.studio.parts import WAIT_MS, let_live, studio, until
from tests.studio.recorded import without, write_run

HOLE_S = (4.0, 6.0)


@pytest.fixture(scope="module")
def runs(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """A page that lists three runs; the telemetry of one has a hole."""
    root = tmp_path_factory.mktemp("kept") / "runs"
    write_run(root / "one", gain=4.0, seconds=10.0)
    write_run(root / "other", gain=12.0, seconds=10.0)
    write_run(root / "hole", gain=4.0, seconds=10.0)
    log = root / "hole" / "telemetry.tlog"
    log.write_bytes(without(log.read_bytes(), *HOLE_S))
    with studio("--out", str(root)) as program:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(WAIT_MS)
        page.goto(program.url)
        until(page, "document.querySelectorAll('#run-list tbody tr').length === 3")
        yield page
        page.close()


@pytest.mark.parametrize(
    ("low", "high", "expected"), [(0, 0, [-1, 1]), (5, 5, [4.5, 5.5]), (-2, -2, [-2.2, -1.8]), (None, None, [-1, 1])]
)
def test_a_constant_lies_in_the_middle_of_its_axis(
    shared_page: Page, low: float | None, high: float | None, expected: list[float]
) -> None:
    found = shared_page.evaluate(
        "async ([low, high]) => (await import('/page/curves.js')).y_range(null, low, high)", [low, high]
    )
    assert found == pytest.approx(expected)


INK = """([page, time]) => {
    const canvas = document.querySelector(`${page} canvas`);
    const over = document.querySelector(`${page} .u-over`).getBoundingClientRect();
    const box = canvas.getBoundingClientRect();
    const { begin, end } = { begin: 0, end: 10 };
    const scale = canvas.width / box.width;
    const x = Math.round((over.left - box.left + (over.width * (time - begin)) / (end - begin)) * scale);
    const { data } = canvas.getContext("2d").getImageData(x, (over.top - box.top) * scale, 1, over.height * scale);
    let inked = 0;
    for (let at = 0; at < data.length; at += 4) {
        const [red, green, blue, alpha] = data.slice(at, at + 4);
        inked += alpha > 60 && Math.max(red, green, blue) - Math.min(red, green, blue) > 60;
    }
    return inked;
}"""
"""How many pixels of a plot's column at a time [s] are coloured; the grid is grey."""


def test_a_gap_in_the_telemetry_is_not_bridged_by_a_line(runs: Page) -> None:
    runs.get_by_label("Open hole").click()
    until(runs, "studio.runs.plots.samples_of('0|tracking.pose.x').time.length > 100")
    let_live(runs, 100)  # two frames
    ink = [runs.evaluate(INK, ["#run-panels", time]) for time in (2.03, 5.03, 8.03)]
    assert ink[0] > 0
    assert ink[1] == 0, "inside the hole"
    assert ink[2] > 0


def test_signals_at_different_times_and_a_slow_link_are_no_gaps(shared_page: Page) -> None:
    found = shared_page.evaluate(
        """async () => {
            const { aligned, with_gap } = await import("/page/buffers.js");
            const slow = with_gap({ time: [0, 1, 2, 3, 5], value: [1, 2, 3, 4, 5] });
            const [, ...columns] = aligned([with_gap({ time: [0, 0.1, 0.2, 3], value: [1, 1, 1, 1] }), slow]);
            return [slow.value, columns.map((column) => column.filter((value) => value === null).length)];
        }"""
    )
    assert found == [[1, 2, 3, 4, 5], [1, 0]]


def test_the_curves_of_two_runs_are_told_apart(runs: Page) -> None:
    runs.get_by_label("Open one").click()
    until(runs, "studio.runs.shown.length === 1 && studio.runs.shown[0] === 'run:one'")
    runs.get_by_label("Compare other").click()
    until(runs, "studio.runs.shown.length === 2")
    colours = (
        runs.locator("#run-panels .panel")
        .first.locator(".u-series .u-marker")
        .evaluate_all("(marks) => marks.map((mark) => getComputedStyle(mark).borderColor)")[1:]
    )
    assert len(colours) == 8
    assert len(set(colours)) == 8
    looks = runs.evaluate(
        """async () => {
            const { look } = await import("/page/curves.js");
            return [...Array(24).keys()].map((n) => JSON.stringify(look(n, 2)));
        }"""
    )
    assert len(set(looks)) == 24, "12 signals of two logs"


def test_leaving_the_choice_of_signals_by_escape_changes_nothing(shared_page: Page) -> None:
    page = shared_page
    page.evaluate("studio.plots.add(['wheels.speed.2', 'tracking.pose.x'])")
    chosen = "studio.plots.view.plots.at(-1).keys"
    page.get_by_label("Signals of plot").last.click()
    page.check("input[value='wheels.duty.1']")
    page.keyboard.press("Escape")
    until(page, "!document.getElementById('signal-dialog').open")
    assert page.evaluate(chosen) == ["wheels.speed.2", "tracking.pose.x"]
    page.get_by_label("Signals of plot").last.click()
    page.check("input[value='wheels.duty.1']")
    page.click("#close-signals")
    until(page, f"{chosen}.length === 3")
    assert page.evaluate(chosen) == ["wheels.speed.2", "tracking.pose.x", "wheels.duty.1"]
    page.get_by_label("Remove plot").last.click()


def test_numbers_with_three_digits_are_not_clipped(shared_page: Page) -> None:
    for name, most in (("texts", 100), ("bring-up-lines", 99)):
        room = shared_page.evaluate(
            """([name, most]) => {
                const list = document.getElementById(name);
                const style = getComputedStyle(list);
                const context = document.createElement("canvas").getContext("2d");
                context.font = style.font;
                return parseFloat(style.paddingLeft) - context.measureText(`${most}. `).width;
            }""",
            [name, most],
        )
        assert room >= 0, name
