# SPDX-License-Identifier: MIT
"""How deep the stack of an image can get: each function's own use from its machine code, added along all calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from capstone import arm_const as arm

from tests.image.static.calls import Calls
from tests.image.static.code import CodeError, Function, Step

EXCEPTION_BYTES = 108
"""What the processor puts on the stack at an interrupt: 26 words with the floating-point registers, one to align."""

_LOST = -1
"""Depth after the stack pointer was set to another memory, as it is before the boot ROM's loader is called."""


@dataclass(frozen=True)
class Deepest:
    """The most bytes of stack below a function's entry, and the functions on the way there."""

    bytes: int
    way: tuple[str, ...]


class Stack:
    """Bounds of the stack, function by function. Raises CodeError for recursion and for code that is not understood."""

    def __init__(self, calls: Calls) -> None:
        self._calls = calls
        self._known: dict[int, Deepest] = {}
        self.pairs: set[tuple[int, int]] = set()
        """Every call that was followed: address of the instruction and start of what it calls."""

    def below(self, start: int, way: tuple[int, ...] = ()) -> Deepest:
        """Return the bound of a function and everything it calls."""
        if start in way and self._calls.ends_at_once.intersection(self._calls.program.names(start)):
            function = self._calls.program.function(start)
            return Deepest(max(depths_of(function).values()), (function.name,))
        if start in way:
            names = [self._calls.program.names(at)[0] for at in (*way[way.index(start) :], start)]
            raise CodeError(f"recursion, so the stack has no bound: {' > '.join(names)}")
        if start not in self._known:
            self._known[start] = self._deepest(start, (*way, start))
        return self._known[start]

    def _deepest(self, start: int, way: tuple[int, ...]) -> Deepest:
        function = self._calls.program.function(start)
        depths = depths_of(function)
        best = Deepest(max(depths.values()), (function.name,))
        for step in function.steps.values():
            if step.address not in depths or depths[step.address] == _LOST:
                continue
            for target in self._calls.targets(function, step):
                self.pairs.add((step.address, target))
                inner = self.below(target, way)
                if depths[step.address] + inner.bytes > best.bytes:
                    best = Deepest(depths[step.address] + inner.bytes, (function.name, *inner.way))
        return best


def depths_of(function: Function) -> dict[int, int]:
    """Return how many bytes a function has on the stack before each of its instructions; 0 at its entry.

    Raises CodeError if two ways to an instruction disagree, or if a change of the stack pointer is not understood.
    """
    depths = {function.start: 0}
    frames: dict[int, dict[int, int]] = {function.start: {}}
    open_ends = [function.start]
    while open_ends:
        address = open_ends.pop()
        step = function.steps[address]
        depth, frame = depths[address], frames[address]
        after = depth if depth == _LOST else _after(function, step, depth, frame)
        for following in step.after:
            if following not in depths:
                depths[following], frames[following] = after, _frame_after(step, depth, frame)
                open_ends.append(following)
            elif depths[following] != after:
                raise CodeError(f"{function.name}: {depths[following]} or {after} bytes on the stack at {following:#x}")
    return depths


def _after(function: Function, step: Step, depth: int, frame: dict[int, int]) -> int:
    """Return the depth after an instruction. ``frame``: registers that hold an earlier stack pointer, as depths."""
    insn = step.insn
    if step.leaves:
        return depth  # taken only where the condition of a return or a jump does not hold
    if insn.id in (arm.ARM_INS_PUSH, arm.ARM_INS_VPUSH, arm.ARM_INS_POP, arm.ARM_INS_VPOP):
        size = sum(_bytes(insn.reg_name(operand.reg)) for operand in insn.operands)
        return depth + (size if insn.id in (arm.ARM_INS_PUSH, arm.ARM_INS_VPUSH) else -size)
    _, written = insn.regs_access()
    if arm.ARM_REG_SP not in written:
        return depth
    operands = insn.operands
    if insn.id in (arm.ARM_INS_SUB, arm.ARM_INS_ADD, arm.ARM_INS_ADDW, arm.ARM_INS_SUBW):
        source = operands[-2].reg
        base = depth if source == arm.ARM_REG_SP else frame.get(source)
        if base is not None and operands[-1].type == arm.ARM_OP_IMM:
            down = insn.id in (arm.ARM_INS_SUB, arm.ARM_INS_SUBW)
            return base + int(operands[-1].imm) * (1 if down else -1)
    if insn.id in (arm.ARM_INS_STR, arm.ARM_INS_STRD, arm.ARM_INS_LDR, arm.ARM_INS_LDRD):
        moved = operands[-1].imm if operands[-1].type == arm.ARM_OP_IMM else operands[-1].mem.disp
        return depth - int(moved)
    if insn.id in (arm.ARM_INS_STMDB, arm.ARM_INS_LDM):
        size = sum(_bytes(insn.reg_name(operand.reg)) for operand in operands[1:])
        return depth + (size if insn.id == arm.ARM_INS_STMDB else -size)
    if insn.id == arm.ARM_INS_MOV:
        return frame.get(operands[1].reg, _LOST)
    raise CodeError(f"{function.name}: {step.text} at {step.address:#x} moves the stack pointer")


def _frame_after(step: Step, depth: int, frame: dict[int, int]) -> dict[int, int]:
    """Return which registers hold a stack pointer after an instruction."""
    insn = step.insn
    _, written = insn.regs_access()
    kept = {register: value for register, value in frame.items() if register not in written}
    operands = insn.operands
    if insn.id == arm.ARM_INS_MOV and len(operands) == 2 and operands[1].reg == arm.ARM_REG_SP:
        kept[operands[0].reg] = depth
    elif insn.id == arm.ARM_INS_ADD and _above_sp(operands):
        kept[operands[0].reg] = depth - int(operands[2].imm)
    return kept


def _above_sp(operands: Sequence[Any]) -> bool:
    """Whether `add rN, sp, #n` puts an address on the stack into another register."""
    from_sp = len(operands) == 3 and operands[1].reg == arm.ARM_REG_SP and operands[2].type == arm.ARM_OP_IMM
    return from_sp and operands[0].reg != arm.ARM_REG_SP


def _bytes(register: str) -> int:
    return 8 if register.startswith("d") else 4
