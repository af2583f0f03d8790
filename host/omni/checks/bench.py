# SPDX-License-Identifier: MIT
"""``python -m omni.checks bench``: how fast the loops are on this computer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from omni.cli.common import JsonOption, console, error_console, examples, print_json
from omni.cli.options import simulated_time_option

if TYPE_CHECKING:
    from hil_sim.loop_speed import Loop, LoopTime

EXAMPLES = examples("python -m omni.checks bench", "python -m omni.checks bench --seconds 60 --json")
TICK_S = 1e-3


def bench(
    seconds: Annotated[float, simulated_time_option(1.0, 600.0)] = 20.0,
    repeat: Annotated[
        int, typer.Option("--repeat", min=1, max=20, help="Repetitions of each measurement; the fastest is reported.")
    ] = 3,
    json_wanted: JsonOption = False,
) -> None:
    """Measure how much faster than real time the simulations are, with the demo's scenario."""
    from hil_sim.loop_speed import loops
    from hil_sim.speed import machine

    found = loops(seconds)
    fastest: dict[str, LoopTime] = {}
    with error_console.status("") as status:
        for number in range(repeat):
            for name, loop in found.items():
                status.update(f"{loop.words} ({number + 1}/{repeat})")
                taken = loop.run()
                if name not in fastest or taken.realtime_factor > fastest[name].realtime_factor:
                    fastest[name] = taken
    results = {name: _figures(found[name], taken) for name, taken in fastest.items()}
    if json_wanted:
        print_json({"machine": machine(), "simulated_s": seconds, "results": results})
    else:
        console.print(_table(found, results, f"{machine()}; {seconds:g} s simulated, best of {repeat}"))


def _figures(loop: Loop, taken: LoopTime) -> dict[str, Any]:
    return {
        "realtime_factor": taken.realtime_factor,
        "wanted_factor": loop.wanted,
        "tick_ns": TICK_S / taken.realtime_factor * 1e9,
        "firmware_tick_us": taken.tick_us,
    }


def _table(found: dict[str, Loop], results: dict[str, dict[str, Any]], title: str) -> Table:
    table = Table(title=title, title_style="bold", title_justify="left")
    for heading in ("", "× real time", "wanted", "µs per tick", "firmware's own tick, µs"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, entry in results.items():
        tick = entry["firmware_tick_us"]
        own = f"{tick['mean']:.1f} mean, {tick['max']:.1f} max" if tick else ""
        numbers = (
            f"{entry['realtime_factor']:.1f}",
            f"≥ {entry['wanted_factor']:g}" if entry["wanted_factor"] else "",
            f"{entry['tick_ns'] * 1e-3:.2f}",
            own,
        )
        table.add_row(found[name].words, *numbers)
    return table
