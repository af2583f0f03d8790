# SPDX-License-Identifier: MIT
"""Benchmark: the tick beside the original robot's control law in double precision."""

from __future__ import annotations

from pathlib import Path

from bench import build, ticks
from bench.options import Options
from bench.tables import Cell, Row, Table, with_ratios
from tests.parity.budgets import read_recorded

DOUBLE = "the original law in double precision, once in 20 ms"
FLOAT = "the core's copy of it in float, called in every tick"
TICKS = "our 20 ticks of 1 ms: filters, safety, ISMC and wheel-speed loops"
X86, M7, RATIO, SHARE = "x86 instructions", "Cortex-M7 instructions", "× the law", "of the Cortex-M7 at 600 MHz"
PERIODS, M7_PERIODS = 1000, 100
TICKS_PER_PERIOD = 20
INSTRUCTIONS_PER_PERIOD = 600e6 * 0.02


def sources() -> list[Path]:
    """Return the program's sources."""
    return [build.PROGRAMS / "law.cpp", build.PROGRAMS / "core_law.c", build.PEERS / "original_law_double.c"]


def measure(options: Options) -> list[Table]:
    """Return the table."""
    options.say("the original law")
    names = {DOUBLE: "double_law", FLOAT: "core_law"}
    x86: dict[str, float] = {}
    m7: dict[str, float] = {TICKS: float(TICKS_PER_PERIOD * read_recorded()["every_filter.core_mean"])}
    if build.has_valgrind():
        built = build.build("law", sources())
        for label, name in names.items():
            x86[label] = build.count(built, [name, str(PERIODS)], name).total / PERIODS
        x86[TICKS] = TICKS_PER_PERIOD * ticks.instructions("in_process", options.seed)["the core"]
    if build.has_cortex_m7():
        built = build.build_cortex_m7("law", sources())
        for label, name in names.items():
            m7[label] = build.numbers(build.run_cortex_m7(built, [name, str(M7_PERIODS)]))["cost"][0]
    rows = [Row(label, _cells(label, x86, m7)) for label in (DOUBLE, FLOAT, TICKS)]
    if DOUBLE in m7:
        rows = list(with_ratios(rows, M7, DOUBLE, RATIO))
    note = "Per 20 ms of the robot's time. Last row: first case of “Instructions per tick”, core; x86: the demo."
    return [Table("law", "control per 20 ms", (X86, M7, RATIO, SHARE), tuple(rows), note)]


def _cells(label: str, x86: dict[str, float], m7: dict[str, float]) -> dict[str, Cell]:
    cells: dict[str, Cell] = {X86: x86.get(label), M7: m7.get(label)}
    if label in m7:
        cells[SHARE] = f"{100.0 * m7[label] / INSTRUCTIONS_PER_PERIOD:.2f} %"
    return cells
