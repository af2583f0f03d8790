# SPDX-License-Identifier: MIT
"""The texts of the firmware stand on the troubleshooting page: those in firmware/app of two words or more."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ("troubleshooting.md", "guides/gyro.md", "guides/floor-motion.md")
"""The others have the texts of a sensor's chip; the first one links there."""
PAGE = " ".join(" ".join((ROOT / "docs" / name).read_text(encoding="utf-8") for name in PAGES).split())
LITERAL = re.compile(r'"((?:[^"\\\n])+)"')
SHORTEST = 8
NO_TEXTS = {"fault.cpp", "image_info.cpp"}
"""Numbers of a crash, and what describes an image."""
ELSEWHERE = {
    "WHEELS, W*_ANGLE",  # the name in `own values do not fit: NAME`
}


def texts(path: Path) -> list[str]:
    """Return the pieces of text in a source file that are words: at least one blank between letters.

    A `#` stands for a byte, whatever it is.
    """
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith(("#", "static_"))]
    lines = [line for line in lines if "static_assert" not in line]
    found = [piece.strip(" :,") for line in lines for text in LITERAL.findall(line) for piece in text.split("#")]
    return [text for text in found if len(text) >= SHORTEST and re.search(r"[a-z] [A-Za-z]", text)]


SOURCES = [path for path in sorted((ROOT / "firmware" / "app").rglob("*.cpp")) if path.name not in NO_TEXTS]


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_each_text_of_the_robot_is_explained(path: Path) -> None:
    assert [text for text in texts(path) if text not in PAGE and text not in ELSEWHERE] == []


def test_there_are_texts() -> None:
    assert sum(len(texts(path)) for path in SOURCES) > 80
