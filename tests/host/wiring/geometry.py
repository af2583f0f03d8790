# SPDX-License-Identifier: MIT
"""Reads a diagram back from its SVG as rectangles and lines; widths of words are measured with the font itself."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any
from xml.etree import ElementTree as ET

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

_SVG = "{http://www.w3.org/2000/svg}"


@dataclass(frozen=True)
class Box:
    """left, top, right, bottom, and what it is."""

    left: float
    top: float
    right: float
    bottom: float
    what: str

    def overlaps(self, other: Box) -> bool:
        apart = self.right <= other.left or other.right <= self.left
        return not (apart or self.bottom <= other.top or other.bottom <= self.top)

    def inside(self, other: Box) -> bool:
        across = other.left <= self.left and self.right <= other.right
        return across and other.top <= self.top and self.bottom <= other.bottom


class Drawing:
    """``texts``, ``boxes`` (parts and frames), ``discs`` and ``wires`` (pieces of lines, as thin boxes)."""

    def __init__(self, svg: str) -> None:
        root = ET.fromstring(svg)
        width, height = (float(root.get(name, "nan")) for name in ("width", "height"))
        assert root.get("viewBox") == f"0 0 {width:g} {height:g}"
        self.paper = Box(0.0, 0.0, width, height, "paper")
        self.texts = [_text_box(element) for element in root.iter(f"{_SVG}text")]
        rectangles = [element for element in root.iter(f"{_SVG}rect") if element.get("class") != "paper"]
        self.boxes = [_rectangle(element) for element in rectangles]
        self.discs = [_disc(element) for element in root.iter(f"{_SVG}circle")]
        self.wires = [piece for element in root.iter(f"{_SVG}polyline") for piece in _pieces(element)]

    @property
    def words(self) -> list[str]:
        return [text.what for text in self.texts]

    def row_of(self, words: str, *, left: float = 0.0) -> float:
        """Return the height of the only such text right of ``left``."""
        (found,) = [text for text in self.texts if text.what == words and text.left >= left]
        return found.bottom


def _number(element: ET.Element, name: str) -> float:
    return float(element.get(name, "nan"))


@cache
def _extents(words: str, size: float, weight: str) -> tuple[float, float, float]:
    """Return the words' width, and how far they reach below and above their base line."""
    font = FontProperties(family="DejaVu Sans", weight=weight)
    extents: Any = TextPath((0, 0), words, size=size, prop=font).get_extents()
    return extents.width, -extents.y0, extents.y1


def _text_box(element: ET.Element) -> Box:
    words = element.text or ""
    width, below, above = _extents(words, _number(element, "font-size"), element.get("font-weight", "normal"))
    x, y = _number(element, "x"), _number(element, "y")
    left = x - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[element.get("text-anchor", "start")]
    return Box(left, y - above, left + width, y + below, words)


def _rectangle(element: ET.Element) -> Box:
    x, y = _number(element, "x"), _number(element, "y")
    kind = element.get("class", "")
    return Box(x, y, x + _number(element, "width"), y + _number(element, "height"), kind)


def _disc(element: ET.Element) -> Box:
    x, y, r = (_number(element, name) for name in ("cx", "cy", "r"))
    return Box(x - r, y - r, x + r, y + r, element.get("class", ""))


def _pieces(element: ET.Element) -> list[Box]:
    points = [tuple(map(float, pair.split(","))) for pair in element.get("points", "").split()]
    half = _number(element, "stroke-width") / 2
    return [
        Box(min(a[0], b[0]) - half, min(a[1], b[1]) - half, max(a[0], b[0]) + half, max(a[1], b[1]) + half, "wire")
        for a, b in pairwise(points)
    ]
