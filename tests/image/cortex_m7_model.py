# SPDX-License-Identifier: MIT
"""Cycles of machine code by LLVM's scheduling model of the Cortex-M7, through llvm-mca.

The model (LLVM's ARMScheduleM7.td) knows which units an instruction takes, when its result is there, and that two
instructions may begin in a cycle, in their order. Some of what is executed llvm-mca cannot take as it is:

- An IT instruction is left out. What depends on it counts as executed without a condition.
- A load or store of several registers, which the model takes for one of a single word, is written word by word, or two
  by two.
- A call is a branch. A comparison with zero, or one that minds quiet NaNs, is the ordinary one of two registers.

In the model results come in the order of the instructions, so that a division holds up what follows; but it takes its
unit for one cycle only. Not in the model: the branch predictor, waiting for memory.
"""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

MCA = "llvm-mca"
OBJDUMP = "llvm-objdump"
MISPREDICTED = 6
"""Cycles that a wrongly predicted branch costs at most, by the model's comment on its MispredictPenalty."""

_TARGET = ("-mtriple=thumbv7em-none-eabihf", "-mcpu=cortex-m7")
_LINE = re.compile(r"^\s*([0-9a-f]+):\s+(\S.*)$")
_CONDITIONS = {
    "eq": "ne",
    "hs": "lo",
    "mi": "pl",
    "vs": "vc",
    "hi": "ls",
    "ge": "lt",
    "gt": "le",
}
_OTHER = {**_CONDITIONS, **{value: key for key, value in _CONDITIONS.items()}}
_BRANCH = re.compile(r"^(b|bl|bx|blx|cbn?z|tb[bh])([a-z]{2})?(\.w)?\s")
_MULTIPLE = re.compile(r"^(push|pop|ldm|stm|vpush|vpop|vldm|vstm)\S*\s+(?:(\w+)!?, )?\{(.*)\}$")


class ModelError(Exception):
    """A tool failed, or does not know an instruction; the message holds its words."""


@dataclass(frozen=True)
class Instruction:
    """One instruction as disassembled, and the condition that an IT instruction puts on it ("" for none)."""

    text: str
    condition: str = ""

    @property
    def is_branch(self) -> bool:
        """Whether it can go elsewhere."""
        return bool(_BRANCH.match(self.text)) or bool(re.match(r"^(pop|ldm).*\bpc\b", self.text))


@dataclass(frozen=True)
class Cost:
    """Cycles of a piece of code.

    ``units``: as if no instruction waited for another's result. ``serial``: each waits for the result of the one
    before, and every branch was foreseen wrongly.
    """

    units: float
    serial: int


def version() -> str:
    """Return LLVM's version, such as "14.0.6"."""
    found = re.search(r"version (\S+)", _run([MCA, "--version"]))
    return found[1] if found else "unknown"


def disassemble(program: Path, section: str = ".text.itcm") -> dict[int, tuple[Instruction, int]]:
    """Return every instruction of a section and its size in bytes, by address."""
    words = [
        "-d",
        "--no-show-raw-insn",
        "--no-leading-headers",
        "--mcpu=cortex-m7",
        f"--section={section}",
        str(program),
    ]
    found = [(int(m[1], 16), _plain(m[2])) for m in map(_LINE.match, _run([OBJDUMP, *words]).splitlines()) if m]
    result: dict[int, tuple[Instruction, int]] = {}
    conditions: list[str] = []
    for (address, text), (following, _) in zip(found, [*found[1:], (found[-1][0] + 4, "")], strict=True):
        condition = conditions.pop(0) if conditions else ""
        if re.match(r"^it[te]*\s", text):
            conditions = _it_conditions(text)
        result[address] = (Instruction(text, condition), following - address)
    return result


def _plain(text: str) -> str:
    """Without comments and symbols; a branch goes to its distance, as the assembler wants it."""
    text, _, comment = text.partition("@")
    text = re.sub(r"\s*<.*?>", "", text).strip().replace("\t", " ")
    distance = re.search(r"imm = (#-?\d+)", comment)
    return re.sub(r"0x[0-9a-f]+$", distance[1], text) if distance else text


def _it_conditions(text: str) -> list[str]:
    mnemonic, condition = text.split()
    return [condition, *(condition if letter == "t" else _OTHER[condition] for letter in mnemonic[2:])]


