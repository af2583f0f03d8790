# SPDX-License-Identifier: MIT
"""The parity gate: the control tick gives the same bits on every compiler and processor.

usage: python tests/parity/compare.py [--ticks N] [--seed S] [--all] [--flashed]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rich.console import Console

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.needs import NEEDS, missing, remedies
from tests.parity.builds import EXTRA, GATE, BuildError, generate, usable

GATE_TICKS = 1_000_000
REPORT_TICKS = 10_000


class Core(Protocol):
    """A core with the parity program around it."""

    @property
    def name(self) -> str: ...

    def prepare(self) -> None:
        """Build it. Raises BuildError."""

    def parity(self, arguments: list[str]) -> tuple[int, str]:
        """Run the parity program and return its exit code and output."""


@dataclass(frozen=True)
class Result:
    """What a build of the parity program said."""

    core: Core
    code: int
    lines: list[str]
    seconds: float

    @property
    def hashes(self) -> list[str]:
        return [line for line in self.lines if line.startswith("hash ")]


def run_one(core: Core, ticks: int, seed: int, least: int) -> Result:
    """Run the parity program of one build."""
    begin = time.monotonic()
    arguments = ["--ticks", str(ticks), "--seed", str(seed), "--least", str(least)]
    code, output = core.parity(arguments)
    return Result(core, code, output.splitlines(), time.monotonic() - begin)


def first_difference(a: Result, b: Result) -> int | None:
    """Return the tick before which two runs first differ, or None."""
    if a.lines == b.lines:
        return None
    for one, other in zip(a.hashes, b.hashes, strict=False):
        if one != other:
            return int(one.split()[1])
    return min(len(a.hashes), len(b.hashes)) * REPORT_TICKS


def locate(a: Core, b: Core, before: int, seed: int) -> str:
    """Name the first tick and output that differ in the REPORT_TICKS before ``before``."""
    begin = max(before - REPORT_TICKS, 0)
    arguments = ["--ticks", str(before), "--seed", str(seed), "--dump", str(begin), str(before)]
    (_, one), (_, other) = a.parity(arguments), b.parity(arguments)
    for left, right in zip(one.splitlines(), other.splitlines(), strict=False):
        if left != right:
            return f"tick and output: {left} ({a.name}), {right} ({b.name})"
    return f"no output differs: configuration or planning do, between ticks {begin} and {before}"


def compare(cores: Sequence[Core], ticks: int, seed: int, least: int, console: Console) -> bool:
    """Build, run and compare. Return True if all agree and every part of the tick was reached."""
    generate()
    for core in cores:
        core.prepare()
    with ThreadPoolExecutor(max_workers=2) as pool:
        results = list(pool.map(lambda core: run_one(core, ticks, seed, least), cores))
    reference = results[0]
    good = True
    for result in results:
        last = result.hashes[-1] if result.hashes else "no hash"
        console.print(f"{result.core.name:>14}: {last}, {result.seconds:.0f} s", highlight=False)
        difference = first_difference(reference, result)
        if difference is not None:
            good = False
            where = locate(reference.core, result.core, difference, seed)
            console.print(f"  differs from {reference.core.name}: {where}", style="red", markup=False)
        if result.code != 0:
            good = False
            wrong = [line for line in result.lines if "NOT REACHED" in line or line.endswith("is not finite")]
            said = wrong or result.lines[-3:]
            console.print(f"  exit code {result.code}", *said, sep="\n  ", style="red", markup=False)
    return good


def flashed() -> tuple[list[Core], list[str]]:
    """Return the cores of the flashed image and of a newer gcc, and what is missing for each that cannot be run."""
    from tests.image import flashed

    if lacking := remedies("arm"):
        return [], [lacking]
    from tests.image.parity_cores import FlashedCore, NewerCore

    kinds: dict[str, Callable[[], Core]] = {
        "image": lambda: FlashedCore(flashed.image_path()),
        "newer-gcc": lambda: NewerCore(flashed.newer_gcc()),
    }
    absent = missing(*kinds)
    return [make() for kind, make in kinds.items() if kind not in absent], [NEEDS[kind].remedy for kind in absent]


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="compare the bits of the control tick between builds")
    parser.add_argument("--ticks", type=int, default=GATE_TICKS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--all", action="store_true", help="also with other optimisation levels")
    parser.add_argument(
        "--flashed", action="store_true", help="also inside the image of `make firmware`, and with a newer gcc's core"
    )
    parser.add_argument("--least", type=int, default=20, help="ticks that every state, mode and fault has to be in")
    options = parser.parse_args()
    console = Console(soft_wrap=True)
    try:
        builds, missing = usable(GATE + EXTRA if options.all else GATE)
        cores: list[Core] = list(builds)
        if options.flashed:
            found, sentences = flashed()
            cores += found
            missing += [f"{sentence} is not there" for sentence in sentences]
        for sentence in missing:
            console.print(f"left out: {sentence}", style="yellow", markup=False)
        if len(cores) < 2:
            console.print("nothing to compare: install another compiler (Debian: gcc, clang, gcc-arm-none-eabi)")
            return 1
        good = compare(cores, options.ticks, options.seed, options.least, console)
    except BuildError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    console.print("the same bits everywhere" if good else "parity is broken")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
