# SPDX-License-Identifier: MIT
"""Which functions a call through a pointer may lead to.

A virtual method is found by its place in the class's table and by its name, which stands in the source line of the
call; the image's line table says which line that is. `indirect.toml` lists what the Teensy core calls through pointers.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from capstone import arm_const as arm

from emulated_teensy.image_file import Image
from tests.image.static.code import CodeError, Function, Program, Step, backwards

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TABLE = Path(__file__).with_name("indirect.toml")
SOURCES = Path(__file__).resolve().parents[3] / "firmware"
_METHOD = re.compile(r"(?:\.|->)\s*(\w+)\s*\(|\b(\w+)\s*\(")
_LINES_AROUND = 4


class Calls:
    """The calls of an image, with the targets of those through pointers."""

    def __init__(self, program: Program, image: Image) -> None:
        self.program = program
        self._image = image
        self._tables = _virtual_tables(program)
        listed = tomllib.loads(TABLE.read_text())
        self._listed = listed["calls"]
        self.ends_at_once = {entry["function"] for entry in listed["ends_at_once"]}
        """Functions that return at once if they are called while they are running."""

    def targets(self, function: Function, step: Step) -> tuple[int, ...]:
        """Return the starts of the functions that a step may call. Raises CodeError if they are not known."""
        if not step.register:
            return step.calls
        constant = self._constant(function, step)
        if constant is not None:
            return (constant,)
        listed = next((entry for entry in self._listed if re.fullmatch(entry["caller"], function.name)), None)
        if listed is not None:
            return self._named(listed["targets"])
        found = self._virtual(function, step)
        if not found:
            place = self._image.place(step.address)
            raise CodeError(f"{function.name}: {step.text} at {step.address:#x} ({place}) leads to no known function")
        return found

    def matching(self, pattern: str) -> int:
        """Return the start of the one function whose symbol fits. Raises CodeError."""
        found = self._named([pattern])
        if len(found) != 1:
            raise CodeError(f"{len(found)} functions are called {pattern}")
        return found[0]

    def _named(self, patterns: Sequence[str]) -> tuple[int, ...]:
        found = set()
        for pattern in patterns:
            matching = {start for name, start in self.program.addresses.items() if re.fullmatch(pattern, name)}
            if not matching:
                raise CodeError(f"{TABLE.name}: no function is called {pattern}")
            found |= matching
        return tuple(sorted(found))

    def _constant(self, function: Function, step: Step) -> int | None:
        """Return the function whose address a `ldr` from the literal pool has just put into the register."""
        for insn in backwards(function, step):
            _, written = insn.regs_access()
            if step.register not in {insn.reg_name(register) for register in written}:
                continue
            if insn.id == arm.ARM_INS_LDR and insn.operands[1].mem.base == arm.ARM_REG_PC:
                value = self.program.literal(insn)
                return value & ~1 if self.program.is_function(value) else None
            return None
        return None

    def _slot(self, function: Function, step: Step) -> int | None:
        """Return the place in a table that the register was loaded from, in words."""
        for insn in backwards(function, step):
            _, written = insn.regs_access()
            if step.register not in {insn.reg_name(register) for register in written}:
                continue
            if insn.id == arm.ARM_INS_LDR and insn.operands[1].mem.base != arm.ARM_REG_PC:
                return int(insn.operands[1].mem.disp) // 4
            return None
        return None

    def _virtual(self, function: Function, step: Step) -> tuple[int, ...]:
        place = self._image.place(step.address)
        if place is None or not place.line:
            return ()
        names = _names_near(Path(place.file).name, place.line)
        methods = {
            (at, target)
            for table in self._tables.values()
            for at, target in enumerate(table)
            if target and _method(self.program.names(target)[0]) in names
        }
        slot = self._slot(function, step)
        at_place = {target for at, target in methods if at == slot}
        return tuple(sorted(at_place or {target for _, target in methods}))


def _virtual_tables(program: Program) -> dict[str, list[int]]:
    """Return the functions of each class's table, 0 for what is none (a pure virtual method)."""
    tables = {}
    for name, (address, size) in program.objects.items():
        if name.startswith("_ZTV"):
            words = [program.word(address + at) for at in range(8, size, 4)]
            tables[name] = [word & ~1 if program.is_function(word) else 0 for word in words]
    return tables


def _method(mangled: str) -> str:
    """Return the last part of a mangled C++ name: the method's own name."""
    if not mangled.startswith("_Z"):
        return mangled
    rest, last = re.sub(r"^(Th?n?\d+_)?[NKV]*", "", mangled[2:]), ""
    while (size := re.match(r"\d+", rest)) is not None:
        last = rest[size.end() : size.end() + int(size[0])]
        rest = rest[size.end() + int(size[0]) :]
    return last


@cache
def _names_near(name: str, line: int) -> frozenset[str]:
    files = list(SOURCES.rglob(name))
    if len(files) != 1:
        return frozenset()
    lines = files[0].read_text().splitlines()
    near = "\n".join(lines[max(0, line - 1 - _LINES_AROUND) : line + _LINES_AROUND])
    return frozenset(first or second for first, second in _METHOD.findall(near))
