# SPDX-License-Identifier: MIT
"""Tables as they stand on the page, and the page that they are put into."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from bench.__main__ import BENCHMARKS, PAGE, parse, save
from bench.filter_study import LANES, PLAIN, SIMD, SINGLE, duration, lead
from bench.tables import Row, Table, shown, with_ratios, write_page
from hil_sim.speed import Spread
from tests.parity.budget_page import replace_block

ROWS = [Row("ours", {"ns": 4.0}), Row("theirs", {"ns": 10.0}), Row("else", {"ns": "not installed"})]
TABLE = Table("speed", "a step", ("ns", "× ours"), with_ratios(ROWS, "ns", "ours", "× ours"), "seed 1")
MACHINE = "<!-- bench-machine -->\nold\n<!-- /bench-machine -->"
PAGE_TEXT = f"# Page\n{MACHINE}\nmiddle\n<!-- bench-speed -->\n<!-- /bench-speed -->\nend\n"


@pytest.mark.parametrize(
    ("cell", "text"),
    [(1234.5, "1230"), (12.345, "12.3"), (0.00123, "0.00123"), (1e7, "10000000"), (0.0, "0"), (None, ""), ("a", "a")],
)
def test_figures_have_three_digits(cell: float | str | None, text: str) -> None:
    assert shown(cell) == text


@pytest.mark.parametrize(("seconds", "text"), [(2.34, "2.3 s"), (150.0, "2.5 min"), (9000.0, "2.5 h"), (4e5, "4.6 d")])
def test_times_have_the_unit_that_suits_them(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_ratios_are_in_units_of_ours() -> None:
    assert [row.cells["× ours"] for row in TABLE.rows] == [1.0, 2.5, None]
    with pytest.raises(TypeError, match="not a figure to compare with"):
        with_ratios(ROWS, "ns", "else", "×")


def test_the_lead_of_native_peers_is_told_by_the_least_times() -> None:
    times = {LANES: 0.1, SIMD: 0.02, SINGLE: 0.0125, PLAIN: 0.43}
    told = lead({name: Spread((time * 1.5, time, time * 2.0)) for name, time in times.items()})
    assert "5.0 times as long as the SIMD program in double precision, 8.0 times" in told
    assert "Plain C takes 4.3 times as long as ours." in told


def test_the_page_gets_the_tables_and_keeps_everything_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE_TEXT)
    write_page(page, "a machine", [TABLE])
    text = page.read_text()
    assert text.startswith("# Page\n<!-- bench-machine -->\na machine\n<!-- /bench-machine -->\nmiddle\n")
    assert (
        "| theirs | 10 | 2.5 |\n| else | not installed |  |\n\n*seed 1 a machine.*\n<!-- /bench-speed -->\nend\n"
        in text
    )
    write_page(page, "a machine", [TABLE])
    assert page.read_text() == text


def test_a_page_without_markers_stays_as_it_was(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE_TEXT.replace("/bench-speed", "bench-fast"))
    before = page.read_text()
    with pytest.raises(ValueError, match="bench-speed"):
        write_page(page, "a machine", [TABLE])
    assert page.read_text() == before


def test_markers_that_stand_twice_are_refused() -> None:
    with pytest.raises(ValueError, match="once each"):
        replace_block(PAGE_TEXT + PAGE_TEXT, "bench-speed", [])


def test_figures_are_saved_unrounded(tmp_path: Path) -> None:
    path = tmp_path / "new" / "result.json"
    save(path, "a machine", 7, [TABLE])
    saved = json.loads(path.read_text())
    assert saved["seed"] == 7
    assert saved["tables"]["speed"]["rows"]["theirs"] == {"ns": 10.0, "× ours": 2.5}


def test_short_runs_do_not_get_onto_the_page() -> None:
    with pytest.raises(SystemExit):
        parse(["--quick", "--write"])
    assert parse([]).only == list(BENCHMARKS)


def test_the_real_page_has_a_place_for_every_table() -> None:
    text = PAGE.read_text()
    for name in (
        "machine",
        "loops",
        "ticks",
        "memory",
        "filter-study",
        "pose",
        "motor",
        "law",
        "download",
        "bus",
    ):
        replace_block(text, f"bench-{name}", [])
