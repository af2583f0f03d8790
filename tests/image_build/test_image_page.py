# SPDX-License-Identifier: MIT
"""docs/checks/image.md names every check there is, and all that the model of the chip leaves out."""

from __future__ import annotations

from image_check import page


def test_the_page_is_what_the_code_says() -> None:
    text = page.PAGE.read_text(encoding="utf-8")
    assert page.filled_in(text) == text, "write it anew: python -m image_check.page --write"


def test_a_page_that_is_behind_is_noticed() -> None:
    text = page.PAGE.read_text(encoding="utf-8")
    behind = text.replace("| `motors-off` |", "| `motors-on` |")
    assert behind != text
    assert page.filled_in(behind) == text
