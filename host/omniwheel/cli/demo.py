# SPDX-License-Identifier: MIT
"""``omni demo``: the main job, end to end, with nothing but this computer."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hil_sim.hil import run_hil
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario
from hil_sim.summary import summarize
from omniwheel.cli.common import FAILED, JsonOption, console, examples, note
from omniwheel.cli.run_output import (
    DEFAULT_OUT,
    EmulatedOption,
    ImageOption,
    OutOption,
    PlantOption,
    PresetOption,
    RobotOption,
    SeedOption,
    SetOption,
    comparison_table,
    print_facts,
    run_folder,
    run_progress,
    scenario_of,
    store,
    tried,
)

EXAMPLES = examples(
    "omni demo",
    "omni demo --robot fast_three_wheel",
    "omni demo --seed 7 --out /tmp/runs",
    "omni demo --emulated",
    "omni demo --json | jq .rmse",
)
COMPARED = ("original_law", "no_slip")


def demo(
    seed: SeedOption = None,
    robot: RobotOption = None,
    settings: SetOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    out: OutOption = DEFAULT_OUT,
    compare: Annotated[
        bool,
        typer.Option("--compare/--no-compare", help="Also run the robot's original control law, and without slip."),
    ] = True,
    emulated: EmulatedOption = False,
    image: ImageOption = None,
    json_wanted: JsonOption = False,
) -> None:
    """Drive a simulated robot with its real firmware: start it as a process, put it host-in-the-loop over MAVLink,
    arm, track an eight-petal rose while rotating, change a gain half-way, disarm; then compare.

    Leaves a folder with telemetry.tlog, summary.json and report.png. Exit code 1 if the path was not driven to its end.
    """  # noqa: D205
    if emulated and image is not None:
        raise typer.BadParameter("--emulated and --image are two firmwares: give one of them")
    scenario = scenario_of("demo", robot=robot, seed=seed, plant=plant, preset=preset, settings=settings)
    with run_folder(out, scenario) as folder:
        note("The real firmware drives an eight-petal rose on a floor where its wheels slip.", quiet=json_wanted)
        with run_progress("firmware in the loop", json_wanted) as progress:
            run, trouble = tried(
                partial(run_hil, scenario, out_dir=folder, progress=progress, emulated=emulated, image=image)
            )
        summary = summarize(run)
        summary["comparison"] = (
            {name: _compared(name, scenario, robot, json_wanted) for name in COMPARED} if compare else {}
        )
        store(run, summary, folder, partial(_print, summary, folder), as_json=json_wanted, trouble=trouble)
    if not run.done:
        raise typer.Exit(FAILED)


def _compared(name: str, shown: Scenario, robot: str | None, quiet: bool) -> dict[str, Any]:
    scenario = scenario_of(name, robot=robot, plant=shown.plant)
    with run_progress(name.replace("_", " "), quiet) as progress:
        summary = summarize(run_in_process(scenario, shown.seed, progress))
    kept = ("description", "way", "completed", "rmse", "estimator_rmse", "effort", "faults", "realtime_factor")
    return {key: summary[key] for key in kept}


def _print(summary: dict[str, Any], folder: Path) -> None:
    change = summary["change"]
    columns = []
    if change is not None:
        columns += [("before", change["rmse_before"], None), ("after", change["rmse_after"], None)]
    columns.append(("all", summary["rmse"], summary["effort"]))
    headings = {"original_law": "original law", "no_slip": "no slip"}
    columns += [(headings[name], entry["rmse"], entry["effort"]) for name, entry in summary["comparison"].items()]
    console.print(comparison_table(f"Eight-petal rose, {summary['robot']}, {summary['controller'].upper()}", columns))
    if summary["comparison"]:
        console.print("original law: the same world under the robot's first firmware; no slip: on dead reckoning alone")
    for entry in summary["comparison"].values():
        if not entry["completed"]:
            console.print(f"[yellow]{entry['description']}: stopped before the end ({', '.join(entry['faults'])})[/]")
    print_facts(summary)
    if not summary["completed"]:
        console.print("[bold red]the path was not driven to its end[/]")
    console.print(f"\n[bold]{folder}[/]: report.png, summary.json, telemetry.tlog")
