# SPDX-License-Identifier: MIT
"""No two parts of the C and C++ include each other, not through others either; rooms and areas neither.

A part is a source with its headers: ``pid.c``, ``pid_inline.h`` and ``omni/pid.h``. Its files may include each other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import PurePosixPath

_INSIDE = re.compile(r"_(?:inline|internal)$")


@dataclass(frozen=True)
class Together:
    """Files that are one part though their names differ: their folder, what their names match, and why."""

    folder: str
    names: str
    part: str
    why: str


TOGETHER = (
    Together("emulated_teensy/src", r".*", "machine", "one chip: each peripheral's state is a member of the machine's"),
    Together("hil_sim/src", r"parts", "world", "what the sources of the world share is the inside of world.h"),
    Together("shared/core", r"pose_ekf_motion", "pose_ekf", "the inside of pose_ekf.h, in two sources"),
    Together("hil_sim/src", r"filter_study_(?:lanes|parts)", "filter_study", "the inside of filter_study.h"),
)

FOLDERS: Mapping[str, str] = {
    "shared/core/include/omni": "shared/core",
    "shared/link/include/omni": "shared/link",
    "emulated_teensy/include/emulated_teensy": "emulated_teensy/src",
    "hil_sim/include/hil_sim": "hil_sim/src",
}
"""Where the sources of public headers are counted."""


def part_of(file: str) -> str:
    """Return the part of a file: where its sources are, and what they are called."""
    path = PurePosixPath(file)
    folder = FOLDERS.get(path.parent.as_posix(), path.parent.as_posix())
    if folder.startswith("shared/core/src/"):
        folder = "shared/core"  # no two of its sources have one name
    name = _INSIDE.sub("", path.stem)
    for together in TOGETHER:
        if folder == together.folder and re.fullmatch(together.names, name):
            return f"{folder}/{together.part}"
    return f"{folder}/{name}"


def circle(pairs: Iterable[tuple[str, str]]) -> list[str]:
    """Return one circle of the pairs (who includes, what), begun and ended with one name; empty: there is none."""
    edges: dict[str, set[str]] = {}
    for own, other in pairs:
        if own != other:
            edges.setdefault(own, set()).add(other)
    try:
        TopologicalSorter(edges).prepare()
    except CycleError as error:
        return [str(name) for name in reversed(error.args[1])]
    return []
