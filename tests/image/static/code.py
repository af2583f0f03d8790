# SPDX-License-Identifier: MIT
"""The machine code of an image, function by function: instructions, the ways through them, and what they call.

Read from the linked ELF file alone, so that libraries, assembly and what the linker added are all in it.
"""

from __future__ import annotations

import bisect
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import capstone
from capstone import arm_const as arm
from elftools.elf.elffile import ELFFile

THUMB = 1


class CodeError(Exception):
    """The code has a form that is not understood, so that nothing can be promised of it."""


@dataclass
class Step:
    """One instruction of a function. ``after``: addresses inside the function that may be next."""

    address: int
    size: int
    text: str
    insn: capstone.CsInsn
    after: list[int] = field(default_factory=list)
    calls: tuple[int, ...] = ()
    """Functions that are called here, if they are known from this instruction."""
    register: str = ""
    """The register that holds the function that is called here."""
    leaves: bool = False
    """The function ends here: a return, or a jump into another function (then ``calls`` or ``register`` name it)."""


@dataclass
class Function:
    """The steps of a function by address."""

    name: str
    start: int
    end: int
    steps: dict[int, Step] = field(default_factory=dict)

    @property
    def returns(self) -> bool:
        """Whether any way leads out of it."""
        return any(step.leaves for step in self.steps.values())


