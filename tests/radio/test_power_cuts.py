# SPDX-License-Identifier: MIT
"""Power cut at every byte of every save to the flash log, whole and torn bytes and words: old content or new."""

from __future__ import annotations

import ctypes
import random
import struct
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from tests.native import ROOT, core_archive, kept_library
from tests.parameter_sets import NOWHERE, TABLE, drawn_values

OK, EMPTY, DAMAGED, FULL = 0, 1, 2, 3
"""``StoreResult``; a record's results are the first three."""
RELEASED, STOPPED, UNKNOWN = 0, 1, 2
"""``StopLatch::AtBoot``."""
SMALL, PC = 1080, 2048
TAIL = 192
HEADER, ENTRY, CRC = 12, 6, 4
KEY_AT, KEY_CONTENT = 0, 36
TIME_AT, TIME_CONTENT = 44, 8
SECTOR, SECTORS = 4096, 3
WHOLE = SECTOR * SECTORS
"""More bytes than any save programs: no cut."""
LOG_HEADER = 8
BANK = 2048 + 16 + 4
"""Bytes programmed when a bank is begun: image, header, and the closing mark of the one before."""


@lru_cache
def library() -> Any:
    firmware = ROOT / "firmware"
    app = firmware / "app"
    sources = [app / "storage/param_store.cpp", app / "storage/record_store.cpp", app / "tick/stop_latch.cpp"]
    sources += [firmware / "boards/teensy40/flash_log.cpp", Path(__file__).with_name("store_shim.cpp")]
    loaded: Any = ctypes.CDLL(str(kept_library("stores", sources, archives=[core_archive()])))
    return loaded


