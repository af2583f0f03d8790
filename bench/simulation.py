# SPDX-License-Identifier: MIT
"""Benchmark: the simulations, in times real time and in instructions per tick."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from bench import build, ticks
from bench.options import Options
from bench.tables import Cell, Row, Table, with_ratios
from hil_sim.loop_speed import SCENARIO, Loop, LoopTime, loops

MEDIAN, WANTED, TICK, CPU = "median", "wanted", "µs per tick", "per CPU second"
ALL = "x86 instructions per tick"
RATIO = "× in process"
REAL, IDEAL = "real wheels", "ideal wheels"
TICK_S = 1e-3


def measure(options: Options) -> list[Table]:
    """Return the tables of speed and of instructions."""
    seconds = float(options.pick(2, 20))
    note = (
        f"× real time; scenarios `{SCENARIO}` and `{ticks.IDEAL}`, 1 kHz, {seconds:g} s simulated, "
        f"seed {options.seed}; best and median of {options.rounds}, measured in turn."
    )
    columns = (REAL, MEDIAN, WANTED, TICK, CPU, IDEAL, f"{MEDIAN}, ideal", f"{CPU}, ideal")
    tables = [Table("loops", "simulation", columns, _loop_rows(seconds, options), note)]
    if build.has_valgrind():
        tables.append(_instructions(options))
    return tables


def _loop_rows(seconds: float, options: Options) -> tuple[Row, ...]:
    """Measure every loop on real wheels and, right after, on ideal ones."""
    real, ideal = (loops(seconds, options.seed, compared=True, name=name) for name in (SCENARIO, ticks.IDEAL))
    kinds = {REAL: real, IDEAL: ideal}
    taken: dict[tuple[str, str], list[LoopTime]] = {
        (name, kind): [] for name in real for kind, found in kinds.items() if name in found
    }
    for number in range(options.rounds):
        for (name, kind), times in taken.items():
            options.say(f"{real[name].words}, {kind} ({number + 1}/{options.rounds})")
            times.append(kinds[kind][name].run())
    rows = [Row(real[name].words, _cells(real[name], taken[name, REAL], taken.get((name, IDEAL), []))) for name in real]
    gains = {
        kind: f"{max(_factors(taken['monte_carlo_2', kind])) / max(_factors(taken['monte_carlo', kind])):.2f}"
        for kind in kinds
    }
    rows.append(Row("gain of a second worker", {**gains, WANTED: "≥ 1.85"}))
    return tuple(rows)


def _cells(loop: Loop, real: Sequence[LoopTime], ideal: Sequence[LoopTime]) -> dict[str, Cell]:
    """Return a row: real wheels beside ideal ones, where there are such."""
    cells: dict[str, Cell] = {WANTED: f"≥ {loop.wanted:g}" if loop.wanted else None}
    for times, best, median, cpu in (
        (real, REAL, MEDIAN, CPU),
        (ideal, IDEAL, f"{MEDIAN}, ideal", f"{CPU}, ideal"),
    ):
        if times:
            cells[best], cells[median] = max(_factors(times)), statistics.median(_factors(times))
            cpu_s = min(time.cpu_s / time.simulated_s for time in times)
            cells[cpu] = 1.0 / cpu_s if cpu_s > 0.0 else None
    cells[TICK] = TICK_S * 1e6 / max(_factors(real))
    return cells


def _factors(times: Sequence[LoopTime]) -> list[float]:
    return [time.realtime_factor for time in times]


def _instructions(options: Options) -> Table:
    rows = []
    for way in ticks.ways():
        options.say(f"instructions, {ticks.WAYS[way]}")
        counted = ticks.instructions(way, options.seed)
        rows.append(Row(ticks.WAYS[way], {ALL: counted.pop("all"), **counted}))
    for way in (way for way in ticks.ways() if way != "run"):
        counted = ticks.instructions(way, options.seed, scenario=ticks.IDEAL)
        rows.append(Row(f"{ticks.WAYS[way]}, ideal wheels", {ALL: counted.pop("all"), **counted}))
    columns = (ALL, *ticks.PARTS.values(), RATIO)
    note = (
        f"By callgrind, over {ticks.COUNTED_TICKS} ticks of the driven path, per tick of one run; seed {options.seed}. "
        f"Scenario `{ticks.SCENARIO}` has real wheels, `{ticks.IDEAL}` ideal ones."
    )
    ratios = with_ratios(rows, ALL, ticks.WAYS["in_process"], RATIO)
    return Table("ticks", "the simulated tick", columns, ratios, note)
