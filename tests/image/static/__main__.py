# SPDX-License-Identifier: MIT
"""The stack and the heap of a whole image: what the code can use at most, beside what a run used.

usage: python -m tests.image.static [--robot three_wheel] [--write]

Exit code 1: the bound is above the stack's budget, a run used more than the bound, or the image can use a heap.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from emulated_teensy.image_file import read_image
from tests.image.flashed import ROOT
from tests.image.static.calls import Calls
from tests.image.static.code import Program
from tests.image.static.running import interrupts, running, used_stack, work
from tests.image.static.whole import Whole, heap_functions, whole_stack
from tests.parity.budget_page import is_current, replace_block

PAGE = ROOT / "docs" / "concepts" / "teensy.md"
BLOCK = "stack"
PAGE_ROBOT = "three_wheel"
STACK_BUDGET = 8192
SHOWN = 4


def short(names: Sequence[str]) -> list[str]:
    """Return symbols as people write them in C++, without parameters."""
    command = ["arm-none-eabi-c++filt", "--no-params", *names]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split("\n")
    return [name.replace("(anonymous namespace)::", "").removeprefix("omni::") for name in said[: len(names)]]


def block(whole: Whole, used: int, left: int) -> list[str]:
    """Return the lines between the page's markers."""
    rows = [("the main program", whole.main, whole.main.bytes)]
    rows += [(f"an interrupt of priority {level.priority}", level.deepest, level.bytes) for level in whole.levels]
    lines = ["| who | bytes at most | the way to the deepest place |", "|---|---:|---|"]
    for who, deepest, count in rows:
        names = [f"`{name}`" for name in short(deepest.way[-SHOWN:])]
        lines.append(f"| {who} | {count} | {' > '.join(names)} |")
    lines.append(f"| **all on top of each other** | **{whole.bytes}** | budget {STACK_BUDGET}; there are {left} |")
    lines.append(f"| used in a run with telemetry, saves and drives | {used} | painted memory, on the emulated chip |")
    return lines


def objections(whole: Whole, used: int, heap: Sequence[str]) -> list[str]:
    """Return a sentence for everything that must not be."""
    found = []
    if whole.bytes > STACK_BUDGET:
        found.append(f"the stack can take {whole.bytes} bytes, the budget is {STACK_BUDGET}")
    if used > whole.bytes:
        found.append(f"a run used {used} bytes of stack, more than the bound of {whole.bytes}: the bound is wrong")
    if heap:
        found.append(f"the image can take memory from a heap: {', '.join(heap)}")
    return found


def main() -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--robot", default="three_wheel", help="of platformio.ini [%(default)s]")
    parser.add_argument("--image", type=Path, help="ELF file instead of what make firmware built")
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    options = parser.parse_args()
    elf_file = options.image or ROOT / ".pio" / "build" / options.robot / "firmware.elf"
    calls = Calls(Program(elf_file), read_image(elf_file))
    with running(elf_file, options.robot) as bench:
        work(bench)
        enabled = interrupts(bench.machine)
        used = used_stack(bench.machine)
        left = bench.machine.address_of("_estack") - bench.machine.address_of("_ebss")
    whole = whole_stack(calls, enabled)
    lines = block(whole, used, left)
    sys.stdout.write("\n".join([*lines, ""]))
    problems = objections(whole, used, heap_functions(calls))
    if options.write and not problems:
        PAGE.write_text(replace_block(PAGE.read_text(), BLOCK, lines))
    elif options.robot == PAGE_ROBOT and not is_current(PAGE.read_text(), BLOCK, lines):
        problems.append(f"{PAGE.name} does not say this: make firmware-memory ARGS=--write, and look at the difference")
    for problem in problems:
        sys.stderr.write(f"error: {problem}\n")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
