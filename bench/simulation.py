# SPDX-License-Identifier: MIT
"""Benchmark: the simulations, in times real time and in instructions per tick."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from bench import build, ticks
from bench.options import Options
from bench.tables import Cell, Row, Table, with_ratios
from hil_sim.loop_speed import SCENARIO, Loop, LoopTime, loops

FACTOR, MEDIAN, WANTED, TICK = "× real time", "median", "wanted", "µs per tick"
CPU = "× real time per CPU second"
ALL = "x86 instructions per tick"
RATIO = "× in process"
TICK_S = 1e-3


def measure(options: Options) -> list[Table]:
    """Return the tables of speed and of instructions."""
    seconds = float(options.pick(2, 20))
    found = loops(seconds, options.seed, compared=True)
    note = (
        f"Scenario `{SCENARIO}`, 1 kHz, {seconds:g} s simulated, seed {options.seed}; "
        f"best and median of {options.rounds}, measured in turn."
    )
    tables = [Table("loops", "simulation", (FACTOR, MEDIAN, WANTED, TICK, CPU), _loop_rows(found, options), note)]
    if build.has_valgrind():
        tables.append(_instructions(options))
    return tables


def _loop_rows(found: dict[str, Loop], options: Options) -> tuple[Row, ...]:
    taken: dict[str, list[LoopTime]] = {name: [] for name in found}
    for number in range(options.rounds):
        for name, loop in found.items():
            options.say(f"{loop.words} ({number + 1}/{options.rounds})")
            taken[name].append(loop.run())
    rows = [Row(found[name].words, _cells(found[name], times)) for name, times in taken.items()]
    gain = max(_factors(taken["monte_carlo_2"])) / max(_factors(taken["monte_carlo"]))
    rows.append(Row("gain of a second worker", {FACTOR: f"{gain:.2f}", WANTED: "≥ 1.85"}))
    return tuple(rows)


def _cells(loop: Loop, times: Sequence[LoopTime]) -> dict[str, Cell]:
    factors = _factors(times)
    best = max(factors)
    cpu_s = min(time.cpu_s / time.simulated_s for time in times)
    return {
        FACTOR: best,
        MEDIAN: statistics.median(factors),
        WANTED: f"≥ {loop.wanted:g}" if loop.wanted else None,
        TICK: TICK_S * 1e6 / best,
        CPU: 1.0 / cpu_s if cpu_s > 0.0 else None,
    }


def _factors(times: Sequence[LoopTime]) -> list[float]:
    return [time.realtime_factor for time in times]


def _instructions(options: Options) -> Table:
    rows = []
    for way in ticks.ways():
        options.say(f"instructions, {ticks.WAYS[way]}")
        counted = ticks.instructions(way, options.seed)
        rows.append(Row(ticks.WAYS[way], {ALL: counted.pop("all"), **counted}))
    columns = (ALL, *ticks.PARTS.values(), RATIO)
    note = (
        f"By callgrind, over {ticks.COUNTED_TICKS} ticks of the driven path, per tick of one run; seed {options.seed}."
    )
    ratios = with_ratios(rows, ALL, ticks.WAYS["in_process"], RATIO)
    return Table("ticks", "the simulated tick", columns, ratios, note)
