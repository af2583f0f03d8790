# SPDX-License-Identifier: MIT
"""What is refused before a board is touched: files that are damaged, cut short or for another board."""

from __future__ import annotations

import hashlib
import os
import struct
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.errors import HexFileError, MissingPackageError
from omniwheel.flashing.hex_file import read_hex
from tests.host.hex_files import LENGTH, START, hex_lines, record, teensy_program, write_hex

LINES = hex_lines(teensy_program())


def refusal(path: Path) -> str:
    with pytest.raises(HexFileError) as caught:
        read_hex(path)
    assert caught.value.hint
    assert caught.value.exit_code == 2
    return str(caught.value)


def lines_refused(folder: Path, lines: list[str]) -> str:
    path = folder / "file.hex"
    path.write_text("\n".join(lines))
    return refusal(path)


def test_a_whole_program_is_read(tmp_path: Path) -> None:
    path = write_hex(tmp_path / "a.hex", teensy_program())
    image = read_hex(path)
    assert image.size == LENGTH
    assert image.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert read_hex(path).size == LENGTH


def test_files_that_are_no_hex_file_at_all(tmp_path: Path) -> None:
    assert "cannot be read" in refusal(tmp_path / "missing.hex")
    (tmp_path / "empty.hex").write_text("\n")
    assert "is empty" in refusal(tmp_path / "empty.hex")
    (tmp_path / "firmware.elf").write_bytes(b"\x7fELF\x01\x01\x01\0")
    assert "not in Intel's hex format" in refusal(tmp_path / "firmware.elf")
    (tmp_path / "mine.toml").write_text("[robot]\n")
    with pytest.raises(HexFileError) as caught:
        read_hex(tmp_path / "mine.toml")
    assert "omni flash --robot" in caught.value.hint
    assert "has no program" in lines_refused(tmp_path, LINES[-1:])
    with (tmp_path / "huge.hex").open("wb") as file:
        file.truncate(17 << 20)
    assert "larger than a Teensy's program" in refusal(tmp_path / "huge.hex")


def test_damage_is_found(tmp_path: Path) -> None:
    wrong = LINES[5][:12] + ("0" if LINES[5][12] != "0" else "1") + LINES[5][13:]
    assert "damaged" in lines_refused(tmp_path, [*LINES[:5], wrong, *LINES[6:]])
    assert "damaged" in lines_refused(tmp_path, [*LINES[:5], LINES[5][:-3], *LINES[6:]])
    assert "damaged" in lines_refused(tmp_path, [*LINES[:5], LINES[5], *LINES[5:]])  # twice
    assert "damaged" in lines_refused(tmp_path, [*LINES[:5], "no record", *LINES[6:]])


def test_a_file_cut_short_is_found_with_and_without_an_end(tmp_path: Path) -> None:
    assert "truncated" in lines_refused(tmp_path, LINES[:-1])
    assert f"the program has {LENGTH} bytes" in lines_refused(tmp_path, [*LINES[:-9], LINES[-1]])


@pytest.mark.parametrize("lost", [0x1000 // 16 + 20, 400, 700])
def test_a_lost_line_is_found(tmp_path: Path, lost: int) -> None:
    assert "bytes are missing" in lines_refused(tmp_path, [*LINES[:lost], *LINES[lost + 1 :]])


@pytest.mark.parametrize("start", [0x0000_0000, 0x2000_0000, START - 0x1000, START + 1984 * 1024 - 0x1000])
def test_programs_for_other_addresses_are_refused(tmp_path: Path, start: int) -> None:
    path = write_hex(tmp_path / "a.hex", teensy_program(start=start & 0xFFFF_FFFF), start)
    assert "a Teensy 4.0's programs are at 0x60000000" in refusal(path)


def test_a_teensy_41s_program_is_refused(tmp_path: Path) -> None:
    path = write_hex(tmp_path / "a.hex", teensy_program(chip_bytes=8 << 20))
    assert "8 MB of flash; a Teensy 4.0 has 2" in refusal(path)


@pytest.mark.parametrize(
    ("offset", "words"),
    [
        (0x0000, "FlexSPI configuration block"),
        (0x1000, "image vector table"),
        (0x1014, "image vector table"),
        (0x1010, "boot data"),  # a pointer to nowhere
        (0x1020, "boot data"),
        (0x1004, "boot data"),  # the entry is outside of the image
    ],
)
def test_what_the_boot_rom_looks_for_must_be_there(tmp_path: Path, offset: int, words: str) -> None:
    image = bytearray(teensy_program())
    struct.pack_into("<I", image, offset, 0x7000_0000)
    assert words in refusal(write_hex(tmp_path / "a.hex", bytes(image)))


def test_a_program_too_short_for_its_tables_is_refused(tmp_path: Path) -> None:
    assert "image vector table" in refusal(write_hex(tmp_path / "a.hex", teensy_program()[:0x1000]))
    assert "configuration block" in refusal(write_hex(tmp_path / "a.hex", teensy_program()[0x1000:], START + 0x1000))


@given(st.lists(st.sampled_from([*LINES[:40], *LINES[-40:], record(2, 0, b"\x10\x00"), ":", "\0"]), max_size=60))
def test_any_lines_are_either_a_program_or_refused(tmp_path_factory: pytest.TempPathFactory, lines: list[str]) -> None:
    path = tmp_path_factory.mktemp("hex") / "any.hex"
    path.write_text("\n".join(lines))
    refusal(path)


def test_without_intelhex_its_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "intelhex", None)
    with pytest.raises(MissingPackageError) as caught:
        read_hex(write_hex(tmp_path / "a.hex", teensy_program()))
    assert "omniwheel[flash]" in caught.value.hint


@pytest.mark.parametrize("name", ["/dev/zero", "pipe", "folder"])
def test_what_is_no_file_is_refused_at_once(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    assert "not a file" in refusal(tmp_path / name)
