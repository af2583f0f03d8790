# SPDX-License-Identifier: MIT
"""Every byte of the stored parameters damaged: the robot starts with a whole set, or its own, and says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.firmware.client import lockstep_robot, mav, storage_arguments

STORAGE = mav.MAV_CMD_PREFLIGHT_STORAGE
LOAD, SAVE = 0, 1
SET = (8.0, 0.2)
NAMES = ("ISMC_LAM_XY", "LIM_V")
NOT_USED = "stored parameters are damaged: not used"


def start(path: Path) -> tuple[tuple[float, ...], list[str]]:
    """Return the values that a robot starts with, and what it says."""
    with lockstep_robot(*storage_arguments(path)) as robot:
        robot.wait("HEARTBEAT")
        values = tuple(round(robot.get(name), 6) for name in NAMES)
        return values, [text for text in robot.texts() if "stored" in text]


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return a memory with a set."""
    path = tmp_path_factory.mktemp("storage") / "memory"
    with lockstep_robot(*storage_arguments(path)) as robot:
        for name, value in zip(NAMES, SET, strict=True):
            assert round(robot.get(name), 6) != value
            robot.set(name, value)
        assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
    return path.read_bytes()


def test_an_undamaged_memory_gives_the_set_without_a_word(stored: bytes, tmp_path: Path) -> None:
    path = tmp_path / "memory"
    path.write_bytes(stored)
    assert start(path) == (SET, [])


@pytest.mark.parametrize("flip", [0x01, 0x80])
def test_with_any_damaged_byte_the_robot_starts_with_its_own_values(stored: bytes, tmp_path: Path, flip: int) -> None:
    path = tmp_path / "memory"
    for at in range(len(stored[:100].rstrip(b"\xff"))):
        path.write_bytes(stored[:at] + bytes([stored[at] ^ flip]) + stored[at + 1 :])
        values, said = start(path)
        assert all(value != other for value, other in zip(values, SET, strict=True)), at
        assert said == [NOT_USED], at


def test_a_load_of_a_damaged_set_fails_and_changes_nothing(stored: bytes, tmp_path: Path) -> None:
    path, memory = tmp_path / "memory", bytearray(stored)
    memory[5] ^= 4
    path.write_bytes(memory)
    with lockstep_robot(*storage_arguments(path)) as robot:
        robot.set(NAMES[0], 7.0)
        assert robot.command(STORAGE, LOAD) == mav.MAV_RESULT_FAILED
        assert robot.get(NAMES[0]) == 7.0
        assert NOT_USED in robot.texts()
        assert robot.command(STORAGE, SAVE) == mav.MAV_RESULT_ACCEPTED
        robot.set(NAMES[0], SET[0])
        assert robot.command(STORAGE, LOAD) == mav.MAV_RESULT_ACCEPTED
        assert robot.get(NAMES[0]) == 7.0
