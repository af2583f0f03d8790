# SPDX-License-Identifier: MIT
"""The memory table of the docs is what the build takes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.boards.teensy40.platformio_module import load
from tests.image_build import memory_page
from tests.image_build.memory_page import BLOCK, block, difference
from tests.parity.budget_page import replace_block

budget = load("memory_budget")
KB = budget.KB
USAGE = budget.Usage(flash=178 * KB, itcm=148 * KB, dtcm=85 * KB, ram2=12 * KB)
GCC_12, GCC_15 = "arm-none-eabi-gcc 12.2.1", "arm-none-eabi-gcc 15.2.1"


def page(lines: Sequence[str]) -> str:
    return replace_block(f"before\n<!-- {BLOCK} -->\n<!-- /{BLOCK} -->\nafter", BLOCK, lines)


def test_the_page_that_was_written_says_what_was_measured() -> None:
    measured = block(USAGE, "three_wheel", GCC_12)
    assert "| ITCM | 148 | 192 | 512 |" in measured[5]
    assert "267 left" in measured[-1]
    assert difference(page(measured), measured) == ""


def test_another_figure_of_the_same_compiler_is_a_difference() -> None:
    grown = budget.Usage(flash=190 * KB, itcm=148 * KB, dtcm=85 * KB, ram2=12 * KB)
    written = page(block(USAGE, "three_wheel", GCC_12))
    assert memory_page.COMMAND in difference(written, block(grown, "three_wheel", GCC_12))
    assert difference(written, block(grown, "three_wheel", GCC_15)) == ""


def test_another_budget_or_no_table_is_a_difference_whatever_the_compiler() -> None:
    measured = block(USAGE, "three_wheel", GCC_15)
    written = page([line.replace("| 160 |", "| 170 |") for line in block(USAGE, "three_wheel", GCC_12)])
    assert difference(written, measured)
    assert difference(page([]), measured)


def test_the_command_compares_and_writes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "page.md"
    monkeypatch.setattr(memory_page, "PAGE", path)
    monkeypatch.setattr(memory_page, "measure", lambda _: block(USAGE, "three_wheel", GCC_12))
    path.write_text(page([]))
    assert memory_page.main([]) == 1
    assert memory_page.COMMAND in capsys.readouterr().err
    assert memory_page.main(["--write"]) == 0
    assert memory_page.main([]) == 0


def test_an_image_or_a_compiler_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert memory_page.main(["--environment", "none"]) == 1
    assert "make firmware ROBOT=none" in capsys.readouterr().err
    monkeypatch.setenv("PLATFORMIO_CORE_DIR", str(tmp_path))
    with pytest.raises(memory_page.MeasureError, match="PLATFORMIO_CORE_DIR"):
        memory_page.toolchain()


def test_the_page_has_a_place_for_the_table() -> None:
    text = memory_page.PAGE.read_text()
    assert replace_block(text, BLOCK, ["x"]) != text
