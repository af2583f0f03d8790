# SPDX-License-Identifier: MIT
"""C and C++ include in one direction only, without circles: `python -m tests.structure.includes` names what does not.

The tables below are the rule. A folder may include what is in it, what its row lists, and headers of the system.
"""

from __future__ import annotations

import posixpath
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.structure.circles import circle, part_of

ROOT = Path(__file__).resolve().parents[2]
SUFFIXES = (".c", ".h", ".cpp", ".hpp", ".ino")
CORE, CORE_API = "shared/core/src", "shared/core/include"

TICK = "tick"
ROOMS: Mapping[str, tuple[str, ...]] = {
    "math": (),
    "model": ("math",),
    "estimate": ("math", "model"),
    "supervise": (),
    "reference": ("math", "model"),
    "actuate": ("math", "model"),
    "control": ("math", "model", "reference", "actuate"),
    TICK: ("math", "model", "estimate", "supervise", "reference", "actuate", "control"),
}
"""The core's rooms, and what each may use. A public header belongs to the room that has the source of its name."""

STAGE = re.compile(r"(?:tick|config)/.*|\w+/(?:robot_\w+|controllers|laws\w*)\.[ch]|robot\.h")
"""Stages of the tick and their configuration: they stand in the rooms of their subject, and see what the tick sees."""

BASE = ("numbers.h", "types.h", "params_gen.h")
"""Public headers of the core that every room may use."""
ALL_OF_IT = "omni.h"
"""The header that includes all public ones, for users of the core; no room of it needs that."""
CORE_SYSTEM = ("stdbool.h", "stddef.h", "stdint.h", "string.h")
"""All that the core takes from the compiler's library."""

GENERATED = {
    "omni/params_gen.h": "generated/tables",
    "omni/modules_gen.h": "generated/tables",
    "omni/motor_drivers_gen.h": "generated/tables",
    "omni/input_readings_gen.h": "generated/tables",
    "omni/tick_readings_gen.h": "generated/tables",
    "omni/board_readings_gen.h": "generated/tables",
    "omni/wiring_gen.h": "generated/wiring",
    "omni/gyro_gen.h": "generated/wiring",
    "omni/flow_gen.h": "generated/wiring",
    "omni/version_gen.h": "generated/link",
    "omni/mavlink.h": "generated/link",
    "omni/familiar_messages.h": "generated/link",
    "omni/telemetry_gen.h": "generated/link",
    "omni/reports_gen.h": "generated/link",
    "lanes_layout_gen.h": "generated/lanes",
    "lanes_sources_gen.h": "generated/lanes",
    "hil_sim/world_gen.h": "generated/world",
    "drivers_gen.h": "generated/world",
    "plants_gen.h": "generated/world",
    "sensors_gen.h": "generated/world",
    "sensor_sources_gen.h": "generated/world",
    "plant_sources_gen.h": "generated/world",
    "hil_sim/world_members_gen.h": "generated/world",
    "hil_sim/sensor_members_gen.h": "generated/world",
    "take_readings_gen.h": "generated/world",
    "fill_readings_gen.h": "generated/world",
}
"""Headers that the build writes, and what they are counted among."""

