# SPDX-License-Identifier: MIT
"""Benchmark: the simulations, in times real time and in instructions per tick."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

from bench import build, ticks
from bench.options import Options
from bench.tables import Cell, Row, Table, with_ratios
from hil_sim.loop_speed import SCENARIO, Loop, LoopTime, loops
from hil_sim.speed import alternate

FACTOR, MEDIAN, WANTED, TICK = "× real time", "median", "wanted", "µs per tick"
CPU = "× real time per CPU second"
ALL = "x86 instructions per tick"
RATIO = "× in process"
REAL, IDEAL, COST = "real wheels", "ideal wheels", "times as long"
TICK_S = 1e-3


def measure(options: Options) -> list[Table]:
    """Return the tables of speed and of instructions."""
    seconds = float(options.pick(2, 20))
    found = loops(seconds, options.seed, compared=True)
    note = (
        f"Scenario `{SCENARIO}`, on real wheels, 1 kHz, {seconds:g} s simulated, seed {options.seed}; "
        f"best and median of {options.rounds}, measured in turn."
    )
    tables = [Table("loops", "simulation", (FACTOR, MEDIAN, WANTED, TICK, CPU), _loop_rows(found, options), note)]
    tables.append(_wheels(seconds, options))
    if build.has_valgrind():
        tables.append(_instructions(options))
    return tables


def _wheels(seconds: float, options: Options) -> Table:
    """Return what real wheels cost, by the processor's time, which a busy machine hardly changes."""
    kinds = {REAL: SCENARIO, IDEAL: ticks.IDEAL}
    found = {kind: loops(seconds, options.seed, name=name) for kind, name in kinds.items()}
    ways = [(key, kind) for key in ("in_process", "monte_carlo") for kind in kinds]

    def cost_of(key: str, kind: str) -> Callable[[], float]:
        def cost() -> float:
            options.say(f"{found[kind][key].words}, {kind}")
            taken = found[kind][key].run()
            return taken.cpu_s / taken.simulated_s

        return cost

    spreads = alternate({f"{key} {kind}": cost_of(key, kind) for key, kind in ways}, 3 * options.rounds)
    rows = []
    for key in ("in_process", "monte_carlo"):
        real, ideal = (spreads[f"{key} {kind}"] for kind in (REAL, IDEAL))
        cells = {REAL: 1.0 / real.least, IDEAL: 1.0 / ideal.least, COST: real.least / ideal.least}
        rows.append(Row(found[REAL][key].words, {**cells, f"{COST}, medians": real.median / ideal.median}))
    note = (
        f"× real time per CPU second; scenarios `{SCENARIO}` and `{ticks.IDEAL}`, {seconds:g} s simulated, seed "
        f"{options.seed}; best of {3 * options.rounds}, measured in turn."
    )
    return Table("wheels", "real and ideal wheels", (REAL, IDEAL, COST, f"{COST}, medians"), tuple(rows), note)


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
