# SPDX-License-Identifier: MIT
"""How often loops run at most: `loops.toml`, by the loop's words in the source, or by function for what is not ours."""

from __future__ import annotations

import re
import sys
from functools import cache
from pathlib import Path

from emulated_teensy.image_file import Image
from omniwheel._core import lib
from omniwheel.robots import parameter_table
from tests.image.flashed import ROOT
from tests.image.static.code import CodeError, Function
from tests.image.static.longest import Loop

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TABLE = Path(__file__).with_name("loops.toml")
SOURCES = (ROOT / "firmware", ROOT / "shared")
LINES_BACK = 4
_LOOP = re.compile(r"\b(for|while) \(.*|\} while \(.*")


class LoopBounds:
    """Looks a loop's bound up, for a robot with so many wheels, with a gyro or without."""

    def __init__(self, image: Image, wheels: int, *, gyro: bool = False) -> None:
        self._image = image
        controllers = len(parameter_table()["CTL_MODE"].values)
        columns = int(lib.OMNI_EKF_ERROR_STATES) if gyro else wheels
        states = int(lib.OMNI_AXES) + columns
        self._named = {"wheels": wheels, "controllers": controllers, "columns": columns, "states": states}
        self._rules = tomllib.loads(TABLE.read_text())["loops"]
        self.used: dict[tuple[str, int], int] = {}
        """Bounds that were asked for, by function and address of the loop's first block."""

    def __call__(self, function: Function, loop: Loop) -> int:
        """Return the most times that the body runs for each entry. Raises CodeError for a loop without a rule."""
        texts = {self.text(function, int(str(block))) for block, _ in loop.again}
        bound = 1
        for text in texts:
            bound *= self._rule(function, loop, text)
        self.used[loop.function, loop.head] = bound
        return bound

    def text(self, function: Function, block: int) -> str:
        """Return the source of the loop that a block's last instruction begins again; "" where it is not ours."""
        address = block
        while function.steps[address].after == [address + function.steps[address].size]:
            address += function.steps[address].size
        place = self._image.place(address)
        return _loop_near(Path(place.file).name, place.line) if place is not None and place.line else ""

    def _rule(self, function: Function, loop: Loop, text: str) -> int:
        for rule in self._rules:
            fits_function = re.fullmatch(rule.get("function", ".*"), function.name)
            fits_text = rule.get("text") is None or rule["text"] in text
            fits_place = rule.get("offset", loop.head - function.start) == loop.head - function.start
            if fits_function and fits_text and fits_place:
                return int(self._named.get(rule["most"], rule["most"]))
        place = self._image.place(loop.head)
        raise CodeError(f"no rule in {TABLE.name} for the loop at {place}: '{text}'")


@cache
def _loop_near(name: str, line: int) -> str:
    files = [file for folder in SOURCES for file in folder.rglob(name)]
    if len(files) != 1:
        return ""
    lines = files[0].read_text().splitlines()
    for at in range(line - 1, max(line - 1 - LINES_BACK, -1), -1):
        if found := _LOOP.search(lines[at]):
            return found[0]
    return ""
