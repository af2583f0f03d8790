# SPDX-License-Identifier: MIT
"""A firmware image for the Teensy 4.0 as a file: what goes into flash memory, and what its addresses mean."""

from __future__ import annotations

import bisect
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from omniwheel.errors import FirmwareImageError, MissingPackageError

FLASH_BASE = 0x60000000
FLASH_SIZE = 2 * 1024 * 1024
EXTRA_HINT = "run: pip install 'omniwheel[flash]' (or intelhex, pyelftools and unicorn by themselves)"
_ERASED = b"\xff"
_THUMB = 1
_SHF_ALLOC = 2


@dataclass(frozen=True)
class Place:
    """Where in the program an address is; ``file`` is "" and ``line`` 0 where the image does not tell."""

    function: str
    offset: int
    file: str
    line: int

    def __str__(self) -> str:
        where = f" ({Path(self.file).name}:{self.line})" if self.line else ""
        return f"{self.function}+{self.offset:#x}{where}"


@dataclass(frozen=True)
class Image:
    """Flash memory's contents from ``FLASH_BASE`` on, functions by name, and the ELF file they come from, if any."""

    path: Path
    flash: bytes
    symbols: dict[str, int] = field(default_factory=dict)
    functions: tuple[tuple[int, int, str], ...] = ()
    """Start, size and name, in the order of their addresses."""
    elf: Any = None

    def place(self, address: int) -> Place | None:
        """Return what is at an address; None: no function is known there."""
        at = bisect.bisect_right(self.functions, address, key=lambda entry: entry[0]) - 1
        if at < 0:
            return None
        start, size, name = self.functions[at]
        if address >= start + max(size, 2):
            return None
        file, line = self._lines.find(address) if self._lines is not None else ("", 0)
        return Place(name, address - start, file, line)

    @cached_property
    def _lines(self) -> _Lines | None:
        return _Lines(self.elf) if self.elf is not None and self.elf.has_dwarf_info() else None


class _Lines:
    """Source lines by address, read as far as they are asked for."""

    def __init__(self, elf: Any) -> None:
        self._dwarf = elf.get_dwarf_info()
        self._ranges = self._dwarf.get_aranges()
        self._units: dict[int, list[tuple[int, str, int]]] = {}

    def find(self, address: int) -> tuple[str, int]:
        offset = self._ranges.cu_offset_at_addr(address) if self._ranges is not None else None
        if offset is None:
            return "", 0
        if offset not in self._units:
            self._units[offset] = self._read(offset)
        rows = self._units[offset]
        at = bisect.bisect_right(rows, address, key=lambda row: row[0]) - 1
        return rows[at][1:] if at >= 0 else ("", 0)

    def _read(self, offset: int) -> list[tuple[int, str, int]]:
        unit = self._dwarf.get_CU_at(offset)
        program = self._dwarf.line_program_for_CU(unit)
        if program is None:
            return []
        # Files are counted from 1 up to DWARF 4, from 0 since DWARF 5.
        base = 0 if program.header["version"] >= 5 else 1
        files = [entry.name.decode(errors="replace") for entry in program.header["file_entry"]]
        states = [entry.state for entry in program.get_entries() if entry.state is not None]
        rows = [(s.address, files[s.file - base], s.line) for s in states if 0 <= s.file - base < len(files)]
        return sorted(rows, key=lambda row: row[0])


def read_image(path: Path | str) -> Image:
    """Read an ELF file by its load addresses, or an Intel hex file. Raises FirmwareImageError, MissingPackageError."""
    path = Path(path)
    try:
        head = path.read_bytes()[:4]
    except OSError as error:
        raise FirmwareImageError(f"cannot read the firmware image {path}: {error.strerror}", hint=_MAKE) from error
    return _read_elf(path) if head == b"\x7fELF" else _read_hex(path)


def _read_elf(path: Path) -> Image:
    try:
        from elftools.common.exceptions import ELFError
        from elftools.elf.elffile import ELFFile
    except ImportError as error:
        raise MissingPackageError("reading a firmware image needs pyelftools", hint=EXTRA_HINT) from error
    try:
        elf = ELFFile.load_from_path(str(path))
        flash = _join(_loaded(elf))
        table = elf.get_section_by_name(".symtab")
        entries = [] if table is None else list(table.iter_symbols())
    except (ELFError, ValueError) as error:
        raise FirmwareImageError(f"{path} is not an image of a Teensy 4.0: {error}", hint=_MAKE) from error
    symbols = {str(e.name): int(e["st_value"]) for e in entries if e.name and not e.name.startswith("$")}
    functions = sorted(
        (int(e["st_value"]) & ~_THUMB, int(e["st_size"]), str(e.name))
        for e in entries
        if e["st_info"]["type"] == "STT_FUNC"
    )
    return Image(path, flash, symbols, tuple(functions), elf)


def _loaded(elf: Any) -> list[tuple[int, bytes]]:
    """Return load address and content of what goes into flash memory, section by section.

    Segments would not do: those of zeroed RAM hold some padding in the file.
    """
    segments = list(elf.iter_segments("PT_LOAD"))
    pieces = []
    for section in elf.iter_sections():
        if not section["sh_flags"] & _SHF_ALLOC or section["sh_type"] == "SHT_NOBITS" or section["sh_size"] == 0:
            continue
        for segment in segments:
            if segment.section_in_segment(section):
                pieces.append((int(segment["p_paddr"] + section["sh_offset"] - segment["p_offset"]), section.data()))
    return pieces


def _read_hex(path: Path) -> Image:
    try:
        from intelhex import IntelHex, IntelHexError
    except ImportError as error:
        raise MissingPackageError("reading a firmware image needs intelhex", hint=EXTRA_HINT) from error
    try:
        content = IntelHex(str(path))
        pieces = [(start, content.tobinstr(start=start, end=end - 1)) for start, end in content.segments()]
        return Image(path, _join(pieces))
    except (IntelHexError, UnicodeDecodeError, ValueError) as error:
        raise FirmwareImageError(f"{path} is neither an ELF nor an Intel hex file: {error}", hint=_MAKE) from error


_MAKE = "`make firmware` leaves one in .pio/build/three_wheel/firmware.elf"


def _join(pieces: Any) -> bytes:
    """Put pieces at their addresses together. Raises ValueError."""
    flash = bytearray()
    for address, data in pieces:
        offset = address - FLASH_BASE
        if offset < 0 or offset + len(data) > FLASH_SIZE:
            raise ValueError(f"{len(data)} bytes at {address:#010x} are outside of flash memory")
        flash += _ERASED * (offset + len(data) - len(flash))
        flash[offset : offset + len(data)] = data
    if not flash:
        raise ValueError("it has no loadable content")
    return bytes(flash)
