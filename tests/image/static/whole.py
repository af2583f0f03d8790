# SPDX-License-Identifier: MIT
"""The deepest that the whole image's stack can get: the main program and one interrupt of each priority on top."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tests.image.static.calls import Calls
from tests.image.static.running import Interrupt
from tests.image.static.stack import EXCEPTION_BYTES, Deepest, Stack

MAIN = "ResetHandler2"
"""The start-up after the stack pointer was set; it calls `main` and never returns."""
HEAP_FUNCTIONS = ("malloc", "_malloc_r", "calloc", "realloc", "free", "_sbrk", "_sbrk_r", "_Znwj", "_Znaj", "_ZdlPv")
"""Memory from the heap: in C and in C++."""


@dataclass(frozen=True)
class Level:
    """The deepest interrupt of a priority."""

    priority: int
    deepest: Deepest

    @property
    def bytes(self) -> int:
        """What an interrupt of this priority adds."""
        return EXCEPTION_BYTES + self.deepest.bytes


@dataclass(frozen=True)
class Whole:
    """The bound of a whole image: the main program, and what can interrupt it and one another."""

    main: Deepest
    levels: tuple[Level, ...]

    @property
    def bytes(self) -> int:
        """The bound."""
        return self.main.bytes + sum(level.bytes for level in self.levels)


def whole_stack(calls: Calls, interrupts: Sequence[Interrupt]) -> Whole:
    """Return the bound. Interrupts of one priority wait for one another, so only the deepest of them counts."""
    stack = Stack(calls)
    deepest: dict[int, Deepest] = {}
    for interrupt in interrupts:
        found = stack.below(interrupt.function)
        if interrupt.priority not in deepest or found.bytes > deepest[interrupt.priority].bytes:
            deepest[interrupt.priority] = found
    levels = tuple(Level(priority, deepest[priority]) for priority in sorted(deepest, reverse=True))
    return Whole(stack.below(calls.program.addresses[MAIN]), levels)


def heap_functions(calls: Calls) -> list[str]:
    """Return the functions in the image that take memory from a heap; there should be none."""
    return [name for name in HEAP_FUNCTIONS if name in calls.program.addresses]