_APP = ("base", "storage", "drivers", "link", "tick", "services")
"""Rooms of the firmware's program; each stands on those before it only, firmware/app itself on all."""
_APP_MAY = (CORE_API, "generated/link", "generated/tables")
_ROOMS = tuple(f"firmware/app/{room}" for room in _APP)
_BOARD = (
    "firmware/app",
    *_ROOMS,
    "firmware/boards/common",
    CORE_API,
    "shared/link",
    "generated/link",
    "generated/wiring",
)
AREAS: Mapping[str, tuple[str, ...]] = {
    "shared/core": ("generated/tables",),
    "shared/link": (),
    "firmware/app": (*_ROOMS, *_APP_MAY),
    **{room: (*_ROOMS[:number], *_APP_MAY) for number, room in enumerate(_ROOMS)},
    "firmware/boards/common": ("firmware/app", *_ROOMS, CORE_API, "generated/link"),
    **{f"firmware/boards/{main.parent.name}": _BOARD for main in (ROOT / "firmware/boards").glob("*/main.cpp")},
    "firmware/boards/mps2_an500/base": (),  # the processor's own package: other programs of the tests stand on it, too
    "emulated_teensy/include": (),
    "emulated_teensy/src": ("emulated_teensy/include",),  # shares nothing with the drivers that it tests
    "hil_sim/include": ("emulated_teensy/include", CORE_API, "shared/link", "generated/world"),
    "hil_sim/src": (
        *("emulated_teensy/include", "hil_sim/include", CORE_API, "shared/link"),
        *("generated/link", "generated/world"),
    ),
    "hil_sim/lanes": ("hil_sim/include", "hil_sim/src", CORE_API, CORE, "generated/lanes", "generated/world"),
    "host/native": ("emulated_teensy/include", "hil_sim/include", CORE_API),
}
"""What stands on what. The longest name that fits a file is its area."""

SEARCHED = (
    *(
        CORE_API,
        "shared/link/include",
        "emulated_teensy/include",
        "hil_sim/include",
        "firmware",
        "firmware/boards/mps2_an500",
    ),
    *("hil_sim/src", "hil_sim/lanes", CORE),
)
"""Where a header is looked for after the including file's own folder."""

WORLD = (
    *("plant*.c", "world*.c", "motors.c", "sensor*.c", "slip.c", "faults.c", "config.c", "dispersion.c", "drv8871.c"),
    *("pca9685.c", "random.c"),
)
"""The simulated world in hil_sim/src. Of the core it knows the number types and not one law, through others neither."""
WORLD_MAY = {f"{CORE_API}/omni/types.h", f"{CORE_API}/omni/numbers.h"}

_INCLUDE = re.compile(r'^\s*#\s*include\s+(["<])([^">]+)[">]', re.MULTILINE)


@dataclass(frozen=True)
class Include:
    """One line: the file that it stands in, what it names, and the file or area that this is ("" for the system's)."""

    file: str
    line: int
    name: str
    target: str


class IncludeError(Exception):
    """A header in quotes that is nowhere."""


def sources(root: Path) -> list[str]:
    """Return the C and C++ files of all areas, in order."""
    folders = [area for area in AREAS if not any(area.startswith(f"{other}/") for other in AREAS)]
    paths = (path for folder in folders for path in (root / folder).rglob("*") if path.suffix in SUFFIXES)
    return sorted(path.relative_to(root).as_posix() for path in paths)


def includes(root: Path) -> Iterator[Include]:
    """Yield all includes of all files. Raises IncludeError."""
    files = sources(root)
    known = set(files)
    for file in files:
        text = (root / file).read_text(encoding="utf-8")
        for match in _INCLUDE.finditer(text):
            yield Include(file, text.count("\n", 0, match.start(2)) + 1, match[2], _target(known, file, match))


def _target(known: set[str], file: str, match: re.Match[str]) -> str:
    name = match[2]
    if name in GENERATED:
        return GENERATED[name]
    for folder in (posixpath.dirname(file), *SEARCHED):
        found = posixpath.normpath(posixpath.join(folder, name))
        if found in known:
            return found
    if match[1] == '"':
        raise IncludeError(f"{file}: there is no {name}; if the build writes it, add it to GENERATED")
    return ""


def area_of(file: str) -> str:
    """Return the area of a file, "" if it has none."""
    fits = [area for area in AREAS if file.startswith(f"{area}/")]
    return max(fits, key=len, default="")