class Program:
    """An image's functions, taken apart when they are first asked for."""

    def __init__(self, elf_file: Path) -> None:
        with elf_file.open("rb") as file:
            elf = ELFFile(file)
            self.segments = [
                (int(part["sh_addr"]), part.data())
                for part in elf.iter_sections()
                if part["sh_flags"] & 2 and part["sh_type"] == "SHT_PROGBITS" and part["sh_size"]
            ]
            symbols = elf.get_section_by_name(".symtab")
            entries = [
                (s.name, int(s["st_value"]), int(s["st_size"]), s["st_info"]["type"]) for s in symbols.iter_symbols()
            ]
        self.objects = {name: (value, size) for name, value, size, kind in entries if kind == "STT_OBJECT"}
        self.values = {name: value for name, value, _, _ in entries}
        self._names: dict[int, list[str]] = {}
        sizes: dict[int, int] = {}
        for name, value, size, kind in entries:
            if kind == "STT_FUNC" and value & THUMB:
                self._names.setdefault(value & ~THUMB, []).append(name)
                sizes[value & ~THUMB] = max(size, sizes.get(value & ~THUMB, 0))
        self._starts = sorted(self._names)
        self._sizes = sizes
        self._constants = {value for name, value, _, _ in entries if re.match(r"\$d(\.|$)", name)}
        self._engine = capstone.Cs(capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS)
        self._engine.detail = True
        self._functions: dict[int, Function] = {}
        self._in_work: set[int] = set()

    @cached_property
    def addresses(self) -> dict[str, int]:
        """Start of each function by its name in the symbol table."""
        return {name: start for start, names in self._names.items() for name in names}

    @property
    def starts(self) -> list[int]:
        """Starts of all functions."""
        return self._starts

    def names(self, start: int) -> list[str]:
        """Return the names of the function at an address (aliases have the same one)."""
        return self._names[start]

    def read(self, address: int, count: int) -> bytes:
        """Return bytes of the image. Raises CodeError outside of it."""
        for start, data in self.segments:
            if start <= address and address + count <= start + len(data):
                return bytes(data[address - start : address - start + count])
        raise CodeError(f"nothing is at {address:#x}")

    def word(self, address: int) -> int:
        """Return a 32-bit word of the image."""
        return int(struct.unpack("<I", self.read(address, 4))[0])

    def is_function(self, value: int) -> bool:
        """Whether a word is the address of a function, as a pointer to it would be."""
        return bool(value & THUMB) and (value & ~THUMB) in self._names

    def function(self, start: int) -> Function:
        """Return a function by its start. Raises CodeError for code that is not understood."""
        if start not in self._functions:
            self._in_work.add(start)
            self._functions[start] = self._take_apart(start)
            self._in_work.discard(start)
        return self._functions[start]

    def _take_apart(self, start: int) -> Function:
        at = bisect.bisect_right(self._starts, start)
        following = self._starts[at] if at < len(self._starts) else start + 0x10000
        end = start + self._sizes[start] if self._sizes[start] else following
        end = min(end, self._segment_end(start))
        function = Function(self._names[start][0], start, end)
        open_ends = [start]
        while open_ends:
            address = open_ends.pop()
            if address not in function.steps:
                open_ends += self._run(function, address)
        return function

    def _segment_end(self, address: int) -> int:
        return next(start + len(data) for start, data in self.segments if start <= address < start + len(data))

    def _run(self, function: Function, address: int) -> list[int]:
        """Take in instructions from an address on, up to one that goes elsewhere; return where it may go."""
        code = self.read(address, function.end - address)
        before: Step | None = None
        for insn in self._engine.disasm(code, address):
            if before is not None and insn.address not in self._constants:
                before.after.append(insn.address)
            if insn.address in function.steps or insn.address in self._constants:
                return []
            step = Step(insn.address, insn.size, f"{insn.mnemonic} {insn.op_str}", insn)
            function.steps[insn.address] = step
            targets = self._targets(function, step)
            step.after += targets
            if not self._falls_through(step):
                return targets
            if targets:
                return [*targets, self._next(function, step)]
            before = step
        raise CodeError(f"{function.name}: the code at {address:#x} runs out of the function")

    def _next(self, function: Function, step: Step) -> int:
        following = step.address + step.size
        if following >= function.end:
            raise CodeError(f"{function.name}: {step.text} at {step.address:#x} runs out of the function")
        step.after.append(following)
        return following

    def _targets(self, function: Function, step: Step) -> list[int]:
        """Return where a jump leads inside the function; note what is called, and whether the function ends here."""
        insn = step.insn
        if insn.id in (arm.ARM_INS_TBB, arm.ARM_INS_TBH):
            return self._table(function, step)
        if insn.id in (arm.ARM_INS_BL, arm.ARM_INS_BLX):
            self._note_call(step)
            return []
        if insn.id in (arm.ARM_INS_B, arm.ARM_INS_CBZ, arm.ARM_INS_CBNZ):
            target = insn.operands[-1].imm & 0xFFFFFFFF
            if function.start <= target < function.end:
                return [target]
            step.leaves, step.calls = True, (target,)
        elif insn.id == arm.ARM_INS_BX:
            step.leaves = True
            step.register = "" if insn.op_str == "lr" else insn.op_str
        elif self._writes_pc(insn):
            step.leaves = True
            if insn.id == arm.ARM_INS_LDR and insn.operands[1].mem.base == arm.ARM_REG_PC:
                step.calls = (self.literal(insn) & ~THUMB,)
            elif insn.id == arm.ARM_INS_MOV:
                raise CodeError(f"{function.name}: {step.text} at {step.address:#x}")
        return []

    def _note_call(self, step: Step) -> None:
        operand = step.insn.operands[0]
        if operand.type == arm.ARM_OP_IMM:
            step.calls = (operand.imm & 0xFFFFFFFF & ~THUMB,)
        else:
            step.register = step.insn.op_str

    @staticmethod
    def _writes_pc(insn: capstone.CsInsn) -> bool:
        if insn.id in (arm.ARM_INS_POP, arm.ARM_INS_LDM):
            return any(operand.reg == arm.ARM_REG_PC for operand in insn.operands)
        return insn.id in (arm.ARM_INS_LDR, arm.ARM_INS_MOV) and insn.operands[0].reg == arm.ARM_REG_PC

    def literal(self, insn: capstone.CsInsn) -> int:
        """Return the constant that `ldr rN, [pc, #n]` loads."""
        return self.word(((insn.address + 4) & ~3) + insn.operands[1].mem.disp)

    def _falls_through(self, step: Step) -> bool:
        """Whether the next instruction in memory may be the next one that runs."""
        insn = step.insn
        conditional = insn.cc not in (arm.ARM_CC_AL, arm.ARM_CC_INVALID)
        if insn.id in (arm.ARM_INS_CBZ, arm.ARM_INS_CBNZ) or conditional:
            return True
        if insn.id in (arm.ARM_INS_TBB, arm.ARM_INS_TBH, arm.ARM_INS_B, arm.ARM_INS_UDF) or step.leaves:
            return False
        if insn.id in (arm.ARM_INS_BL, arm.ARM_INS_BLX):
            known = not step.calls or self._comes_back(step.calls[0])
            return known and insn.address + insn.size not in self._constants
        return True

    def _comes_back(self, start: int) -> bool:
        if start in self._in_work:
            return True
        if start not in self._names:
            raise CodeError(f"a call of {start:#x}, where no function begins")
        function = self.function(start)
        return function.returns

    def _table(self, function: Function, step: Step) -> list[int]:
        """Return where a switch's table leads; the comparison before it says how long it is."""
        insn = step.insn
        index = insn.reg_name(insn.operands[0].mem.index)
        count = self._table_length(function, step, index)
        width = 2 if insn.id == arm.ARM_INS_TBH else 1
        base = insn.address + 4
        table = self.read(base, count * width)
        entries = struct.unpack(f"<{count}{'H' if width == 2 else 'B'}", table)
        return sorted({base + 2 * entry for entry in entries})

    @staticmethod
    def _table_length(function: Function, step: Step, index: str) -> int:
        for address in sorted((at for at in function.steps if at < step.address), reverse=True)[:12]:
            insn = function.steps[address].insn
            if insn.id == arm.ARM_INS_CMP and insn.reg_name(insn.operands[0].reg) == index:
                return int(insn.operands[1].imm) + 1
        raise CodeError(f"{function.name}: no bound is seen for the table at {step.address:#x}")


def backwards(function: Function, step: Step, most: int = 40) -> Iterator[capstone.CsInsn]:
    """Return the instructions before a step, nearest first, as they lie in memory."""
    earlier = sorted((at for at in function.steps if at < step.address), reverse=True)
    return (function.steps[at].insn for at in earlier[:most])
