# SPDX-License-Identifier: MIT
"""Benchmark: the simulations, in times real time and in instructions per tick."""

from __future__ import annotations

from bench import build, ticks
from bench.options import Options
from bench.tables import Cell, Row, Table, with_ratios
from hil_sim.loop_speed import SCENARIO, Loop, loops
from hil_sim.speed import Measurement

FACTOR, MEDIAN, WANTED, TICK = "× real time", "median", "wanted", "µs per tick"
ALL = "x86 instructions per tick"
RATIO = "× in process"
TICK_S = 1e-3


def measure(options: Options) -> list[Table]:
    """Return the tables of speed and of instructions."""
    seconds = float(options.pick(2, 20))
    found = loops(seconds, options.seed)
    note = (
        f"Scenario `{SCENARIO}`, 1 kHz, {seconds:g} s simulated, seed {options.seed}; "
        f"best and median of {options.rounds}, measured in turn."
    )
    tables = [Table("loops", "simulation", (FACTOR, MEDIAN, WANTED, TICK), _loop_rows(found, options), note)]
    if build.has_valgrind():
        tables.append(_instructions(options))
    return tables


def _loop_rows(found: dict[str, Loop], options: Options) -> tuple[Row, ...]:
    spreads = options.measure({name: _cost(loop) for name, loop in found.items()})
    rows = []
    for name, spread in spreads.items():
        cells: dict[str, Cell] = {
            FACTOR: 1.0 / spread.least,
            MEDIAN: 1.0 / spread.median,
            TICK: spread.least * TICK_S * 1e6,
            WANTED: f"≥ {found[name].wanted:g}" if found[name].wanted else None,
        }
        rows.append(Row(found[name].words, cells))
    gain = spreads["monte_carlo"].least / spreads["monte_carlo_2"].least
    rows.append(Row("second worker: gain", {FACTOR: f"{gain:.2f}", WANTED: "≥ 1.85"}))
    return tuple(rows)


def _cost(loop: Loop) -> Measurement:
    return lambda: 1.0 / loop.run().realtime_factor


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
