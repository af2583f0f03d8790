# SPDX-License-Identifier: MIT
"""The file of finished batches: what was put comes back, what is torn or damaged is gone, nothing else is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hil_sim.studies.errors import StudyFolderError
from hil_sim.studies.store import BatchStore

ROW = np.dtype([("seed", "<i8"), ("value", "<f8")])
BATCH = 8
KEYS = [bytes([number]) * 16 for number in range(5)]


def rows(number: int, count: int = BATCH) -> np.ndarray:
    made = np.zeros(count, ROW)
    made["seed"] = np.arange(count) + 100 * number
    made["value"] = np.sqrt(made["seed"])
    return made


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "batches.bin"
    with BatchStore(path, ROW, BATCH) as store:
        for number, key in enumerate(KEYS[:3]):
            store.put(key, rows(number, BATCH if number < 2 else 3))
    return path


def held(path: Path) -> list[bool]:
    with BatchStore(path, ROW, BATCH) as store:
        for number, key in enumerate(KEYS[:3]):
            if store.holds(key, 1):
                count = BATCH if number < 2 else 3
                assert store.get(key, count).tobytes() == rows(number, count).tobytes()
        return [store.holds(key, 1) for key in KEYS]


def test_what_was_put_comes_back(path: Path) -> None:
    assert held(path) == [True, True, True, False, False]
    with BatchStore(path, ROW, BATCH) as store:
        assert store.get(KEYS[1], 5).tobytes() == rows(1)[:5].tobytes()
        assert not store.holds(KEYS[2], 4)
        with pytest.raises(KeyError):
            store.get(KEYS[2], 4)


def test_a_torn_last_record_is_lost_alone_and_written_over(path: Path) -> None:
    whole = path.read_bytes()
    length = len(whole) // 3
    for left in (1, 30, length - 1):
        path.write_bytes(whole[: 2 * length + left])
        assert held(path) == [True, True, False, False, False]
        with BatchStore(path, ROW, BATCH) as store:
            store.put(KEYS[2], rows(2, 3))
        assert path.read_bytes() == whole


def test_any_damaged_byte_costs_its_record_only(path: Path) -> None:
    whole = path.read_bytes()
    length = len(whole) // 3
    for at in (0, 5, 10, 40, length - 1):
        damaged = bytearray(whole)
        damaged[length + at] ^= 0x10
        path.write_bytes(damaged)
        assert held(path) == [True, False, True, False, False]


def test_a_longer_batch_replaces_a_shorter_one(path: Path) -> None:
    with BatchStore(path, ROW, BATCH) as store:
        store.put(KEYS[2], rows(2))
    with BatchStore(path, ROW, BATCH) as store:
        assert store.get(KEYS[2], BATCH).tobytes() == rows(2).tobytes()


def test_one_process_at_a_time(path: Path) -> None:
    with BatchStore(path, ROW, BATCH), pytest.raises(StudyFolderError, match="another process"):
        BatchStore(path, ROW, BATCH)
    held(path)


def test_fresh_forgets(path: Path) -> None:
    with BatchStore(path, ROW, BATCH, fresh=True) as store:
        assert len(store) == 0
    assert path.stat().st_size == 0
