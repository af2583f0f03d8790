# SPDX-License-Identifier: MIT
"""The page of figures says what was wanted, and whether it is reached."""

from __future__ import annotations

import re

import pytest

from tests.studio.figures import FIGURES, PAGE, all_reached, blocks_of, memory_rows, rows
from tests.studio.memory import growth_per_hour


def _block(name: str) -> list[str]:
    text = PAGE.read_text()
    return text.split(f"<!-- {name} -->")[1].split(f"<!-- /{name} -->")[0].strip().splitlines()


def test_the_page_admits_what_is_missed() -> None:
    written = _block("studio-speed")[2:]
    assert len(written) == len(FIGURES)
    for figure, line in zip(FIGURES, written, strict=True):
        what, measured, wanted, missed = (cell.strip() for cell in line.strip("|").split("|"))
        assert what == figure.what
        assert wanted.endswith(f"{figure.wanted:g} {figure.unit}")
        assert missed == ("" if figure.reached(float(measured.split()[0])) else "missed")


def test_the_page_says_how_memory_grows() -> None:
    last = _block("studio-memory")[-1]
    growth = [float(found) for found in re.findall(r"([+-]\d+\.\d+) MB/h", last)]
    assert len(growth) == 2


def _measured(factor: float) -> dict[str, object]:
    found: dict[str, object] = {}
    for figure in FIGURES:
        *outer, name = figure.path.split(".")
        place = found
        for key in outer:
            place = place.setdefault(key, {})  # type: ignore[assignment]
        place[name] = figure.wanted / figure.factor * (1 / factor if figure.at_least else factor)
    return found


@pytest.mark.parametrize(("factor", "missed"), [(0.9, False), (1.1, True)])
def test_rows_say_what_is_missed(factor: float, missed: bool) -> None:
    assert all(line.endswith("| missed |") is missed for line in rows(_measured(factor))[2:])


def test_growth_is_that_of_the_later_half() -> None:
    memory = [{"hours": n / 4, "server_MB": 100.0 + (n if n < 8 else 8), "page_MB": 4.0 + n / 4} for n in range(17)]
    assert growth_per_hour(memory, "server_MB") == pytest.approx(0.0, abs=1e-9)
    assert growth_per_hour(memory, "page_MB") == pytest.approx(1.0)
    lines = memory_rows({"rows": memory, "growth_MB_per_h": {"server_MB": 0.0, "page_MB": 1.0}})
    assert lines[-2].startswith("| 4 h | 108 MB |")


@pytest.mark.parametrize(("growth_MB_per_h", "flat"), [(0.1, True), (0.6, False)])
def test_a_part_by_itself_fills_its_own_table(growth_MB_per_h: float, flat: bool) -> None:
    row = {"hours": 8.0, "server_MB": 130.0, "page_MB": 4.0}
    growth = {"server_MB": growth_MB_per_h, "page_MB": 0.0}
    measured = {"memory": {"rows": [row, row], "growth_MB_per_h": growth}}
    assert list(blocks_of(measured)) == ["studio-memory"]
    assert all_reached(measured) is flat