def costs(pieces: Sequence[Sequence[Instruction]]) -> list[Cost]:
    """Return what each piece of code costs between the model's bounds."""
    paired = _regions([_written(piece, 8) for piece in pieces], "-instruction-info=false")
    single = _regions([_written(piece, 4) for piece in pieces], "-instruction-info=true")
    result = []
    for piece, narrow, wide in zip(pieces, paired, single, strict=True):
        units = float(narrow["SummaryView"]["BlockRThroughput"])
        latencies = [max(1, entry["Latency"]) for entry in wide["InstructionInfoView"]["InstructionList"]]
        its = sum(1 for instruction in piece if instruction.text.startswith("it"))
        branches = sum(1 for instruction in piece if instruction.is_branch)
        result.append(Cost(units, sum(latencies) + its + MISPREDICTED * branches))
    return result


def in_order(code: Sequence[Instruction]) -> int:
    """Return the cycles of code executed in this order from the first to the last, every branch foreseen."""
    regions = _regions([_written(code, 4)], "-instruction-info=false")
    return int(regions[0]["SummaryView"]["TotalCycles"])


def _regions(pieces: Sequence[Sequence[str]], *words: str) -> list[dict[str, Any]]:
    lines = []
    for number, piece in enumerate(pieces):
        lines += [f"# LLVM-MCA-BEGIN {number}", *piece, "# LLVM-MCA-END"]
    command = [MCA, *_TARGET, "-json", "-iterations=1", "-resource-pressure=false", *words]
    answer = json.loads(_run(command, "\n".join(lines) + "\n"))
    regions: list[dict[str, Any]] = answer["CodeRegions"]
    return regions


def _written(code: Sequence[Instruction], width: int) -> list[str]:
    """Return the code in llvm-mca's words; several registers are moved ``width`` bytes at a time."""
    lines: list[str] = []
    for instruction in code:
        if not instruction.text.startswith("it"):
            lines += _in_its_words(instruction, width)
    return lines


def _in_its_words(instruction: Instruction, width: int) -> list[str]:
    text = instruction.text
    mnemonic, _, operands = text.partition(" ")
    if instruction.condition:
        stem, dot, kind = mnemonic.partition(".")
        mnemonic = stem.removesuffix(instruction.condition) + dot + kind
        text = f"{mnemonic} {operands}".strip()
    if mnemonic in ("bl", "blx"):
        return ["b #16"]
    if mnemonic.startswith("vcmp"):
        first, second = operands.split(", ")
        return [f"vcmp.f32 {first}, {first if second == '#0' else second}"]
    multiple = _MULTIPLE.match(text)
    return _moves(multiple[1], multiple[2] or "sp", multiple[3], width) if multiple else [text]


def _moves(kind: str, base: str, names: str, width: int) -> list[str]:
    """Return the loads or stores that one of several registers stands for."""
    loads = kind in ("pop", "ldm", "vpop", "vldm")
    registers = _each(names, width)
    if kind.startswith("v"):
        step, name = (8 if registers[0].startswith("d") else 4), "vldr" if loads else "vstr"
        return [f"{name} {register}, [{base}, #{step * i}]" for i, register in enumerate(registers)]
    name = "ldr" if loads else "str"
    rest = sorted(
        registers, key=lambda register: register in (base, "pc")
    )  # what is needed to load the others goes last
    lines: list[str] = []
    while rest:
        pair = rest[:2] if width == 8 else rest[:1]
        pair = pair if "pc" not in pair else pair[:1]
        lines.append(f"{name + 'd' * (len(pair) - 1)} {', '.join(pair)}, [{base}, #{4 * len(lines)}]")
        rest = rest[len(pair) :]
    return lines


def _each(names: str, width: int) -> list[str]:
    """Return the registers of a list; floats as doubles (8 bytes) where the list has both halves, or as halves (4)."""
    listed = [name.strip() for name in names.split(",")]
    if listed[0][0] not in "sd":
        return listed
    halves = [
        number
        for name in listed
        for number in ([int(name[1:])] if name[0] == "s" else [2 * int(name[1:]), 2 * int(name[1:]) + 1])
    ]
    if width == 4 or halves[0] % 2 or len(halves) % 2:
        return [f"s{number}" for number in halves]
    return [f"d{number // 2}" for number in halves[::2]]


def _run(command: Sequence[str], text: str = "") -> str:
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    if done.returncode != 0 or "error:" in done.stderr:
        raise ModelError(f"{' '.join(command)}\n{done.stderr[:2000]}")
    return done.stdout
