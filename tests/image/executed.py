# SPDX-License-Identifier: MIT
"""Which instructions of an image were executed: its straight pieces of code (blocks), as Unicorn translates them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from unicorn import UC_HOOK_BLOCK, Uc, arm_const

from tests.image.cortex_m7_model import Cost, Instruction, costs, disassemble
from tests.image.elf_call import DOUBLE_HELPER, ElfCall

Blocks = tuple[int, ...]
"""Addresses of the blocks of the image that were executed, in this order."""


class Code:
    """The image's blocks, their instructions and what these cost."""

    def __init__(self, image: Path, machine: ElfCall) -> None:
        self._instructions = disassemble(image)
        self._end = max(self._instructions) + 4
        self._helper = machine.symbols.get(DOUBLE_HELPER, 0) & ~1
        self._blocks: dict[int, list[Instruction]] = {}
        self._costs: dict[int, Cost] = {}

    def holds(self, address: int) -> bool:
        """Whether an address is the image's, not a guest's."""
        return address < self._end

    def note(self, address: int, size: int) -> None:
        """Take in a block that is executed."""
        if address not in self._blocks:
            self._blocks[address] = self._block(address, size)

    def _block(self, address: int, size: int) -> list[Instruction]:
        """Return the instructions of a block; of the helper that is stood in for all, up to its return."""
        result: list[Instruction] = []
        end = address + size
        while address < end or (result and self._helper == end - size and not result[-1].text.startswith("bx")):
            instruction, length = self._instructions[address]
            result.append(instruction)
            address += length
        return result

    def written_out(self, blocks: Blocks) -> list[Instruction]:
        """Return the instructions in the order of their execution."""
        return [instruction for address in blocks for instruction in self._blocks[address]]

    def count(self, blocks: Blocks) -> int:
        """Return how many instructions were executed."""
        return sum(len(self._blocks[address]) for address in blocks)

    def cost(self, blocks: Blocks) -> Cost:
        """Return the sum of what the blocks cost, each by itself."""
        unknown = [address for address in self._blocks if address not in self._costs]
        if unknown:
            self._costs |= dict(zip(unknown, costs([self._blocks[address] for address in unknown]), strict=True))
        found = [self._costs[address] for address in blocks]
        return Cost(sum(cost.units for cost in found), sum(cost.serial for cost in found))


class Recorder:
    """Records the blocks between a function's entry and its return, without what a guest executes meanwhile."""

    def __init__(self, machine: ElfCall, code: Code, function: int, part: int = 0) -> None:
        """Take ``function`` and ``part``, a function that it calls, by their addresses."""
        self.wanted: Callable[[], bool] = lambda: True
        self.recorded: list[tuple[Blocks, Blocks]] = []
        """Of every call the blocks, and those of the part."""
        self._code = code
        self._function, self._part = function & ~1, part & ~1
        self._blocks: list[int] = []
        self._return = self._part_return = 0
        self._part_ends = [0, 0]
        self._hook = machine.on(UC_HOOK_BLOCK, self._on_block)
        self._machine = machine

    def stop(self) -> None:
        """Record no more."""
        self._machine.off(self._hook)

    def _on_block(self, uc: Uc, address: int, size: int, _data: object) -> None:
        if self._return == 0:
            if address != self._function or not self.wanted():
                return
            self._return = uc.reg_read(arm_const.UC_ARM_REG_LR) & ~1
        elif address == self._return:
            self._finish()
            return
        if address == self._part and self._part > 0:
            self._part_return = uc.reg_read(arm_const.UC_ARM_REG_LR) & ~1
            self._part_ends = [len(self._blocks), 0]
        elif address == self._part_return:
            self._part_ends[1] = len(self._blocks)
            self._part_return = 0
        if self._code.holds(address):
            self._code.note(address, size)
            self._blocks.append(address)

    def _finish(self) -> None:
        begin, end = self._part_ends
        self.recorded.append((tuple(self._blocks), tuple(self._blocks[begin:end])))
        self._blocks.clear()
        self._return = 0

    def finish(self) -> None:
        """End the recording of a call that returned to the host."""
        if self._return:
            self._finish()
