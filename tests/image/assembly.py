# SPDX-License-Identifier: MIT
"""Small programs in assembly for the emulated processor, wrapped as a boot image."""

from __future__ import annotations

import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path

from elftools.elf.elffile import ELFFile

from tests.needs import need

FLASH = 0x60000000
IMAGE_AT = 0x2000
RAM = 0x20000000
"""Start of the tightly coupled data memory, where the programs leave what they found."""

_PROLOGUE = f"""
.syntax unified
.cpu cortex-m7
.fpu fpv5-d16
.thumb
.section .text
.balign 1024
vectors: .word 0x20010000, reset + 1
.rept 174
.word default_handler + 1
.endr
.thumb_func
.global reset
reset:
    ldr r0, =0xE000ED08
    ldr r1, =vectors_in_ram
    str r1, [r0]                @ VTOR
    ldr r2, =vectors
    movw r3, #176
1:  ldr r4, [r2], #4
    str r4, [r1], #4
    subs r3, #1
    bne 1b
    ldr r0, =0xE000ED88
    ldr r1, =0x00F00000
    str r1, [r0]                @ the floating-point unit on
    ldr sp, =0x2000F000
    ldr r7, =0x{RAM:08X}         @ results go here
    b main
.thumb_func
default_handler:
    mrs r0, ipsr
    ldr r1, =unexpected
    str r0, [r1]
    b .
.set vectors_in_ram, 0x20001000
.set unexpected, 0x20000F00
.macro handler number, function
    ldr r0, =vectors_in_ram + 4 * \\number
    ldr r1, =\\function + 1
    str r1, [r0]
.endm
.thumb_func
.global done
done: b done
"""


@dataclass(frozen=True)
class Program:
    """Flash memory's contents, and where the program's labels are."""

    flash: bytes
    symbols: dict[str, int]


def assemble(source: str, folder: Path) -> Program:
    """Assemble ``source``: its ``main`` runs with r7 at ``RAM`` and branches to ``done`` in the end.

    Skips the test without an assembler.
    """
    need("arm")
    text = folder / "program.s"
    text.write_text(_PROLOGUE + source + "\n.pool\n", encoding="ascii")
    program = folder / "program.elf"
    address = f"-Ttext=0x{FLASH + IMAGE_AT:08X}"
    command = [
        "arm-none-eabi-gcc",
        "-mcpu=cortex-m7",
        "-mfpu=fpv5-d16",
        "-mfloat-abi=hard",
        "-nostdlib",
        address,
        "-e",
        "reset",
    ]
    subprocess.run([*command, str(text), "-o", str(program)], check=True)
    with program.open("rb") as file:
        elf = ELFFile(file)
        code = elf.get_section_by_name(".text").data()
        table = elf.get_section_by_name(".symtab")
        symbols = {entry.name: int(entry["st_value"]) for entry in table.iter_symbols() if entry.name}
    return Program(_boot_image(code, symbols["reset"]), symbols)


def _boot_image(code: bytes, entry: int) -> bytes:
    """Put what the boot ROM looks at before the code: configuration block, vector table, boot data."""
    flash = bytearray(b"\xff" * IMAGE_AT)
    flash[0:8] = struct.pack("<2I", 0x42464346, 0x56010000)
    flash[0x50:0x54] = struct.pack("<I", 0x200000)
    flash[0x80:0x180] = struct.pack("<3I", 0x0A1804EB, 0x32041EFF, 0x00002601).ljust(0x100, b"\0")
    length = IMAGE_AT + len(code)
    flash[0x1000:0x1020] = struct.pack("<8I", 0x432000D1, entry | 1, 0, 0, FLASH + 0x1020, FLASH + 0x1000, 0, 0)
    flash[0x1020:0x102C] = struct.pack("<3I", FLASH, length, 0)
    return bytes(flash) + code
