# SPDX-License-Identifier: MIT
"""Every byte of the stored parameters damaged: the robot starts with a whole set, or its own, and says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.firmware.client import lockstep_robot, mav, storage_arguments

STORAGE = mav.MAV_CMD_PREFLIGHT_STORAGE
LOAD, SAVE = 0, 1
OLD, NEW = (7.0, 0.3), (8.0, 0.2)
NAMES = ("ISMC_LAM_XY", "LIM_V")
OTHER_USED = "a stored parameter set is damaged: the other used"
NOT_USED = "stored parameters are damaged: not used"


def start(path: Path) -> tuple[tuple[float, ...], list[str]]:
    """Return the values that a robot starts with, and what it says."""
    with lockstep_robot(*storage_arguments(path)) as robot:
        robot.wait("HEARTBEAT")
        values = tuple(round(robot.get(name), 6) for name in NAMES)
        return values, [text for text in robot.texts() if "stored" in text]


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return a memory with an old set in one slot and a new one in the other."""
    path = tmp_path_factory.mktemp("storage") / "memory"
    with lockstep_robot(*storage_arguments(path)) as robot:
        assert tuple(round(robot.get(name), 6) for name in NAMES) != OLD
        for values in (OLD, NEW):
            for name, value in zip(NAMES, values, strict=True):
                robot.set(name, value)
            assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
    return path.read_bytes()


def slots(memory: bytes) -> list[range]:
    """Return where the two sets lie: from their first byte to the last one that is not erased."""
    first, second = (i for i in range(len(memory)) if memory.startswith(b"OMP3", i))
    return [range(at, at + len(memory[at : at + 40].rstrip(b"\xff"))) for at in (first, second)]


def test_an_undamaged_memory_gives_the_new_set_without_a_word(stored: bytes, tmp_path: Path) -> None:
    path = tmp_path / "memory"
    path.write_bytes(stored)
    assert start(path) == (NEW, [])


@pytest.mark.parametrize("flip", [0x01, 0x80])
def test_any_damaged_byte_leaves_the_other_set(stored: bytes, tmp_path: Path, flip: int) -> None:
    path = tmp_path / "memory"
    for slot, other in zip(slots(stored), (NEW, OLD), strict=True):
        for at in slot:
            path.write_bytes(stored[:at] + bytes([stored[at] ^ flip]) + stored[at + 1 :])
            assert start(path) == (other, [OTHER_USED]), at


def damaged(stored: bytes, path: Path) -> Path:
    """Write a memory with both sets damaged."""
    memory = bytearray(stored)
    for slot in slots(stored):
        memory[slot[5]] ^= 4
    path.write_bytes(memory)
    return path


def test_a_load_of_damaged_sets_fails_and_changes_nothing(stored: bytes, tmp_path: Path) -> None:
    with lockstep_robot(*storage_arguments(damaged(stored, tmp_path / "memory"))) as robot:
        robot.set(NAMES[0], OLD[0])
        assert robot.command(STORAGE, LOAD) == mav.MAV_RESULT_FAILED
        assert robot.get(NAMES[0]) == OLD[0]
        assert NOT_USED in robot.texts()
        assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
        robot.set(NAMES[0], NEW[0])
        assert robot.command(STORAGE, LOAD) == mav.MAV_RESULT_ACCEPTED
        assert robot.get(NAMES[0]) == OLD[0]


def test_a_load_of_the_older_set_says_that_the_newer_one_is_damaged(stored: bytes, tmp_path: Path) -> None:
    path = tmp_path / "memory"
    memory = bytearray(stored)
    memory[slots(stored)[1][5]] ^= 4
    path.write_bytes(memory)
    with lockstep_robot(*storage_arguments(path)) as robot:
        robot.wait("HEARTBEAT")
        robot.set(NAMES[0], 9.0)
        assert robot.texts().count(OTHER_USED) == 1, "at its start"
        assert robot.command(STORAGE, LOAD) == mav.MAV_RESULT_ACCEPTED
        assert robot.get(NAMES[0]) == OLD[0]
        assert robot.texts().count(OTHER_USED) == 1


def test_with_both_sets_damaged_the_robot_starts_with_its_own_values(stored: bytes, tmp_path: Path) -> None:
    values, said = start(damaged(stored, tmp_path / "memory"))
    assert values not in (OLD, NEW)
    assert said == [NOT_USED]
