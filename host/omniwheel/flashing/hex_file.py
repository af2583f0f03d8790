# SPDX-License-Identifier: MIT
"""Looks at a .hex file before it is uploaded: whole, undamaged, and a program for a Teensy 4.0.

The boot ROM of an i.MX RT1062 reads a FlexSPI configuration block at the start of flash. 4 KB behind it, it reads an
image vector table. That points to the boot data with the image's length (reference manual, chapter 9, "System Boot").
"""

from __future__ import annotations

import hashlib
import io
import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omniwheel.errors import HexFileError, MissingPackageError

FLASH_START = 0x6000_0000
FLASH_FOR_PROGRAMS = 1984 * 1024
"""Of 2 MB; Teensyduino's EEPROM emulation, which holds our parameters, and its own recovery program have the rest."""
FLASH_SIZE = 2 * 1024 * 1024
VECTOR_TABLE = FLASH_START + 0x1000
CONFIG_TAG = b"FCFB"
_CHIP_SIZE_OFFSET = 0x50
_TABLE_TAG, _TABLE_LENGTH, _TABLE_VERSIONS = 0xD1, 32, range(0x40, 0x44)
_END_OF_FILE = ":00000001FF"
_LARGEST_FILE = 16 * 1024 * 1024
_LABEL = b"omniwheel wiring id\0"
"""Words in flash memory before the image's wiring id, 32 bit (firmware/boards/teensy40/main.cpp)."""
_AGAIN = "download the file again, or rebuild it"


@dataclass(frozen=True)
class HexImage:
    """A program that may be uploaded: ``size`` bytes of flash from its start, and the file's content.

    ``wiring_id``: ``omni_schema.wiring_id`` of the robot that it was built for; 0 for a program that does not say.
    """

    path: Path
    size: int
    wiring_id: int
    content: bytes = field(repr=False)

    @property
    def sha256(self) -> str:
        """SHA-256 of the content."""
        return hashlib.sha256(self.content).hexdigest()


def read_hex(path: Path) -> HexImage:
    """Read and check a file. Raises HexFileError with what is wrong, MissingPackageError without intelhex."""
    content = _content(path)
    memory = _parsed(path, content)
    _check_addresses(path, memory)
    _check_flash_chip(path, memory)
    length = _image_length(path, memory)
    end = FLASH_START + length
    if memory.maxaddr() + 1 != end:
        have = memory.maxaddr() + 1 - FLASH_START
        raise HexFileError(f"{path}: the program has {length} bytes, the file ends at {have}", hint=_AGAIN)
    missing = length - len(memory)
    if missing:
        raise HexFileError(f"{path}: {missing} of the program's {length} bytes are missing", hint=_AGAIN)
    return HexImage(path, length, _wiring_id(memory.tobinstr()), content)


def _wiring_id(program: bytes) -> int:
    at = program.find(_LABEL)
    return int.from_bytes(program[at + len(_LABEL) :][:4], "little") if at >= 0 else 0


def _content(path: Path) -> bytes:
    try:
        if path.exists() and not path.is_file():  # a device may have no end
            raise HexFileError(f"{path} is not a file", hint="give the path of a .hex file")
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE + 1)
    except OSError as error:
        raise HexFileError(f"{path} cannot be read: {error.strerror}", hint="give the path of a .hex file") from error
    if len(content) > _LARGEST_FILE:
        raise HexFileError(f"{path}: it is larger than a Teensy's program memory", hint=_AGAIN)
    if not content.strip():
        raise HexFileError(f"{path} is empty", hint=_AGAIN)
    return content


def _parsed(path: Path, content: bytes) -> Any:
    """Return the bytes by address."""
    try:
        from intelhex import IntelHex, IntelHexError
    except ImportError as error:
        hint = "pip install 'omniwheel[flash]', or in a clone: make setup"
        raise MissingPackageError("this needs the package intelhex, which is not installed", hint=hint) from error
    lines = content.decode("ascii", errors="replace").split()
    if not lines[0].startswith(":"):
        robot = path.suffix == ".toml"
        hint = f"a robot file: omni flash --robot {path}" if robot else "upload the .hex file, not the .elf or .bin"
        raise HexFileError(f"{path} is not in Intel's hex format", hint=hint)
    memory = IntelHex()
    try:
        memory.loadhex(io.StringIO("\n".join(lines)))
    except IntelHexError as error:
        raise HexFileError(f"{path} is damaged: {error}", hint=_AGAIN) from error
    if lines[-1].upper() != _END_OF_FILE:
        raise HexFileError(f"{path} is truncated: its last line is not the end-of-file record", hint=_AGAIN)
    if len(memory) == 0:
        raise HexFileError(f"{path} has no program", hint=_AGAIN)
    return memory


def _check_addresses(path: Path, memory: Any) -> None:
    first, last = memory.minaddr(), memory.maxaddr()
    if first < FLASH_START or last >= FLASH_START + FLASH_FOR_PROGRAMS:
        raise HexFileError(
            f"{path} has bytes at 0x{first:08X} to 0x{last:08X}; a Teensy 4.0's programs are at 0x{FLASH_START:08X} to "
            f"0x{FLASH_START + FLASH_FOR_PROGRAMS - 1:08X}",
            hint="it is for another board",
        )


def _words(path: Path, memory: Any, address: int, count: int, what: str) -> tuple[int, ...]:
    """Return 32-bit words; HexFileError names ``what`` if the file does not have all of their bytes."""
    wanted = range(address, address + 4 * count)
    have = {at for first, end in memory.segments() for at in range(max(first, wanted.start), min(end, wanted.stop))}
    if len(have) != len(wanted):
        raise HexFileError(f"{path} has no {what} at 0x{address:08X}: the chip would not start it", hint=_AGAIN)
    return struct.unpack(f"<{count}I", memory.tobinstr(start=address, size=4 * count))


def _check_flash_chip(path: Path, memory: Any) -> None:
    words = _words(path, memory, FLASH_START, _CHIP_SIZE_OFFSET // 4 + 1, "FlexSPI configuration block")
    if struct.pack("<I", words[0]) != CONFIG_TAG:
        raise HexFileError(f"{path} has no FlexSPI configuration block: the chip would not start it", hint=_AGAIN)
    if words[-1] != FLASH_SIZE:
        problem = f"{path} is for a board with {words[-1] / 2**20:g} MB of flash; a Teensy 4.0 has {FLASH_SIZE >> 20}"
        raise HexFileError(problem, hint="build it for the Teensy 4.0: omni flash --robot NAME")


def _image_length(path: Path, memory: Any) -> int:
    """Check the vector table and the boot data; return the length of the image that they state."""
    table = _words(path, memory, VECTOR_TABLE, _TABLE_LENGTH // 4, "image vector table")
    header = table[0].to_bytes(4, "little")
    correct = header[0] == _TABLE_TAG and int.from_bytes(header[1:3], "big") == _TABLE_LENGTH
    if not correct or header[3] not in _TABLE_VERSIONS or table[5] != VECTOR_TABLE:
        raise HexFileError(f"{path} has no valid image vector table: the chip would not start it", hint=_AGAIN)
    start, length, _ = _words(path, memory, table[4], 3, "boot data")
    entry = table[1] & ~1  # the lowest bit says Thumb
    if start != FLASH_START or not FLASH_START <= entry < FLASH_START + length:
        raise HexFileError(f"{path} has boot data of another board: the chip would not start it", hint=_AGAIN)
    return length
