# SPDX-License-Identifier: MIT
"""Files in Intel's hex format as the linker would write them for a Teensy 4.0, written without the code under test."""

from __future__ import annotations

import struct
from pathlib import Path

START = 0x6000_0000
LENGTH = 0x3000


def teensy_program(*, length: int = LENGTH, chip_bytes: int = 2 << 20, start: int = START, wiring_id: int = 0) -> bytes:
    """Return an image: configuration block, vector table at 0x1000, boot data at 0x1020, then code.

    ``wiring_id``: what its label says; 0: it has none.
    """
    image = bytearray((7 * index + index // 256) & 0xFF for index in range(length))
    image[0:4] = b"FCFB"
    struct.pack_into("<I", image, 0x50, chip_bytes)
    table = (0x432000D1, start + 0x1501, 0, 0, start + 0x1020, start + 0x1000, start + length - 16, 0)
    struct.pack_into("<8I", image, 0x1000, *table)
    struct.pack_into("<3I", image, 0x1020, start, length, 0)
    if wiring_id:
        label = b"omniwheel wiring id\0" + struct.pack("<I", wiring_id)
        image[0x2000 : 0x2000 + len(label)] = label
    return bytes(image)


def record(kind: int, address: int, data: bytes) -> str:
    """Return one line."""
    content = bytes([len(data), address >> 8, address & 0xFF, kind]) + data
    return f":{(content + bytes([-sum(content) & 0xFF])).hex().upper()}"


def hex_lines(image: bytes, start: int = START) -> list[str]:
    """Return the lines of a file, the end-of-file record being the last."""
    lines = []
    for offset in range(0, len(image), 16):
        address = start + offset
        if offset == 0 or address & 0xFFFF == 0:
            lines.append(record(4, 0, (address >> 16).to_bytes(2, "big")))
        lines.append(record(0, address & 0xFFFF, bytes(image[offset : offset + 16])))
    return [*lines, record(1, 0, b"")]


def write_hex(path: Path, image: bytes, start: int = START) -> Path:
    """Write a file and return its path."""
    path.write_text("\n".join(hex_lines(image, start)) + "\n")
    return path
