# SPDX-License-Identifier: MIT
"""A sheet of paper for circuit drawings: few symbols, plain SVG 1.1, text as text, the same bytes for the same calls.

Written with the standard library's XML. A drawing of boxes, lines and words needs no more, and a plotting library's
bytes change with its version. Lines differ in width as well as in colour (Okabe and Ito's, safe for the colour-blind),
so that a black-and-white print says the same.
"""

from __future__ import annotations

import re
import textwrap
from xml.etree import ElementTree as ET

Point = tuple[float, float]

SIGNAL = {"stroke": "#0072b2", "stroke-width": "2"}
SUPPLY = {"stroke": "#000000", "stroke-width": "2.5"}
MOTOR = {"stroke": "#d55e00", "stroke-width": "4"}
OUTLINE = {"stroke": "#000000", "stroke-width": "1.5"}

SIZE = 14
SMALL = 13
LINE_HEIGHT = 1.35
CHARACTER = 0.56
"""Width of a character in ems, on average over a line of words."""
_BEFORE_UNIT = re.compile(r"(?<=\d) (?=(?:mA|A|V|Ω|kΩ|cm|kHz|MHz)\b)")


class Sheet:
    """Collects elements; :meth:`svg` returns the document."""

    def __init__(self, title: str) -> None:
        self._root = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg"})
        self._root.set("font-family", "DejaVu Sans, Verdana, Arial, sans-serif")
        ET.SubElement(self._root, "title").text = title
        self._paper = ET.SubElement(self._root, "rect", {"class": "paper", "x": "0", "y": "0", "fill": "#ffffff"})

    def svg(self, width: float, height: float) -> str:
        """Return the document for this size of paper."""
        for element in (self._root, self._paper):
            element.set("width", _number(width))
            element.set("height", _number(height))
        self._root.set("viewBox", f"0 0 {_number(width)} {_number(height)}")
        ET.indent(self._root)
        return ET.tostring(self._root, encoding="unicode") + "\n"

    def text(
        self, at: Point, words: str, *, anchor: str = "start", size: float = SIZE, bold: bool = False, kind: str = ""
    ) -> None:
        """Write a line; ``at`` is on its base line."""
        attributes = {"x": _number(at[0]), "y": _number(at[1]), "font-size": _number(size), "text-anchor": anchor}
        if bold:
            attributes["font-weight"] = "bold"
        if kind:
            attributes["class"] = kind
        ET.SubElement(self._root, "text", attributes).text = words

    def paragraph(self, at: Point, words: str, width: float, *, size: float = SMALL) -> float:
        """Write lines no longer than ``width``; return the height they take."""
        lines = textwrap.wrap(_BEFORE_UNIT.sub("\u00a0", words), int(width / (CHARACTER * size)))
        for i, line in enumerate(lines):
            self.text((at[0], at[1] + i * LINE_HEIGHT * size), line, size=size)
        return len(lines) * LINE_HEIGHT * size

    def line(self, style: dict[str, str], *points: Point) -> None:
        """Draw a wire through these points."""
        where = " ".join(f"{_number(x)},{_number(y)}" for x, y in points)
        ET.SubElement(self._root, "polyline", {"points": where, "fill": "none", **style})

    def box(self, at: Point, width: float, height: float, *, fill: str = "#f4f4f4") -> None:
        """Draw a part's outline."""
        self._rectangle("box", at, width, height, {"fill": fill, **OUTLINE})

    def frame(self, at: Point, width: float, height: float) -> None:
        """Draw a thick dashed frame around a warning."""
        style = {"fill": "none", "stroke": "#000000", "stroke-width": "3", "stroke-dasharray": "10 5"}
        self._rectangle("frame", at, width, height, style)

    def _rectangle(self, kind: str, at: Point, width: float, height: float, style: dict[str, str]) -> None:
        place = {"x": _number(at[0]), "y": _number(at[1]), "width": _number(width), "height": _number(height)}
        ET.SubElement(self._root, "rect", {"class": kind, **place, **style})

    def circle(self, at: Point, radius: float, *, fill: str = "#ffffff", kind: str = "circle") -> None:
        """Draw a circle."""
        place = {"class": kind, "cx": _number(at[0]), "cy": _number(at[1]), "r": _number(radius)}
        ET.SubElement(self._root, "circle", {**place, "fill": fill, **OUTLINE})

    def dot(self, at: Point) -> None:
        """Join wires that meet here."""
        self.circle(at, 4, fill="#000000", kind="joint")

    def marker(self, at: Point, number: int) -> None:
        """Refer to a note."""
        self.circle(at, 10, kind="marker")
        self.text((at[0], at[1] + 4.5), str(number), anchor="middle", size=12, bold=True)

    def resistor(self, top: Point, length: float) -> None:
        """Draw a resistor downwards from ``top``, ``length`` with its leads."""
        x, y = top
        body = 30.0
        lead = (length - body) / 2
        self.line(OUTLINE, top, (x, y + lead))
        self._rectangle("part", (x - 6, y + lead), 12, body, {"fill": "#ffffff", **OUTLINE})
        self.line(OUTLINE, (x, y + lead + body), (x, y + length))

    def ground(self, at: Point) -> None:
        """Draw the ground symbol below ``at``."""
        x, y = at
        self.line(OUTLINE, at, (x, y + 10))
        for i, half in enumerate((11, 7, 3)):
            self.line(SUPPLY, (x - half, y + 10 + 4 * i), (x + half, y + 10 + 4 * i))

    def flag(self, at: Point, words: str, style: dict[str, str] = SUPPLY, *, anchor: str = "middle") -> None:
        """Draw the flag of a supply above ``at``: all flags with the same words are joined."""
        x, y = at
        self.line(style, at, (x, y - 12))
        self.line(style, (x - 16, y - 12), (x + 16, y - 12))
        start = {"middle": x, "start": x - 16, "end": x + 16}[anchor]
        self.text((start, y - 17), words, anchor=anchor, bold=True)


def _number(value: float) -> str:
    return f"{value:.2f}".rstrip("0").rstrip(".")
