# SPDX-License-Identifier: MIT
"""The pages' pictures are of today: the numbers behind each are still what its command prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs import pictures

DOCS = pictures.IMAGES.parent
NIGHTLY = {"montecarlo.png"}
OF_THE_PAGE = {"studio.png"}
"""Taken in a browser; tests/studio/test_picture.py says when it is old."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.nightly] * (name in NIGHTLY)) for name in pictures.PICTURES]
)
def test_a_picture_shows_what_its_command_does_today(name: str, tmp_path: Path) -> None:
    """After a change: ``python -m tests.docs.pictures --write``."""
    file, numbers = pictures.made(name, tmp_path)
    assert file.read_bytes().startswith(b"\x89PNG")
    assert numbers == pictures.kept()[name]


def test_every_drawn_picture_of_a_page_is_made_by_a_command() -> None:
    """Those of the report's page come from ``omni reproduce``; wiring diagrams have a test of their own."""
    pages = [path for path in DOCS.rglob("*.md") if path.name != "results.md"]
    shown = {name for page in pages for name in re.findall(r"images/(\w+\.png)\)", page.read_text(encoding="utf-8"))}
    assert shown - OF_THE_PAGE == set(pictures.PICTURES) == set(pictures.kept())


def test_the_curves_of_the_comparison_differ() -> None:
    """A picture with two curves on each other shows nothing."""
    numbers = pictures.kept()["tune.png"]
    assert numbers["after.rise_s"] > 1.5 * numbers["before.rise_s"]


def test_another_number_is_noticed() -> None:
    assert dict(pictures._numbers({"a": {"b": [1.0000001, True, "x"]}})) == {"a.b.0": 1.0}
    assert dict(pictures._numbers({"a": 1.0001})) != dict(pictures._numbers({"a": 1.0}))