def room_of(root: Path, file: str) -> str:
    """Return the room of one of the core's files; "" for the headers that belong to none."""
    if file.startswith(f"{CORE}/"):
        place = file.removeprefix(f"{CORE}/")
        if STAGE.fullmatch(place):
            return TICK
        return place.split("/")[0] if "/" in place else "?"
    name = Path(file).name
    if STAGE.fullmatch(name):
        return TICK
    if name in (*BASE, ALL_OF_IT):
        return ""
    sources = [path.relative_to(root).as_posix() for path in (root / CORE).glob(f"*/{Path(name).stem}.c")]
    return room_of(root, sources[0]) if sources else "?"


def wrong(root: Path, include: Include) -> str:
    """Return why an include must not be, or ""."""
    own = area_of(include.file)
    if not include.target:
        known = own != "shared/core" or include.name in CORE_SYSTEM
        return "" if known else f"the core takes nothing from the system but {', '.join(CORE_SYSTEM)}"
    allowed = (own, *AREAS[own])
    inside = area_of(include.target) == own or include.target.startswith(tuple(f"{place}/" for place in allowed))
    if not inside and include.target not in allowed:
        return f"{own} may include nothing but {', '.join(AREAS[own]) or 'its own'}"
    return _wrong_room(root, include) if own == "shared/core" else ""


def _wrong_room(root: Path, include: Include) -> str:
    if Path(include.file).name == ALL_OF_IT or include.target.startswith("generated/"):
        return ""
    if Path(include.target).name == ALL_OF_IT:
        return f"the core's own files include what they use, not {ALL_OF_IT}"
    own, other = room_of(root, include.file), room_of(root, include.target)
    for file, room in ((include.file, own), (include.target, other)):
        if room and room not in ROOMS:
            return f"{file} is in no room: add it to ROOMS or BASE"
    if own and other in ("", own, *ROOMS[own]):
        return ""
    return f"{own or 'a header of all rooms'} may not use {other}" if other else ""


def _reached(start: str, edges: Mapping[str, Iterable[str]]) -> set[str]:
    found: set[str] = set()
    left = [start]
    while left:
        new = set(edges.get(left.pop(), ())) - found
        found |= new
        left += new
    return found


def circles(root: Path, found: Iterable[Include]) -> list[str]:
    """Return a sentence for a circle of parts (a source and its headers), of the core's rooms, and of areas."""
    files = [(include.file, include.target) for include in found if area_of(include.target)]
    core = [pair for pair in files if {area_of(name) for name in pair} == {"shared/core"}]
    rooms = [(room_of(root, own), room_of(root, other)) for own, other in core]
    graphs = {
        "files": files,
        "parts": [(part_of(own), part_of(other)) for own, other in files],
        "rooms": [pair for pair in rooms if all(pair)],
        "areas": [(area_of(own), area_of(other)) for own, other in files],
    }
    rounds = {what: circle(pairs) for what, pairs in graphs.items()}
    return [f"{what} that include each other: {' -> '.join(names)}" for what, names in rounds.items() if names]


def check(root: Path = ROOT) -> list[str]:
    """Return a sentence for every include in a wrong direction, and for circles. Raises IncludeError."""
    found = list(includes(root))
    sentences = [f"{i.file}:{i.line}: includes {i.name}: {why}" for i in found if (why := wrong(root, i))]
    sentences += circles(root, found)
    edges: dict[str, set[str]] = {}
    for include in found:
        edges.setdefault(include.file, set()).add(include.target)
    for path in (path for pattern in WORLD for path in sorted((root / "hil_sim/src").glob(pattern))):
        file = path.relative_to(root).as_posix()
        core = {name for name in _reached(file, edges) if name.startswith("shared/core/")} - WORLD_MAY
        sentences += [f"{file}: the simulated world knows {name}, one of the controller's" for name in sorted(core)]
    return sentences


def main() -> int:
    """Print what is wrong and return the exit code."""
    try:
        sentences = check()
    except IncludeError as error:
        sentences = [str(error)]
    for sentence in sentences:
        sys.stderr.write(f"{sentence}\n")
    return 1 if sentences else 0


if __name__ == "__main__":
    sys.exit(main())