def most_entries(memory: int) -> int:
    return min((memory - TAIL - HEADER - CRC) // ENTRY, int(library().param_count()))


class ParameterMemory:
    """A memory and what a robot would find in it."""

    def __init__(self, size: int) -> None:
        self.bytes = bytearray(b"\xff" * size)
        self.own = [NOWHERE] * len(TABLE)

    def values(self, seed: float, differing: int) -> list[float]:
        """Return a set whose first ``differing`` parameters have values within their ranges, another for each seed."""
        return drawn_values(seed)[:differing] + self.own[differing:]

    def save(self, values: list[float]) -> int:
        floats = ctypes.c_float * len(self.own)
        return int(library().param_save(self._image(), len(self.bytes), floats(*values), floats(*self.own)))

    def load(self) -> tuple[int, list[float]]:
        values = (ctypes.c_float * len(self.own))(*self.own)
        result = int(library().param_load(self._image(), len(self.bytes), values))
        return result, list(values)

    def _image(self) -> Any:
        return (ctypes.c_uint8 * len(self.bytes)).from_buffer(self.bytes)


class FlashMemory(ParameterMemory):
    """Sectors of flash memory with the log in them, whose power can be cut while it is written."""

    def __init__(self) -> None:
        super().__init__(WHOLE)

    def save(self, values: list[float], cut: int = WHOLE, word: int = 1, torn: int = 0) -> int:
        floats = ctypes.c_float * len(self.own)
        return int(library().flash_param_save(self._image(), floats(*values), floats(*self.own), cut, word, torn))

    def load(self) -> tuple[int, list[float]]:
        values = (ctypes.c_float * len(self.own))(*self.own)
        result = int(library().flash_param_load(self._image(), values))
        return result, list(values)

    def save_record(self, offset: int, data: bytes, cut: int = WHOLE, word: int = 1, torn: int = 0) -> bool:
        return bool(library().flash_record_save(self._image(), offset, len(data), data, cut, word, torn))

    def load_record(self, offset: int, content: int) -> tuple[int, bytes]:
        data = ctypes.create_string_buffer(content)
        result = int(library().flash_record_load(self._image(), offset, content, data))
        return result, data.raw

    def latch(self, stopped: bool, cut: int = WHOLE, word: int = 1, torn: int = 0) -> None:
        library().flash_latch_save(self._image(), int(stopped), cut, word, torn)

    def at_boot(self) -> int:
        return int(library().flash_latch_boot(self._image()))


def tears(length: int, seed: int) -> Iterator[tuple[int, int, int]]:
    """Every byte to cut at, as (cut, word, bits that had changed): none, or random ones of a byte or word."""
    draw = random.Random(seed)
    for cut in range(length):
        yield cut, 1, 0
        for _ in range(3):
            yield cut, 1, draw.randrange(256)
        if cut % 2 == 0:
            for _ in range(3):
                yield cut, 2, draw.randrange(65536)


def programmed_bytes(store: FlashMemory, before: bytes, new: list[float]) -> int:
    """Return how many bytes a save of ``new`` programs where the flash memory was ``before``."""
    for cut in range(WHOLE):
        store.bytes[:] = before
        if store.save(new, cut) == OK:
            return cut
    raise AssertionError("the save never ends")


@pytest.mark.full
@pytest.mark.parametrize("generation", [1, 2, 3])
@pytest.mark.parametrize("differing", [1, 20, None])
def test_a_cut_at_any_byte_of_a_parameter_save_leaves_the_old_or_the_new_set(
    generation: int, differing: int | None
) -> None:
    """``generation`` 1 is the first save ever, which begins a bank; None differing saves all parameters."""
    store = FlashMemory()
    count = most_entries(PC) if differing is None else differing
    for earlier in range(1, generation):
        assert store.save(store.values(10.0 * earlier, count)) == OK
    old_result, old = store.load()
    before = bytes(store.bytes)
    new = store.values(100.0, count)
    assert store.save(new) == OK
    assert store.load() == (OK, new)
    seen_new = 0
    for cut, word, torn in tears(programmed_bytes(store, before, new), seed=generation):
        store.bytes[:] = before
        store.save(new, cut, word, torn)
        result, found = store.load()
        assert found in (old, new), (cut, word, torn)
        assert result == (OK if found == new else old_result), (cut, word, torn)
        seen_new += found == new
        # The robot goes on: the next save works and is found again.
        if cut % 16 == 0 and word == 1:
            last = store.values(200.0, count)
            assert store.save(last) == OK
            assert store.load() == (OK, last)
    assert old_result == (EMPTY if generation == 1 else OK)
    assert seen_new <= 16  # only tears that change nothing


def test_a_set_that_needs_a_byte_more_than_the_memory_is_refused_and_the_old_one_stays() -> None:
    size = SMALL - 200
    store = ParameterMemory(size)
    room = most_entries(size)
    assert room == 112 < len(store.own)
    assert store.save(store.values(1.0, room)) == OK
    before = bytes(store.bytes)
    assert store.save(store.values(2.0, room + 1)) == FULL
    assert bytes(store.bytes) == before
    assert store.load() == (OK, store.values(1.0, room))


@pytest.mark.parametrize("count", [0, 1, 29, 31, 145, 146, 1000, 0x7FFFFFFF, 0xFFFFFFFF, 0x2AAAAAA8])
def test_a_corrupted_count_reads_nothing_beyond_the_set(count: int) -> None:
    store = ParameterMemory(SMALL)
    assert store.save(store.values(1.0, 30)) == OK
    struct.pack_into("<I", store.bytes, 8, count)
    assert store.load() == (DAMAGED, store.own)


def test_every_single_damaged_bit_is_noticed() -> None:
    store = ParameterMemory(SMALL)
    assert store.save(store.values(1.0, 3)) == OK
    for bit in range(8 * (HEADER + 3 * ENTRY + CRC)):
        store.bytes[bit // 8] ^= 1 << bit % 8
        assert store.load() == (DAMAGED, store.own), bit
        store.bytes[bit // 8] ^= 1 << bit % 8


@pytest.mark.parametrize("size", [1, 100, TAIL, TAIL + HEADER + CRC - 1])
def test_a_memory_too_small_for_a_set_is_refused(size: int) -> None:
    store = ParameterMemory(size)
    assert store.save(store.values(1.0, 1)) != OK
    assert store.load() == (EMPTY, store.own)


@pytest.mark.parametrize(("place", "content"), [(KEY_AT, KEY_CONTENT), (TIME_AT, TIME_CONTENT)])
@pytest.mark.parametrize("generation", range(1, 5))
def test_a_cut_at_any_byte_of_a_signing_record_leaves_the_old_or_the_new_one(
    place: int, content: int, generation: int
) -> None:
    store, offset = FlashMemory(), PC - TAIL + place
    assert store.save(store.values(1.0, 3)) == OK
    parameters = store.load()
    for earlier in range(1, generation):
        assert store.save_record(offset, bytes([earlier]) * content)
    old, before, new = store.load_record(offset, content), bytes(store.bytes), bytes([0xA5]) * content
    for cut, word, torn in tears(LOG_HEADER + content + 8, seed=generation):
        store.bytes[:] = before
        store.save_record(offset, new, cut, word, torn)
        assert store.load_record(offset, content) in (old, (OK, new)), (cut, word, torn)
        assert store.load() == parameters
    assert old[0] == (EMPTY if generation == 1 else OK)


def test_a_damaged_record_is_told_from_one_never_written() -> None:
    memory, data = (ctypes.c_uint8 * PC)(*b"\xff" * PC), ctypes.create_string_buffer(KEY_CONTENT)
    place = (PC, PC - TAIL, KEY_CONTENT)
    assert library().record_load(memory, *place, data) == EMPTY
    assert library().record_save(memory, *place, data.raw)
    assert library().record_load(memory, *place, data) == OK
    memory[PC - TAIL + 9] ^= 1
    assert library().record_load(memory, *place, data) == DAMAGED


def filled(store: FlashMemory, room: int) -> None:
    """Write the log until less than ``room`` bytes are left in its bank."""
    draw = random.Random(room)
    while len(store.bytes[:SECTOR].rstrip(b"\xff")) + room < SECTOR:
        assert store.save_record(100, draw.randbytes(8))
    assert store.bytes[SECTOR:].count(0xFF) == WHOLE - SECTOR


@pytest.mark.parametrize("new_bank", [False, True])
@pytest.mark.parametrize("stopped", [True, False])
def test_a_power_cut_inside_a_stop_record_comes_up_stopped(stopped: bool, new_bank: bool) -> None:
    """Cut at any byte of a stop or of a release, also where it begins a bank. ``torn`` 0 at byte 0: nothing written."""
    store = FlashMemory()
    store.latch(True)
    store.latch(False)
    if new_bank:
        filled(store, 28)
    if not stopped:
        store.latch(True)
    old, before = store.at_boot(), bytes(store.bytes)
    assert old == (RELEASED if stopped else STOPPED)
    for cut, word, torn in tears(BANK if new_bank else LOG_HEADER + 8, seed=1):
        store.bytes[:] = before
        store.latch(stopped, cut, word, torn)
        untouched, whole = bytes(store.bytes) == before, store.at_boot()
        if untouched:
            assert cut < 4, "the record's first bytes are programmed in vain"
            assert whole == old
        elif stopped:
            assert whole in (STOPPED, UNKNOWN), (cut, word, torn)
        store.latch(False)
        assert store.at_boot() == RELEASED, f"a release after a cut at {cut}"


def test_any_write_that_was_cut_short_comes_up_stopped_until_a_release() -> None:
    """The robot cannot know that it was not the stop. Other writes do not end it."""
    store = FlashMemory()
    store.latch(True)
    store.latch(False)
    assert store.save(store.values(1.0, 20)) == OK
    before = bytes(store.bytes)
    assert store.save(store.values(2.0, 20), cut=30) != OK
    assert bytes(store.bytes) != before
    for _ in range(2):
        assert store.at_boot() == UNKNOWN
    store.latch(True)  # what the background does first
    assert store.save(store.values(1.0, 20)) == OK
    assert store.at_boot() == STOPPED
    store.latch(False)
    assert store.at_boot() == RELEASED
