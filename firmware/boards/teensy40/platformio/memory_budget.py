# SPDX-License-Identifier: MIT
"""What of a Teensy 4.0's memory the firmware takes, and how much it may."""

from __future__ import annotations

from dataclasses import dataclass

KB = 1024
BLOCK = 32 * KB
"""ITCM and DTCM share 512 KB in blocks of this size; what the code does not take is the data's and the stack's."""
TCM_BLOCKS = 16

_FLASH_SECTIONS = (".text.headers", ".text.code", ".text.progmem", ".text.itcm", ".ARM.exidx", ".data", ".text.csf")
_ITCM_SECTIONS = (".text.itcm", ".fini", ".ARM.exidx")
_DTCM_SECTIONS = (".data", ".bss")
_RAM2_SECTIONS = (".bss.dma",)


@dataclass(frozen=True)
class Usage:
    """Bytes in each kind of memory."""

    flash: int
    itcm: int
    dtcm: int
    ram2: int

    @classmethod
    def from_size_output(cls, text: str) -> Usage:
        """Read what ``arm-none-eabi-size -A`` prints; raise ValueError if it is not of a Teensy 4 program."""
        sizes: dict[str, int] = {}
        for line in text.splitlines():
            words = line.split()
            if len(words) == 3 and words[1].isdigit():
                sizes[words[0]] = int(words[1])
        if ".text.itcm" not in sizes:
            raise ValueError("no section .text.itcm: not linked with a Teensy 4's linker script")
        return cls(
            flash=sum(sizes.get(name, 0) for name in _FLASH_SECTIONS),
            itcm=sum(sizes.get(name, 0) for name in _ITCM_SECTIONS),
            dtcm=sum(sizes.get(name, 0) for name in _DTCM_SECTIONS),
            ram2=sum(sizes.get(name, 0) for name in _RAM2_SECTIONS),
        )

    @property
    def stack(self) -> int:
        """Bytes left for the stack."""
        code_blocks = -(-self.itcm // BLOCK)
        return (TCM_BLOCKS - code_blocks) * BLOCK - self.dtcm

    def within_budget(self, added: int = 0) -> bool:
        """Return whether every kind of memory is; ``added``: bytes of code that come on top of ours."""
        return all(used <= allowed for _, used, allowed, _ in rows(self, added)) and self.stack >= STACK_AT_LEAST


FLASH_BUDGET = 264 * KB
ITCM_BUDGET = 192 * KB
DTCM_BUDGET = 160 * KB
RAM2_BUDGET = 224 * KB
STACK_AT_LEAST = 64 * KB
CONTROLLER_CODE = BLOCK
"""Code that a controller from outside the tree may add: the next block, which leaves enough for the stack."""


def rows(usage: Usage, added: int = 0) -> list[tuple[str, int, int, int]]:
    """Return name, bytes used, bytes allowed and bytes there are, per kind of memory."""
    return [
        ("FLASH", usage.flash, FLASH_BUDGET + added, 1984 * KB),
        ("ITCM", usage.itcm, ITCM_BUDGET + added, TCM_BLOCKS * BLOCK),
        ("DTCM", usage.dtcm, DTCM_BUDGET, TCM_BLOCKS * BLOCK),
        ("RAM2", usage.ram2, RAM2_BUDGET, 512 * KB),
    ]


def report(usage: Usage, added: int = 0) -> str:
    """Return the table that a build prints."""
    lines = ["Memory     used    budget     there is   [KB]"]
    for name, used, allowed, there in rows(usage, added):
        verdict = "" if used <= allowed else "   OVER BUDGET"
        lines.append(f"{name:5} {used / KB:9.1f} {allowed / KB:9.0f} {there / KB:12.0f}{verdict}")
    verdict = "" if usage.stack >= STACK_AT_LEAST else f"   TOO LITTLE: {STACK_AT_LEAST // KB} are needed"
    lines.append(f"stack {usage.stack / KB:9.1f} left{verdict}")
    return "\n".join(lines)
