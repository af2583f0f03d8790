# SPDX-License-Identifier: MIT
"""``omni bench``: how fast the loops are on this computer."""

from __future__ import annotations

import os
import platform
from dataclasses import replace
from typing import Annotated, Any

import typer
from rich.table import Table

from hil_sim.hil import run_hil
from hil_sim.runs import Run, run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omniwheel.cli.common import JsonOption, console, examples, print_json
from omniwheel.cli.run_output import run_progress

EXAMPLES = examples("omni bench", "omni bench --seconds 60 --json")
WANTED = {"hil": 5.0, "in_process": 300.0}
NAMES = {"hil": "firmware process in the loop, lockstep over TCP", "in_process": "in process: world and control core"}


def bench(
    seconds: Annotated[float, typer.Option("--seconds", min=1.0, max=600.0, help="Simulated time of each run.")] = 20.0,
    repeat: Annotated[int, typer.Option("--repeat", min=1, max=20, help="Runs of each kind; the fastest counts.")] = 3,
    json_wanted: JsonOption = False,
) -> None:
    """Measure how much faster than real time the simulations are, with the demo's scenario."""
    scenario = replace(load_scenario("demo"), duration_s=seconds)
    results = {
        "hil": _best("hil", scenario, repeat, json_wanted),
        "in_process": _best("in_process", scenario, repeat, json_wanted),
    }
    machine = f"{platform.machine()}, {os.cpu_count()} processors"
    if json_wanted:
        print_json({"machine": machine, "simulated_s": seconds, "results": results})
    else:
        console.print(_table(results, f"{machine}; {seconds:g} s simulated, best of {repeat}"))


def _best(kind: str, scenario: Scenario, repeat: int, quiet: bool) -> dict[str, Any]:
    runs = []
    for number in range(repeat):
        with run_progress(f"{NAMES[kind]} ({number + 1}/{repeat})", quiet) as progress:
            runs.append(
                run_hil(scenario, progress=progress) if kind == "hil" else run_in_process(scenario, progress=progress)
            )
    return _figures(kind, max(runs, key=lambda run: run.realtime_factor))


def _figures(kind: str, run: Run) -> dict[str, Any]:
    return {
        "realtime_factor": run.realtime_factor,
        "wanted_factor": WANTED[kind],
        "tick_ns": run.wall_s / run.ticks * 1e9,
        "firmware_tick_us": run.tick_us,
    }


def _table(results: dict[str, dict[str, Any]], title: str) -> Table:
    table = Table(title=title, title_style="bold", title_justify="left")
    for heading in ("", "× real time", "wanted", "µs per tick", "firmware's own tick, µs"):
        table.add_column(heading, justify="right" if heading else "left")
    for kind, entry in results.items():
        tick = entry["firmware_tick_us"]
        own = f"{tick['mean']:.1f} mean, {tick['max']:.1f} max" if tick else ""
        numbers = (
            f"{entry['realtime_factor']:.1f}",
            f"≥ {entry['wanted_factor']:g}",
            f"{entry['tick_ns'] * 1e-3:.2f}",
            own,
        )
        table.add_row(NAMES[kind], *numbers)
    return table
