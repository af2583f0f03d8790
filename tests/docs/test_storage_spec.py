# SPDX-License-Identifier: MIT
"""The page of the storage format is true: its vectors hold for a reader written from the page, and for the firmware."""

from __future__ import annotations

import ctypes
import re
import struct
import zlib
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.native import ROOT, kept_library
from tests.parameter_sets import NOWHERE, TABLE
from tests.radio.test_power_cuts import PC, ParameterMemory, library

PAGE = ROOT / "docs" / "reference" / "storage.md"
SECTOR, IMAGE_AT, LOG_AT, CAPACITY = 4096, 16, 2064, 2048
RECORDS = {"emergency-stop": 4, "signing-time": 8}


@cache
def vectors() -> dict[str, bytes]:
    """Return the bytes of the page's blocks by name."""
    found = {}
    for name, body in re.findall(r"```text\n# vector: (\S+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        data = bytearray()
        for line in body.splitlines():
            words = line.split("#")[0].split()
            if words and words[0].startswith("@"):
                data += b"\xff" * (int(words.pop(0)[1:]) - len(data))
            data += bytes.fromhex("".join(words))
        found[name] = bytes(data)
    return found


def word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 4], "little")


def key(name: str) -> int:
    return zlib.crc32(name.encode()) & 0xFFFF


def test_every_vector_is_tried_here() -> None:
    assert set(vectors()) == {"parameter-set", "flash-sector", *RECORDS}


def test_a_reader_written_from_the_page_finds_the_parameter_set() -> None:
    data = vectors()["parameter-set"]
    count = word(data, 8)
    assert data[:4] == b"OMP4"
    assert len(data) == 12 + 6 * count + 4
    assert word(data, len(data) - 4) == zlib.crc32(data[:-4])
    entries = dict(struct.iter_unpack("<Hf", data[12:-4]))
    assert entries == {key("ISMC_LAM_XY"): 15.0, key("TRJ_SIZE"): 0.25}


def sample() -> list[float]:
    values = [NOWHERE] * len(TABLE)
    for name, value in (("ISMC_LAM_XY", 15.0), ("TRJ_SIZE", 0.25)):
        values[TABLE[name].index] = value
    return values


@pytest.mark.full
def test_the_firmware_reads_the_parameter_set() -> None:
    memory, data = ParameterMemory(PC), vectors()["parameter-set"]
    memory.bytes[: len(data)] = data
    assert memory.load() == (0, sample())


@pytest.mark.full
def test_the_firmware_writes_the_parameter_set_as_the_page_says() -> None:
    memory, data = ParameterMemory(PC), vectors()["parameter-set"]
    assert memory.save(sample()) == 0
    written = bytes(memory.bytes[: len(data)])
    assert (written[:4], written[8:-4]) == (data[:4], data[8:-4])
    assert word(written, len(data) - 4) == zlib.crc32(written[:-4])


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_is_as_the_page_says_for_reader_and_writer(name: str) -> None:
    data, content = vectors()[name], RECORDS[name]
    assert data[:4] == b"OMR2"
    assert len(data) == content + 8
    assert word(data, 4 + content) == zlib.crc32(data[:-4])
    memory = (ctypes.c_uint8 * PC)(*b"\xff" * PC)
    payload = (ctypes.c_uint8 * content)(*data[4 : 4 + content])
    assert library().record_save(memory, PC, 100, content, payload) == 1
    assert bytes(memory)[100 : 100 + len(data)] == data
    found = (ctypes.c_uint8 * content)()
    assert library().record_load(memory, PC, 100, content, found) == 0
    assert bytes(found) == bytes(payload)


@pytest.fixture(scope="module")
def log() -> Any:
    sources = [ROOT / "firmware/boards/teensy40/flash_log.cpp", Path(__file__).with_name("flash_log_shim.cpp")]
    return ctypes.CDLL(str(kept_library("log", sources)))


def read_sector(sector: bytes) -> bytearray:
    """Return the array that a sector holds; written from the page."""
    image = bytearray(sector[IMAGE_AT:LOG_AT])
    assert sector[:4] == b"OFL1"
    assert word(sector, 8) == zlib.crc32(image)
    assert word(sector, 12) == zlib.crc32(sector[:12])
    at = LOG_AT
    while sector[at : at + 2] != b"\xff\xff":
        offset, length = struct.unpack_from("<HH", sector, at)
        data = sector[at + 8 : at + 8 + length]
        assert word(sector, at + 4) == zlib.crc32(sector[at : at + 4] + data)
        image[offset : offset + length] = data
        at += 8 + (length + 3) // 4 * 4
    return image


def test_the_flash_log_is_as_the_page_says_for_reader_and_writer(log: Any) -> None:
    sector = vectors()["flash-sector"].ljust(SECTOR, b"\xff")
    expected = bytearray(b"\xff" * CAPACITY)
    expected[10:13], expected[2000:2002] = b"\x01\x02\x03", b"\x04\x05"
    assert read_sector(sector) == expected
    memory = (ctypes.c_uint8 * (2 * SECTOR))(*b"\xff" * (2 * SECTOR))
    assert log.log_write(memory, 10, b"\x01\x02\x03", 3) == 1
    assert log.log_write(memory, 2000, b"\x04\x05", 2) == 1
    assert bytes(memory)[:SECTOR] == sector
    found = (ctypes.c_uint8 * CAPACITY)()
    assert log.log_read(memory, found) == 1
    assert bytes(found) == bytes(expected)


@pytest.mark.parametrize("at", [0, 4, 8, 12, 100, 2064, 2068, 2072])
def test_a_flipped_bit_is_noticed_as_the_page_says(log: Any, at: int) -> None:
    """In header or image the bank is void; in a change, this and what follows is left out. Both are in doubt."""
    sector = bytearray(vectors()["flash-sector"].ljust(SECTOR, b"\xff"))
    sector[at] ^= 1
    memory = (ctypes.c_uint8 * (2 * SECTOR))(*sector, *b"\xff" * SECTOR)
    found = (ctypes.c_uint8 * CAPACITY)()
    certain = log.log_read(memory, found)
    if at < LOG_AT:
        assert (certain, bytes(found)) == (0, b"\xff" * CAPACITY)
    else:
        assert (certain, bytes(found)[2000:2002], bytes(found)[10:13]) == (0, b"\xff\xff", b"\x01\x02\x03")
