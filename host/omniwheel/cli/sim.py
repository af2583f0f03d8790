# SPDX-License-Identifier: MIT
"""``omni sim``: a scenario without a link, the control core in this process."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from hil_sim import metrics
from hil_sim.runs import Run, run_in_process, run_seeds
from hil_sim.scenario import Scenario, load_scenario
from omniwheel.cli.common import JsonOption, console, error_console, examples, note, print_json
from omniwheel.cli.run_output import (
    DEFAULT_OUT,
    OutOption,
    PlantOption,
    PresetOption,
    ScenarioArgument,
    SeedOption,
    apply_preset,
    finished,
    make_folder,
    print_run,
    run_progress,
    scenario_help,
)

EXAMPLES = examples(
    "omni sim",
    "omni sim four_wheel --seed 3 --plant slip",
    "omni sim demo --seeds 20",
    "omni sim --preset report_torque",
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
    ("real-time factor", "realtime_factor", 1.0, 0),
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
    plant: PlantOption = None,
    preset: PresetOption = None,
    out: OutOption = DEFAULT_OUT,
    json_wanted: JsonOption = False,
) -> None:
    """Run a scenario in this process: the same world and the same control core, without firmware and link."""
    scenario = apply_preset(load_scenario(scenario_name).with_seed(seed).with_plant(plant), preset)
    if seeds > 1:
        _many(scenario, seeds, json_wanted)
        return
    folder = make_folder(out, scenario)
    note(scenario.description, quiet=json_wanted)
    with run_progress(scenario.name, json_wanted) as progress:
        run = run_in_process(scenario, progress=progress)
    summary = finished(run, folder)
    if json_wanted:
        print_json({**summary, "folder": str(folder)})
    else:
        print_run(summary, folder)


sim.__doc__ = f"{sim.__doc__}\n\n{scenario_help()}"


def figures(run: Run) -> dict[str, float]:
    """Return the numbers of a run that several seeds are compared by."""
    tracking, estimate = metrics.tracking_rmse(run.record), metrics.estimator_rmse(run.record)
    return {
        **metrics.as_dict(tracking),
        "estimate_position_m": estimate.position_m,
        "estimate_theta_rad": estimate.theta_rad,
        **metrics.as_dict(metrics.effort(run.record, run.scenario.robot.wheels)),
        "completed": float(run.done),
        "realtime_factor": run.realtime_factor,
    }


def _many(scenario: Scenario, seeds: int, json_wanted: bool) -> None:
    chosen = range(scenario.seed, scenario.seed + seeds)
    found = []
    with run_progress(f"{scenario.name}, {seeds} seeds", json_wanted or not error_console.is_terminal) as progress:
        for entry in run_seeds(scenario, chosen, figures):
            found.append(entry)
            progress(float(len(found)), float(seeds))
    spread = metrics.spread(found)
    if json_wanted:
        print_json({"scenario": scenario.name, "seeds": list(chosen), "figures": spread, "runs": found})
    else:
        console.print(_spread_table(scenario, chosen, spread))


def _spread_table(scenario: Scenario, seeds: range, spread: dict[str, Any]) -> Table:
    table = Table(title=f"{scenario.name}: seeds {seeds[0]} to {seeds[-1]}", title_style="bold", title_justify="left")
    for heading in ("", "mean", "standard deviation"):
        table.add_column(heading, justify="left" if not heading else "right")
    for name, key, factor, digits in ROWS:
        entry = spread[key]
        table.add_row(escape(name), *(f"{entry[part] * factor:.{digits}f}" for part in ("mean", "sd")))
    return table
