# SPDX-License-Identifier: MIT
"""Sheets to print in true size: tags for the floor and the robot, and the calibration board."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from omniwheel import files
from omniwheel.mocap.camera.families import (
    BOARD_FAMILY,
    BOARD_FIRST_ID,
    BOARD_MARKER_SHARE,
    BOARD_SQUARE_MM,
    BOARD_SQUARES,
    CELLS,
    FAMILIES,
)
from omniwheel.mocap.camera.library import Array, load_cv2

PAPERS = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
"""Paper sizes [mm]: width, height."""
_RULER_MM = 100.0
_INCH_MM = 25.4
_EDGE_MM = 8.0


def cells_of(opencv_name: str, number: int) -> Array:
    """Return a tag as its cells, True where it is black: (n, n) with the border."""
    aruco = load_cv2().aruco
    dictionary = aruco.getPredefinedDictionary(getattr(aruco, opencv_name))
    return np.asarray(aruco.generateImageMarker(dictionary, number, dictionary.markerSize + 2) < 128)


class Sheet:
    """A page on which squares are placed in millimetres, from its lower left corner."""

    def __init__(self, paper: str, *, lying: bool = False) -> None:
        from matplotlib.figure import Figure

        width, height = PAPERS[paper]
        self.width, self.height = (height, width) if lying else (width, height)
        self.figure: Any = Figure(figsize=(self.width / _INCH_MM, self.height / _INCH_MM), dpi=300)
        self._axes = self.figure.add_axes((0.0, 0.0, 1.0, 1.0))
        self._axes.set(xlim=(0.0, self.width), ylim=(0.0, self.height))
        self._axes.axis("off")

    def black(self, x: float, y: float, width: float, height: float) -> None:
        """Put a black rectangle whose lower left corner is (x, y)."""
        from matplotlib.patches import Rectangle

        self._axes.add_patch(Rectangle((x, y), width, height, facecolor="black", edgecolor="none", antialiased=False))

    def cells(self, cells: Array, x: float, y: float, size: float) -> None:
        """Put a tag whose lower left corner is (x, y): neighbours in a row are one rectangle, without seams."""
        cell = size / len(cells)
        for row, line in enumerate(cells):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
            for start, end in zip(edges[::2], edges[1::2], strict=True):
                self.black(x + cell * start, y + size - cell * (row + 1), cell * (end - start), cell)

    def text(self, x: float, y: float, words: str, size: float = 9.0) -> None:
        """Put a line of text centred at (x, y)."""
        self._axes.text(x, y, words, ha="center", va="center", fontsize=size, color="0.35")

    def ruler(self, y: float) -> None:
        """Put the line that shows whether the printer keeps the size."""
        x = 0.5 * (self.width - _RULER_MM)
        self.black(x, y, _RULER_MM, 0.3)
        for end in (x, x + _RULER_MM - 0.3):
            self.black(end, y - 2.0, 0.3, 4.0)
        self.text(0.5 * self.width, y - 4.5, f"this line is {_RULER_MM:g} mm long: print at 100 %", 7.0)


def tag_sheet(family: str, number: int, size_m: float, paper: str, place: str) -> Sheet:
    """Return the sheet of one tag; ``place`` says where it goes."""
    sheet = Sheet(paper)
    size = 1e3 * size_m
    x, y = 0.5 * (sheet.width - size), 0.5 * (sheet.height - size)
    sheet.cells(cells_of(FAMILIES[family], number), x, y, size)
    margin = size / CELLS[family]
    above = "x →   (the heading of this tag)"
    sheet.text(0.5 * sheet.width, min(y + size + margin + 4.0, sheet.height - _EDGE_MM), above)
    sheet.text(0.5 * sheet.width, max(y - margin - 4.0, 26.0), f"{family} {number}, black side {size:g} mm, {place}")
    sheet.ruler(16.0)
    return sheet


def board_sheet(paper: str) -> Sheet:
    """Return the calibration board."""
    sheet = Sheet(paper, lying=True)
    columns, rows = BOARD_SQUARES
    side = min(BOARD_SQUARE_MM, (sheet.width - 2 * _EDGE_MM) / columns, (sheet.height - _EDGE_MM - 22.0) / rows)
    x0, y0 = 0.5 * (sheet.width - columns * side), 18.0
    number = BOARD_FIRST_ID
    marker = BOARD_MARKER_SHARE * side
    for row in range(rows):
        for column in range(columns):
            x, y = x0 + column * side, y0 + (rows - 1 - row) * side
            if (row + column) % 2 == 0:
                sheet.black(x, y, side, side)
            else:
                inset = 0.5 * (side - marker)
                sheet.cells(cells_of(BOARD_FAMILY, number), x + inset, y + inset, marker)
                number += 1
    sheet.ruler(10.0)
    return sheet


TEMPLATE = """\
# A camera that sees the floor, for omni mocap. See the guide "A webcam as motion capture".

[camera]
device = 0              # number of the camera, or a path: "/dev/video0", a video, a folder of pictures
width = 1280
height = 720
rate_Hz = 30.0
latency_s = 0.0         # how old a picture is when its time is taken
# exposure = 50         # what the camera's driver calls it: short, so that a moving tag is not blurred

[tags]
family = "{family}"

# Tags on the floor, face up. Measure their centres. The arrow on a sheet points along its heading.
{floor}
# The tag on the robot, level. Measure the height of the paper above the floor. x, y and heading: on the robot.
[[robot]]
id = {robot}
size_m = {robot_size:g}
height_m = 0.12
x_m = 0.0
y_m = 0.0
heading_deg = 0.0
"""
_FLOOR = """\
[[floor]]
id = {id}
size_m = {size:g}
x_m = {x:g}
y_m = {y:g}
heading_deg = 0.0
"""
_PLACES = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def template(family: str, floor: list[int], size_m: float, robot: int, robot_size_m: float) -> str:
    """Return a camera file to begin with."""
    places = [(*_PLACES[at % 4], at // 4) for at in range(len(floor))]
    tables = [
        _FLOOR.format(id=number, size=size_m, x=x + 2 * turn, y=y)
        for number, (x, y, turn) in zip(floor, places, strict=True)
    ]
    return TEMPLATE.format(family=family, floor="\n".join(tables), robot=robot, robot_size=robot_size_m)


def sheets(
    family: str, floor: list[int], size_m: float, robot: int, robot_size_m: float, paper: str
) -> Iterator[tuple[str, Sheet]]:
    """Yield the name and the sheet of everything to print."""
    yield "board", board_sheet(paper)
    for number in floor:
        yield f"floor-{number}", tag_sheet(family, number, size_m, paper, "for the floor")
    yield f"robot-{robot}", tag_sheet(family, robot, robot_size_m, paper, "for the robot")


def write_sheet(sheet: Sheet, path: Path) -> None:
    """Write a sheet in the format that the name's ending says. Raises OutputFileError."""
    files.save_picture(sheet.figure, path)
