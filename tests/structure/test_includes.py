# SPDX-License-Identifier: MIT
"""Includes go one way: those of the tree, and a planted one that does not is named."""

from __future__ import annotations

import re
import shutil
from collections import Counter
from pathlib import Path

import pytest

from tests.structure.circles import TOGETHER, Together, circle
from tests.structure.includes import AREAS, CORE, ROOMS, ROOT, IncludeError, area_of, check, includes, sources

MATH, ESTIMATION = "shared/core/src/math/math.c", "shared/core/src/estimate/motor_kf.c"
ROBOT, APP = "shared/core/src/tick/tick.c", "firmware/app/app.cpp"
PLANTED = {
    "the core the firmware": (MATH, "<app/base/board.h>", "shared/core may include nothing but"),
    "the core our messages": (ROBOT, '"omni/mavlink.h"', "shared/core may include nothing but"),
    "the core the system": (MATH, "<math.h>", "takes nothing from the system but stdbool.h"),
    "a room one above it": (MATH, '"omni/kinematics.h"', "math may not use model"),
    "a room another's inside": (
        ESTIMATION,
        '"../reference/trajectory_internal.h"',
        "estimate may not use reference",
    ),
    "a room all of the core": (ROBOT, '"omni/omni.h"', "include what they use"),
    "a public header one above it": ("shared/core/include/omni/pid.h", '"omni/robot.h"', "control may not use tick"),
    "the common types a room": ("shared/core/include/omni/types.h", '"omni/math.h"', "may not use math"),
    "a room of the app one above it": (
        "firmware/app/storage/param_store.h",
        '"app/drivers/pca9685.h"',
        "firmware/app/storage may include nothing but",
    ),
    "the app a board": (APP, '"boards/posix/options.h"', "firmware/app may include nothing but"),
    "the app the core's inside": (APP, '"math/math_inline.h"', "firmware/app may include nothing but"),
    "a board another": ("firmware/boards/posix/main.cpp", '"boards/teensy40/i2c.h"', "posix may include nothing but"),
    "models of the chip the world": (
        "emulated_teensy/src/gpio.c",
        '"hil_sim/world.h"',
        "src may include nothing but",
    ),
    "the simulation the core's inside": (
        "hil_sim/src/run.c",
        '"tick/stages.h"',
        "src may include nothing but",
    ),
    "the world a controller": ("hil_sim/src/plant_linear.c", '"omni/kinematics.h"', "one of the controller's"),
    "the world a controller through others": ("hil_sim/src/motors.c", '"in_process.h"', "knows shared/core/include/"),
}


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The C and C++ files, as they are."""
    folder = tmp_path_factory.mktemp("includes")
    for source in sources(ROOT):
        target = folder / source
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / source, target)
    assert check(folder) == []
    return folder


def test_all_includes_of_the_tree_go_one_way() -> None:
    found = list(includes(ROOT))
    assert len(found) > 1000
    assert {area_of(include.file) for include in found} == set(AREAS)
    assert check() == []


def said_of_another_include(copy: Path, file: str, header: str) -> list[str]:
    """Return what the check says of the copy while ``file`` includes ``header``, too."""
    path = copy / file
    original = path.read_text(encoding="utf-8")
    path.write_text(f"{original}#include {header}\n", encoding="utf-8")
    try:
        return list(check(copy))
    finally:
        path.write_text(original, encoding="utf-8")


@pytest.mark.full
@pytest.mark.parametrize("name", PLANTED)
def test_an_include_in_the_wrong_direction_is_named(copy: Path, name: str) -> None:
    file, header, words = PLANTED[name]
    sentences = said_of_another_include(copy, file, header)
    assert any(sentence.startswith(file) and words in sentence for sentence in sentences), sentences


CIRCLES = {
    "files": ("firmware/app/link/mavlink_frame.h", '"app/link/codec.h"', "files that include each other"),
    "parts, each through its source": (
        "firmware/app/link/stops.cpp",
        '"app/link/codec.h"',
        "parts that include each other",
    ),
    "rooms": ("shared/core/src/model/motor.c", '"omni/trajectory.h"', "rooms that include each other"),
    "areas": ("firmware/app/base/board.h", '"app/link/links.h"', "areas that include each other"),
}


@pytest.mark.parametrize("what", CIRCLES)
def test_a_circle_is_named(copy: Path, what: str) -> None:
    file, header, words = CIRCLES[what]
    sentences = said_of_another_include(copy, file, header)
    assert any(sentence.startswith(words) for sentence in sentences), sentences


def test_a_circle_is_told_in_the_order_of_its_includes() -> None:
    assert circle([("a", "b"), ("b", "c"), ("a", "c"), ("a", "a")]) == []
    assert circle([("x", "a"), ("a", "b"), ("b", "c"), ("c", "a")]) in (
        ["a", "b", "c", "a"],
        ["b", "c", "a", "b"],
        ["c", "a", "b", "c"],
    )


@pytest.mark.parametrize("entry", TOGETHER, ids=lambda entry: f"{entry.folder}/{entry.part}")
def test_files_that_are_one_part_would_be_a_circle_else(entry: Together, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.structure.circles.TOGETHER", tuple(other for other in TOGETHER if other != entry))
    assert any("parts that include each other" in sentence for sentence in check())


def test_a_header_that_is_nowhere_is_an_error(copy: Path) -> None:
    path = copy / "firmware/app/more.h"
    path.write_text('#include "app/nowhere.h"\n', encoding="utf-8")
    with pytest.raises(IncludeError, match=r"there is no app/nowhere\.h"):
        check(copy)
    path.unlink()


@pytest.mark.parametrize("file", ["shared/core/src/loose.c", "shared/core/src/new_room/a.c"])
def test_a_source_of_the_core_stands_in_a_room(copy: Path, file: str) -> None:
    path = copy / file
    path.parent.mkdir(exist_ok=True)
    path.write_text('#include "omni/types.h"\n', encoding="utf-8")
    sentences = check(copy)
    path.unlink()
    assert [file in sentence and "is in no room" in sentence for sentence in sentences] == [True]


def test_rooms_go_down_only_and_are_the_folders_that_there_are() -> None:
    for number, (room, used) in enumerate(ROOMS.items()):
        assert set(used) <= set(list(ROOMS)[:number]), room
    assert {*ROOMS, "config"} == {path.name for path in (ROOT / CORE).iterdir()}


def test_no_two_sources_of_the_core_have_one_name() -> None:
    # Object files of some checks lie side by side in one folder.
    names = Counter(path.name for path in (ROOT / CORE).rglob("*.c"))
    assert [name for name, count in names.items() if count > 1] == []


WRITES_TELEMETRY = re.compile(r"(outputs->[\w\[\]]+ = |mem(cpy|set)\(&?outputs->)(?!.*outputs->)")


def test_nothing_of_the_core_reads_the_telemetry_back() -> None:
    lines = [
        line.strip()
        for path in sorted((ROOT / CORE).rglob("*.[ch]"))
        for line in path.read_text(encoding="utf-8").splitlines()
        if "outputs->" in line or "const omni_outputs_t" in line
    ]
    assert len(lines) > 20
    found = [line for line in lines if not WRITES_TELEMETRY.match(re.sub(r"sizeof outputs->\w+", "", line))]
    assert found == []


def test_the_page_of_the_design_has_the_rooms_of_the_check() -> None:
    page = (ROOT / "docs/concepts/design.md").read_text(encoding="utf-8")
    for room, used in ROOMS.items():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{room}` |"))
        listed = row.split("|")[3].strip()
        assert listed == (", ".join(f"`{name}`" for name in used) if room != "tick" else "all of them"), room
