# SPDX-License-Identifier: MIT
"""``omni sim``: a scenario without a link, the control core in this process."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli.common import JsonOption, console, error_console, examples, note, print_json
from omni.cli.options import DEFAULT_OUT, ListOption, OutOption
from omni.cli.run_output import (
    DurationOption,
    PlantOption,
    PresetOption,
    RobotOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    print_scenarios,
    run_folder,
    run_progress,
    scenario_help,
    scenario_of,
    store_and_print,
)
from omniwheel.number_text import finite

if TYPE_CHECKING:
    from hil_sim.batch import BatchResult
    from hil_sim.scenario import Scenario
    from hil_sim.statistics import Statistics

EXAMPLES = examples(
    "omni sim",
    "omni sim four_wheel --seed 3 --plant slip",
    "omni sim demo --seeds 20",
    "omni sim --preset report_torque",
    "omni sim demo --robot fast_three_wheel --set world.slip_max=0.2",
)
MAX_SEEDS = 100_000

ROWS = (
    ("position RMSE [mm]", "position_m", 1e3, 3),
    ("heading RMSE [mrad]", "theta_rad", 1e3, 3),
    ("estimate's position RMSE [mm]", "estimate_position_m", 1e3, 3),
    ("estimate's heading RMSE [mrad]", "estimate_theta_rad", 1e3, 3),
    ("peak wheel speed [rad/s]", "peak_wheel_rad_s", 1.0, 3),
    ("time at a limit [%]", "saturated_share", 100.0, 2),
    ("chatter index", "chatter", 1.0, 4),
    ("driven to the end", "completed", 1.0, 2),
)


def sim(
    scenario_name: ScenarioArgument = "demo",
    seed: SeedOption = None,
    seeds: Annotated[
        int,
        typer.Option(
            "--seeds", min=1, max=MAX_SEEDS, help="Run this many seeds and print mean and standard deviation."
        ),
    ] = 1,
    robot: RobotOption = None,
    settings: SetOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    duration: DurationOption = None,
    listed: ListOption = False,
    out: OutOption = DEFAULT_OUT,
    json_wanted: JsonOption = False,
) -> None:
    """Run a scenario with world and control core in one process, without firmware and link: faster than omni hil."""
    from hil_sim.runs import run_in_process

    if listed:
        print_scenarios(json_wanted)
        return
    scenario = scenario_of(
        scenario_name, robot=robot, seed=seed, plant=plant, preset=preset, settings=settings, duration=duration
    )
    if seeds > 1:
        _many(scenario, seeds, json_wanted)
        return
    with run_folder(out, scenario) as folder:
        note(scenario.description, quiet=json_wanted)
        with run_progress(scenario.name, json_wanted) as progress:
            run = run_in_process(scenario, progress=progress)
        store_and_print(run, folder, as_json=json_wanted)


sim.__doc__ = f"{sim.__doc__}\n\n{scenario_help()}"


def _many(scenario: Scenario, seeds: int, json_wanted: bool) -> None:
    from hil_sim.batch import STATUSES, run_batches
    from hil_sim.runs import run_in_process
    from hil_sim.statistics import merged

    chosen = range(scenario.seed, scenario.seed + seeds)
    parts: list[BatchResult] = []
    start = time.perf_counter()
    with run_progress(f"{scenario.name}, {seeds} seeds", json_wanted or not error_console.is_terminal) as progress:
        for part in run_batches(scenario, chosen[0], seeds):
            parts.append(part)
            progress(float(sum(len(done.rows) for done in parts)), float(seeds))
    wall_s = time.perf_counter() - start
    statistics = merged(part.statistics for part in parts)
    ok = STATUSES[0]
    if ok not in statistics.statuses:
        run_in_process(scenario)  # raises, and knows the words
    factor = statistics.ticks * 1e-3 / wall_s
    if json_wanted:
        print_json(_as_json(scenario, chosen, parts, statistics, factor))
    else:
        console.print(_spread_table(scenario, chosen, statistics, factor))
        for status, count in statistics.statuses.items():
            if status != ok:
                console.print(f"[yellow]{count} of {seeds} runs: {escape(status)}[/]")


def _as_json(
    scenario: Scenario, seeds: range, parts: Sequence[BatchResult], statistics: Statistics, factor: float
) -> dict[str, Any]:
    from hil_sim.batch import FIGURES

    columns = ("seed", *(figure.name for figure in FIGURES))
    spreads = {name: {"mean": spread.mean, "sd": spread.sd} for name, spread in statistics.spreads.items()}
    runs = [{name: row[name].item() for name in columns} for part in parts for row in part.rows]
    return {
        "scenario": scenario.name,
        "seeds": list(seeds),
        "statuses": dict(statistics.statuses),
        "realtime_factor": factor,
        "figures": finite(spreads),
        "runs": finite(runs),
    }


def _spread_table(scenario: Scenario, seeds: range, statistics: Statistics, factor: float) -> Table:
    title = f"{scenario.name}: seeds {seeds[0]} to {seeds[-1]}, {factor:.0f} times real time"
    table = Table(title=title, title_style="bold", title_justify="left")
    for heading in ("", "mean", "standard deviation"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, key, scale, digits in ROWS:
        spread = statistics[key]
        table.add_row(escape(name), f"{spread.mean * scale:.{digits}f}", f"{spread.sd * scale:.{digits}f}")
    return table
