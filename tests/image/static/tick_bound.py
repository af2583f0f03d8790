# SPDX-License-Identifier: MIT
"""The most instructions that a control tick can take, from the linked machine code, beside what was measured.

usage: python -m tests.image.static.tick_bound [--write]

Exit code 1: more was measured than the bound allows, or docs/checks/performance.md says something else.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from emulated_teensy.image_file import read_image
from omniwheel.robots import read_robot
from tests.image.flashed import ROOT
from tests.image.static.calls import Calls
from tests.image.static.code import Program
from tests.image.static.longest import Longest
from tests.image.static.loop_bounds import LoopBounds
from tests.parity.budget_page import CASES, CLOCK_MHZ, TICK_US, is_current, replace_block
from tests.parity.budgets import PAGE, read_recorded

BLOCK = "tick-bound"
CYCLES_PER_TICK = CLOCK_MHZ * TICK_US
ROBOT = "three_wheel"
PARTS = {
    "`ControlLoop::tick`": "_ZN4omni11ControlLoop4tick.*",
    "`omni_robot_tick`": "omni_robot_tick",
    "a pose fix: `omni_pose_ekf_correct`": "omni_pose_ekf_correct",
    "the wheels' motion up to a fix: `omni_ekf_history_window`": "omni_ekf_history_window",
    "a controller: `omni_robot_control`": "omni_robot_control",
}


def bounds(elf_file: Path, wheels: int) -> dict[str, int]:
    """Return the most instructions of each part. Raises CodeError."""
    image = read_image(elf_file)
    calls = Calls(Program(elf_file), image)
    longest = Longest(calls, LoopBounds(image, wheels, gyro=True))
    return {part: longest.below(calls.matching(symbol)) for part, symbol in PARTS.items()}


def block(found: dict[str, int], measured: int) -> list[str]:
    """Return the lines between the page's markers."""
    lines = ["| part | instructions at most |", "|---|---:|"]
    lines += [f"| {part} | {count} |" for part, count in found.items()]
    return [*lines, f"| the largest tick of three wheels that was measured | {measured} |"]


def largest_measured() -> int:
    """Return the instructions of the largest tick of three wheels in the budgets' record."""
    recorded = read_recorded()
    return max(recorded[f"{case}.tick_max"] for case in CASES if not case.startswith("four_wheels"))


def main() -> int:
    """Run the command line and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--write", action="store_true", help=f"put the table into {PAGE.name}")
    options = parser.parse_args()
    found = bounds(ROOT / ".pio" / "build" / ROBOT / "firmware.elf", read_robot(ROBOT).wheels)
    measured = largest_measured()
    lines = block(found, measured)
    sys.stdout.write("\n".join([*lines, ""]))
    problems = []
    if measured > next(iter(found.values())):
        problems.append(f"a tick took {measured} instructions, more than the bound: the bound is wrong")
    if next(iter(found.values())) > CYCLES_PER_TICK:
        problems.append(f"at an instruction per cycle a tick may not end in its {CYCLES_PER_TICK} cycles")
    if options.write:
        PAGE.write_text(replace_block(PAGE.read_text(), BLOCK, lines))
    elif not is_current(PAGE.read_text(), BLOCK, lines):
        problems.append(f"{PAGE.name} does not say this: run this with --write, and look at the difference")
    for problem in problems:
        sys.stderr.write(f"error: {problem}\n")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
