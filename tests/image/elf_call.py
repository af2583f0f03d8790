# SPDX-License-Identifier: MIT
"""Calls functions inside a linked Cortex-M7 program: its own machine code, by symbol, on Unicorn's processor model.

Memory is the i.MX RT1062's: ITCM, DTCM, OCRAM and flash (reference manual, chapter 2, memory map). The program is laid
out as its start-up code leaves it: code and data at the addresses they run at, everything else zero. Nothing is
booted: there are no interrupts, no caches and no clock. An access to a peripheral is an error unless `map_registers`
made plain memory of them.

    image = ElfCall(Path("firmware.elf"))
    image.call("omni_wrap_pi", floats=[7.0])

Unicorn's model has no double precision: such an instruction ends a call with an error, it is never skipped. One helper
of the compiler's library that the core needs is made of such instructions: `__aeabi_f2ulz`, a float to a 64-bit whole
number. Its result is put in its place.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from elftools.elf.elffile import ELFFile
from unicorn import UC_ARCH_ARM, UC_HOOK_CODE, UC_MODE_MCLASS, UC_MODE_THUMB, Uc, UcError, arm_const

MEMORY = {0x00000000: 512, 0x00200000: 4, 0x20000000: 512, 0x20200000: 512, 0x60000000: 2048}
"""KB from an address on: ITCM, a page of the boot ROM, DTCM, OCRAM, flash. How the TCMs share 512 KB is not checked."""
RETURN = 0x00200000
"""Where a called function returns to: nothing is executed there."""
REGISTERS = {0x40000000: 48 * 1024, 0xE0000000: 1024}
"""KB of the peripherals' and the processor's own registers."""
STACK_POINTER = 0x20078000
_CORE_REGISTERS = tuple(getattr(arm_const, f"UC_ARM_REG_R{i}") for i in range(4))
_FLOAT_REGISTERS = tuple(getattr(arm_const, f"UC_ARM_REG_S{i}") for i in range(16))


DOUBLE_HELPER = "__aeabi_f2ulz"


def _float_to_whole(uc: Uc, _address: int, _size: int, _data: object) -> None:
    """Towards zero, limited to 64 bits, a NaN to 0, as libgcc's helper does on the chip."""
    value = struct.unpack("<f", struct.pack("<I", uc.reg_read(arm_const.UC_ARM_REG_R0)))[0]
    whole = 0 if math.isnan(value) else int(max(0.0, min(value, 2.0**64)))
    whole = min(whole, 2**64 - 1)
    uc.reg_write(arm_const.UC_ARM_REG_R0, whole & 0xFFFFFFFF)
    uc.reg_write(arm_const.UC_ARM_REG_R1, whole >> 32)
    uc.reg_write(arm_const.UC_ARM_REG_PC, uc.reg_read(arm_const.UC_ARM_REG_LR))


class CallError(Exception):
    """A call did not come back; the message names the function and the place."""


class ElfCall:
    """A program in memory, and further ones beside it."""

    HIGH_RESULT = arm_const.UC_ARM_REG_R1
    """Register of the upper half of a 64-bit result."""

    def __init__(self, program: Path) -> None:
        """Raise FileNotFoundError, or ELFError if it is no ELF file."""
        self.symbols: dict[str, int] = {}
        self.uc = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
        self.uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M7)
        for begin, size in MEMORY.items():
            self.uc.mem_map(begin, size * 1024)
        self._functions: list[tuple[int, int, str]] = []
        self.load(program)

    def load(self, program: Path) -> None:
        """Load a program; its symbols come after those of the programs before, which keep theirs."""
        with program.open("rb") as file:
            elf = ELFFile(file)
            for segment in elf.iter_segments("PT_LOAD"):
                if segment["p_filesz"] > 0:
                    self.uc.mem_write(segment["p_vaddr"], segment.data())
            for symbol in elf.get_section_by_name(".symtab").iter_symbols():
                self._take(symbol)
        self._functions.sort()

    def _take(self, symbol: Any) -> None:
        if symbol["st_shndx"] == "SHN_UNDEF" or not symbol.name or symbol.name.startswith("$"):
            return
        self.symbols.setdefault(symbol.name, symbol["st_value"])
        if symbol.name == DOUBLE_HELPER:
            begin = symbol["st_value"] & ~1
            self.on(UC_HOOK_CODE, _float_to_whole, begin, begin)
        if symbol["st_info"]["type"] == "STT_FUNC":
            self._functions.append((symbol["st_value"] & ~1, symbol["st_size"], symbol.name))

    def map_registers(self) -> None:
        """Make plain memory of all registers: what is written is read back, nothing happens."""
        for begin, size in REGISTERS.items():
            self.uc.mem_map(begin, size * 1024)

    def call(self, function: str | int, *words: int, floats: Sequence[float] = (), instructions: int = 0) -> int:
        """Call a function with up to four words and sixteen floats (AAPCS, hard-float) and return r0.

        ``instructions``: how many it may take, 0 for any number. Raises KeyError if there is no such symbol, CallError
        if it does not come back.
        """
        address = self.symbols[function] if isinstance(function, str) else function
        name = function if isinstance(function, str) else f"{function:#010x}"
        for register, word in zip(_CORE_REGISTERS, words, strict=False):
            self.uc.reg_write(register, word)
        for register, value in zip(_FLOAT_REGISTERS, floats, strict=False):
            self.uc.reg_write(register, struct.unpack("<I", struct.pack("<f", value))[0])
        self.uc.reg_write(arm_const.UC_ARM_REG_SP, STACK_POINTER)
        self.uc.reg_write(arm_const.UC_ARM_REG_LR, RETURN | 1)
        try:
            self.uc.emu_start(address | 1, RETURN, count=instructions)
        except UcError as error:
            raise CallError(f"{name}: {error} in {self.where(self.pc)}") from error
        if self.pc != RETURN:
            raise CallError(f"{name}: not back after {instructions} instructions, in {self.where(self.pc)}")
        return int(self.uc.reg_read(arm_const.UC_ARM_REG_R0))

    @property
    def pc(self) -> int:
        """Address of the next instruction."""
        return int(self.uc.reg_read(arm_const.UC_ARM_REG_PC))

    @property
    def float_result(self) -> float:
        """What the last call returned in s0."""
        word = self.uc.reg_read(arm_const.UC_ARM_REG_S0)
        return float(struct.unpack("<f", struct.pack("<I", word))[0])

    def where(self, address: int) -> str:
        """Name the function that an address belongs to."""
        for begin, size, name in self._functions:
            if begin <= address < begin + size:
                return f"{name}+{address - begin:#x}"
        return f"{address:#010x}"

    def read(self, address: int, size: int) -> bytes:
        return bytes(self.uc.mem_read(address, size))

    def write(self, address: int, data: bytes) -> None:
        self.uc.mem_write(address, data)

    def word(self, address: int) -> int:
        return int.from_bytes(self.read(address, 4), "little")

    def set_word(self, address: int, value: int) -> None:
        self.write(address, value.to_bytes(4, "little"))

    def on(self, kind: int, callback: Callable[..., Any], begin: int = 1, end: int = 0) -> int:
        """Call back on what happens between two addresses, the last included (unicorn.UC_HOOK_...); else everywhere."""
        return int(self.uc.hook_add(kind, callback, None, begin, end))

    def off(self, hook: int) -> None:
        """Take a callback away."""
        self.uc.hook_del(hook)
