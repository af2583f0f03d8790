# SPDX-License-Identifier: MIT
"""``make bench-gates``: what must not get slower, by instruction counts and ratios; never by wall times.

- Instructions per simulated tick on x86 (callgrind) may not exceed what bench/gates.toml records by more than 10 %.
  Compilers differ by a few percent; what is worth a gate (a copied struct, a second sine) is more.
- Ratios: each is the least of several rounds measured in turn. The limit lies far below what is usual (see
  ``RATIOS``). So a busy machine does not fail it, and a lost vectorisation or a slow path does.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from bench import filter_study, ticks
from bench.build import BenchError, has_valgrind
from hil_sim.speed import Spread, alternate
from omni_reproduce.experiment import read_spec
from omni_reproduce.filters import read_setting, shortened
from omniwheel import files

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

RECORDED = Path(__file__).with_name("gates.toml")
SLACK = 1.10
ROUNDS = 5
SEED = 1
STEPS = 300
OURS_S = 60.0
"""Of each of our runs."""


@dataclass(frozen=True)
class Ratio:
    """``slow`` takes at least ``limit`` times as long as ``fast``; ``usual`` is what it takes on a quiet machine."""

    slow: str
    fast: str
    usual: float
    limit: float


RATIOS = (
    Ratio(filter_study.FILTERPY, filter_study.SCALAR, usual=300.0, limit=100.0),
    Ratio(filter_study.BATCHED, filter_study.SCALAR, usual=5.0, limit=1.5),
    Ratio(filter_study.SCALAR, filter_study.LANES, usual=9.0, limit=1.5),
    Ratio(filter_study.PLAIN, filter_study.LANES, usual=5.4, limit=1.2),
    # Ours may take sixteen times as long as the program for vectors; it usually takes three times as long.
    Ratio(filter_study.SIMD, filter_study.LANES, usual=0.33, limit=0.06),
)


def too_many(measured: Mapping[str, int], recorded: Mapping[str, int]) -> list[str]:
    """Return a sentence for every count that has grown beyond its record plus slack, or has no record."""
    sentences = [
        f"{name}: {value} instructions per tick, recorded {recorded[name]}, more than 10 % above"
        for name, value in measured.items()
        if name in recorded and value > recorded[name] * SLACK
    ]
    if missing := sorted(set(measured) ^ set(recorded)):
        sentences.append(f"not the counts that were recorded: {', '.join(missing)} (make bench-gates ARGS=--write)")
    return sentences


def too_slow(spreads: Mapping[str, Spread]) -> list[str]:
    """Return a sentence for every ratio below its limit; those of what is not there are left out."""
    return [
        f"{ratio.slow} / {ratio.fast} is {found:.3g}, the limit is {ratio.limit:g} (usually about {ratio.usual:g})"
        for ratio in RATIOS
        if (found := quotient(ratio, spreads)) is not None and found < ratio.limit
    ]


def quotient(ratio: Ratio, spreads: Mapping[str, Spread]) -> float | None:
    """Return the measured ratio, None if one of the two was not measured."""
    if ratio.slow not in spreads or ratio.fast not in spreads:
        return None
    return spreads[ratio.slow].least / spreads[ratio.fast].least


def count() -> dict[str, int]:
    """Return instructions per tick of each way to run."""
    return {way: round(ticks.instructions(way, SEED)["all"]) for way in ticks.ways()}


def study_times() -> dict[str, Spread]:
    """Return seconds per step of what the ratios are about."""
    setting = shortened(read_setting(read_spec("table7"), filter_study.SETTING), OURS_S)
    found = filter_study.measurements(setting, STEPS, runs=200, seed=SEED)
    wanted = {name for ratio in RATIOS for name in (ratio.slow, ratio.fast)}
    return alternate({name: run for name, run in found.items() if name in wanted}, ROUNDS)


def read_recorded() -> dict[str, int]:
    """Return the recorded instructions per tick of the ways that can be counted here."""
    with RECORDED.open("rb") as file:
        recorded = tomllib.load(file)["instructions"]
    return {way: recorded[way] for way in ticks.ways() if way in recorded}


def write_recorded(counts: Mapping[str, int]) -> None:
    """Replace the recorded instructions."""
    head = RECORDED.read_text().split("[instructions]", 1)[0]
    lines = [f"{name} = {value}" for name, value in counts.items()]
    files.write_text(RECORDED, "\n".join([f"{head}[instructions]", *lines]) + "\n")


def _report(counts: Mapping[str, int], recorded: Mapping[str, int], spreads: Mapping[str, Spread]) -> Table:
    table = Table(title="gates")
    for heading in ("", "measured", "recorded or limit"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, value in counts.items():
        table.add_row(f"{ticks.WAYS[name]}: instructions per tick", str(value), str(recorded.get(name, "")))
    for ratio in RATIOS:
        if (found := quotient(ratio, spreads)) is not None:
            table.add_row(f"{ratio.slow} / {ratio.fast}", f"{found:.3g}", f"≥ {ratio.limit:g}")
    return table


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="make bench-gates ARGS=...", description="what must not get slower")
    parser.add_argument("--write", action="store_true", help="record the instruction counts anew")
    words = parser.parse_args()
    console = Console(soft_wrap=True)
    try:
        counts = _counts(console)
        spreads = study_times()
    except BenchError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    if words.write and counts:
        write_recorded(counts)
    recorded = read_recorded()
    console.print(_report(counts, recorded, spreads))
    sentences = [*(too_many(counts, recorded) if counts else []), *too_slow(spreads)]
    for sentence in sentences:
        console.print(sentence, style="red", markup=False)
    return 1 if sentences else 0


def _counts(console: Console) -> dict[str, int]:
    """Count, or say that it cannot be done here; on CI it must be."""
    if has_valgrind():
        return count()
    if os.environ.get("CI") == "true":
        raise BenchError("valgrind is not installed")
    console.print("left out: instructions, valgrind is not installed", style="yellow")
    return {}


if __name__ == "__main__":
    sys.exit(main())
