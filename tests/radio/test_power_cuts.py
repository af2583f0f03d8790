# SPDX-License-Identifier: MIT
"""Power cut at every byte of every save, all enumerated, whole and torn bytes and words: old content or new."""

from __future__ import annotations

import ctypes
import random
import struct
import zlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest

from tests.native import ROOT, core_archive, kept_library
from tests.parameter_sets import NOWHERE, TABLE, drawn_values

OK, EMPTY, FULL = 0, 1, 2
DAMAGED = 2
TEENSY, PC = 1080, 2048
TAIL = 192
HEADER, ENTRY, CRC = 16, 6, 4
ALL_BITS = 0xFFFFFFFF
KEY_AT, KEY_CONTENT = 0, 36
TIME_AT, TIME_CONTENT = 96, 8


@lru_cache
def library() -> Any:
    app = ROOT / "firmware" / "app" / "storage"
    sources = [app / "param_store.cpp", app / "record_store.cpp", Path(__file__).with_name("store_shim.cpp")]
    loaded: Any = ctypes.CDLL(str(kept_library("stores", sources, archives=[core_archive()])))
    return loaded


def slot_size(memory: int) -> int:
    return min((memory - TAIL) // 2, HEADER + ENTRY * int(library().param_count()) + CRC)


def slot_entries(memory: int) -> int:
    return (slot_size(memory) - HEADER - CRC) // ENTRY


class ParameterMemory:
    """A memory and what a robot would find in it."""

    def __init__(self, size: int) -> None:
        self.bytes = bytearray(b"\xff" * size)
        self.own = [NOWHERE] * len(TABLE)

    def values(self, seed: float, differing: int) -> list[float]:
        """Return a set whose first ``differing`` parameters have values within their ranges, another for each seed."""
        return drawn_values(seed)[:differing] + self.own[differing:]

    def save(self, values: list[float], cut: int | None = None, word: int = 1, torn: int = 0) -> int:
        image = (ctypes.c_uint8 * len(self.bytes)).from_buffer(self.bytes)
        floats = ctypes.c_float * len(self.own)
        length = len(self.bytes) if cut is None else cut
        return int(
            library().param_save(
                image, len(self.bytes), floats(*values), floats(*self.own), length, word, ctypes.c_uint32(torn)
            )
        )

    def load(self) -> tuple[int, list[float]]:
        image = (ctypes.c_uint8 * len(self.bytes)).from_buffer(self.bytes)
        values = (ctypes.c_float * len(self.own))(*self.own)
        result = int(library().param_load(image, len(self.bytes), values))
        return result, list(values)


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


@pytest.mark.full
@pytest.mark.parametrize("memory", [TEENSY, PC])
@pytest.mark.parametrize("generation", [1, 2, 3])
@pytest.mark.parametrize("differing", [1, 20, None])
def test_a_cut_at_any_byte_of_a_parameter_save_leaves_the_old_or_the_new_set(
    memory: int, generation: int, differing: int | None
) -> None:
    """``generation`` 1 is the first save ever, 2 and 3 go into either slot; None differing fills the slot."""
    store = ParameterMemory(memory)
    count = min(slot_entries(memory), len(store.own)) if differing is None else differing
    for earlier in range(1, generation):
        assert store.save(store.values(10.0 * earlier, count)) == OK
    old_result, old = store.load()
    before = bytes(store.bytes)
    new = store.values(100.0, count)
    assert store.save(new) == OK
    assert store.load() == (OK, new)
    length = HEADER + ENTRY * count + CRC
    seen_new = 0
    for cut, word, torn in tears(length, seed=generation):
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


def test_a_set_that_needs_a_byte_more_than_a_slot_is_refused_and_the_old_one_stays() -> None:
    store = ParameterMemory(TEENSY)
    room = slot_entries(TEENSY)
    assert room == 70 < len(store.own)
    assert store.save(store.values(1.0, room)) == OK
    before = bytes(store.bytes)
    assert store.save(store.values(2.0, room + 1)) == FULL
    assert bytes(store.bytes) == before
    assert store.load() == (OK, store.values(1.0, room))


def renumber(store: ParameterMemory, slot: int, sequence: int) -> None:
    """Change the sequence number of a slot and its CRC with it."""
    at = slot * slot_size(len(store.bytes))
    struct.pack_into("<I", store.bytes, at + 8, sequence)
    (count,) = struct.unpack_from("<I", store.bytes, at + 12)
    length = HEADER + ENTRY * count
    struct.pack_into("<I", store.bytes, at + length, zlib.crc32(bytes(store.bytes[at : at + length])))


@pytest.mark.parametrize("sequence", [0, 1, 0x7FFFFFFE, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFD, 0xFFFFFFFE, 0xFFFFFFFF])
def test_the_sequence_number_wraps_without_losing_a_save(sequence: int) -> None:
    store = ParameterMemory(TEENSY)
    assert store.save(store.values(1.0, 5)) == OK
    renumber(store, 0, sequence)
    for generation in range(2, 8):
        before, (_, old) = bytes(store.bytes), store.load()
        new = store.values(float(generation), 5)
        for cut, word, torn in tears(HEADER + ENTRY * 5 + CRC, seed=generation):
            store.bytes[:] = before
            store.save(new, cut, word, torn)
            assert store.load()[1] in (old, new), (cut, word, torn)
        store.bytes[:] = before
        assert store.save(new) == OK
        assert store.load() == (OK, new)


@pytest.mark.parametrize("count", [0, 1, 69, 70, 71, 1000, 0x7FFFFFFF, 0xFFFFFFFF, 0x2AAAAAA8])
def test_a_corrupted_count_reads_nothing_beyond_the_slot_and_falls_back(count: int) -> None:
    store = ParameterMemory(TEENSY)
    assert store.save(store.values(1.0, 30)) == OK
    assert store.save(store.values(2.0, 30)) == OK
    struct.pack_into("<I", store.bytes, slot_size(TEENSY) + 12, count)
    assert store.load() == (OK, store.values(1.0, 30))
    struct.pack_into("<I", store.bytes, 12, count)
    assert store.load() == (EMPTY, store.own)


def test_every_single_damaged_bit_is_noticed() -> None:
    store = ParameterMemory(TEENSY)
    assert store.save(store.values(1.0, 3)) == OK
    assert store.save(store.values(2.0, 3)) == OK
    base = slot_size(TEENSY)
    for bit in range(8 * (HEADER + 3 * ENTRY + CRC)):
        store.bytes[base + bit // 8] ^= 1 << bit % 8
        assert store.load() == (OK, store.values(1.0, 3)), bit
        store.bytes[base + bit // 8] ^= 1 << bit % 8


@pytest.mark.parametrize("size", [0, 1, 100, TAIL, TAIL + 2, TAIL + 2 * (HEADER + CRC) - 1])
def test_a_memory_too_small_for_a_slot_is_refused(size: int) -> None:
    store = ParameterMemory(TEENSY)
    store.bytes = bytearray(size + 1)[:size] or bytearray(1)
    if size:
        assert store.save(store.values(1.0, 1)) != OK
        assert store.load() == (EMPTY, store.own)


class RecordMemory:
    """A memory with one record in it."""

    def __init__(self, offset: int, content: int) -> None:
        self.bytes = bytearray(b"\xff" * TEENSY)
        self.offset, self.content = TEENSY - TAIL + offset, content

    def save(self, data: bytes, cut: int = TEENSY, word: int = 1, torn: int = 0) -> bool:
        image = (ctypes.c_uint8 * TEENSY).from_buffer(self.bytes)
        done = library().record_save(image, TEENSY, self.offset, self.content, data, cut, word, ctypes.c_uint32(torn))
        return bool(done)

    def load(self) -> tuple[int, bytes]:
        image = (ctypes.c_uint8 * TEENSY).from_buffer(self.bytes)
        data = ctypes.create_string_buffer(self.content)
        result = int(library().record_load(image, TEENSY, self.offset, self.content, data))
        return result, data.raw


@pytest.mark.parametrize(("offset", "content"), [(KEY_AT, KEY_CONTENT), (TIME_AT, TIME_CONTENT)])
@pytest.mark.parametrize("generation", range(1, 5))
def test_a_cut_at_any_byte_of_a_signing_record_leaves_the_old_or_the_new_one(
    offset: int, content: int, generation: int
) -> None:
    store = RecordMemory(offset, content)
    for earlier in range(1, generation):
        assert store.save(bytes([earlier]) * content)
    old, before, new = store.load(), bytes(store.bytes), bytes([0xA5]) * content
    for cut, word, torn in tears(content + 12, seed=generation):
        store.bytes[:] = before
        store.save(new, cut, word, torn)
        assert store.load() in (old, (OK, new)), (cut, word, torn)
    assert old[0] == (EMPTY if generation == 1 else OK)
    assert store.bytes[: store.offset] == before[: store.offset]  # the parameters' bytes are not touched


def test_a_record_damaged_in_both_slots_is_told_from_one_never_written() -> None:
    store = RecordMemory(KEY_AT, KEY_CONTENT)
    assert store.load()[0] == EMPTY
    assert store.save(bytes(KEY_CONTENT))
    store.bytes[store.offset + 9] ^= 1
    assert store.load()[0] == EMPTY  # as after the first write ever was cut short
    assert store.save(bytes(KEY_CONTENT))
    assert store.save(bytes(KEY_CONTENT))
    for slot in range(2):
        store.bytes[store.offset + slot * (KEY_CONTENT + 12) + 9] ^= 1
    assert store.load()[0] == DAMAGED
