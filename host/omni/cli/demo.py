# SPDX-License-Identifier: MIT
"""``omni demo``: the main job, end to end, with nothing but this computer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from omni.cli.common import FAILED, JsonOption, console, examples, note
from omni.cli.options import DEFAULT_OUT, OutOption
from omni.cli.run_output import (
    EmulatedOption,
    ImageOption,
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

if TYPE_CHECKING:
    from hil_sim.scenario import Scenario

EXAMPLES = examples(
    "omni demo",
    "omni demo --slow",
    "omni demo --seed 7 --out /tmp/runs",
    "omni demo --emulated",
    "omni demo --json | jq .rmse",
)


@dataclass(frozen=True)
class Shown:
    """What the demo shows: a scenario, and those beside it with the heading of their column and what they are."""

    scenario: str
    compared: tuple[tuple[str, str], ...]
    explained: str


FAST = Shown(
    "fast",
    (("fast_no_fixes", "no pose fixes"), ("fast_no_slip", "no slip")),
    "no pose fixes: dead reckoning alone; no slip: dead reckoning on a floor without slip",
)
SLOW = Shown(
    "demo",
    (("original_law", "original law"), ("original_law_fixes", "original law, fixes"), ("no_slip", "no slip")),
    "original law: the first firmware's controller, on dead reckoning; original law, fixes: that law "
    "with our pose filter and its fixes; no slip: our law on dead reckoning alone",
)


def demo(
    slow: Annotated[
        bool, typer.Option("--slow", help="Drive the slow robot three_wheel at 0.15 m/s in scenario demo.")
    ] = False,
    seed: SeedOption = None,
    robot: RobotOption = None,
    settings: SetOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    out: OutOption = DEFAULT_OUT,
    compare: Annotated[
        bool,
        typer.Option("--compare/--no-compare", help="Also drive the path in other configurations."),
    ] = True,
    emulated: EmulatedOption = False,
    image: ImageOption = None,
    json_wanted: JsonOption = False,
) -> None:
    """Drive a fast simulated robot with its real firmware, which runs as a process, host-in-the-loop over MAVLink.

    It arms, tracks an eight-petal rose at up to 1.1 m/s while rotating, changes a gain half-way and disarms. Then it
    compares. The robot is fast_three_wheel, the scenario fast; with --slow they are three_wheel and demo.

    Leaves a folder with telemetry.tlog, summary.json and run.png. Exit code 1 if the path was not driven to its end.
    """
    from hil_sim.hil import run_hil
    from hil_sim.summary import summarize

    if emulated and image is not None:
        raise typer.BadParameter("--emulated and --image are two firmwares: give one of them")
    shown = SLOW if slow else FAST
    scenario = scenario_of(shown.scenario, robot=robot, seed=seed, plant=plant, preset=preset, settings=settings)
    with run_folder(out, scenario) as folder:
        note(
            "Drive an eight-petal rose with the real firmware on a simulated floor where the wheels slip.",
            quiet=json_wanted,
        )
        with run_progress("firmware in the loop", json_wanted) as progress:
            run, trouble = tried(
                partial(run_hil, scenario, out_dir=folder, progress=progress, emulated=emulated, image=image)
            )
        summary = summarize(run)
        summary["comparison"] = (
            {name: _compared(name, scenario, robot, json_wanted) for name, _ in shown.compared} if compare else {}
        )
        store(run, summary, folder, partial(_print, summary, folder, shown), as_json=json_wanted, trouble=trouble)
    if not run.done:
        raise typer.Exit(FAILED)


def _compared(name: str, shown: Scenario, robot: str | None, quiet: bool) -> dict[str, Any]:
    from hil_sim.runs import run_in_process
    from hil_sim.summary import summarize

    scenario = scenario_of(name, robot=robot, plant=shown.plant)
    with run_progress(name.replace("_", " "), quiet) as progress:
        summary = summarize(run_in_process(scenario, shown.seed, progress))
    kept = ("description", "way", "completed", "rmse", "estimator_rmse", "effort", "faults", "realtime_factor")
    return {key: summary[key] for key in kept}


def _print(summary: dict[str, Any], folder: Path, shown: Shown) -> None:
    change, compared = summary["change"], summary["comparison"]
    columns = []
    if change is not None:
        columns += [("before", change["rmse_before"], None), ("after", change["rmse_after"], None)]
    columns.append(("all", summary["rmse"], summary["effort"]))
    columns += [
        (heading, compared[name]["rmse"], compared[name]["effort"]) for name, heading in shown.compared if compared
    ]
    console.print(comparison_table(f"Eight-petal rose, {summary['robot']}, {summary['controller'].upper()}", columns))
    if compared:
        console.print(shown.explained)
    for entry in compared.values():
        if not entry["completed"]:
            console.print(f"[yellow]{entry['description']}: stopped before the end ({', '.join(entry['faults'])})[/]")
    print_facts(summary)
    if not summary["completed"]:
        console.print("[bold red]the path was not driven to its end[/]")
    console.print(f"\n[bold]{escape(str(folder))}[/]: run.png, summary.json, telemetry.tlog")
