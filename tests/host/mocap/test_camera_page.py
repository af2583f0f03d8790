# SPDX-License-Identifier: MIT
"""The figures of docs/guides/camera.md are those that the program reaches."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.host.mocap.rendered.accuracy import table

PAGE = Path(__file__).resolve().parents[3] / "docs" / "guides" / "camera.md"


def rows(text: str) -> list[list[float]]:
    """Return the numbers of each row that begins with a picture's size."""
    return [[float(n) for n in re.findall(r"[\d.]+", line)] for line in text.splitlines() if re.match(r"\| \d", line)]


@pytest.mark.nightly
def test_the_table_is_what_the_command_prints() -> None:
    """Another version of OpenCV, or another processor, may move a corner by a little."""
    there, here = rows(PAGE.read_text(encoding="utf-8")), rows(table())
    assert len(there) == len(here) > 0
    for kept, found in zip(there, here, strict=True):
        assert found == pytest.approx(kept, rel=0.1, abs=0.03)
