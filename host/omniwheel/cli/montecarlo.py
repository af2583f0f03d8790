# SPDX-License-Identifier: MIT
"""``omni montecarlo``: one scenario, very many seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil_sim.studies import montecarlo as study
from hil_sim.studies.figures import FIGURES, known_figure
from hil_sim.studies.plan import DEFAULT_BATCH
from omniwheel.cli.common import JsonOption, console, examples, note, print_json
from omniwheel.cli.run_output import PlantOption, PresetOption, ScenarioArgument, SeedOption, SetOption, scenario_help
from omniwheel.cli.study_output import (
    BatchOption,
    ClusterOption,
    DurationOption,
    FreshOption,
    StudyOutOption,
    StudyProgress,
    WorkersOption,
    print_end,
    print_table,
    study_folder,
    study_pool,
    study_progress,
    study_scenario,
)

EXAMPLES = examples(
    "omni montecarlo demo --runs 1000",
    "omni montecarlo no_slip --runs 5000 --set ISMC_LAM_XY=8 --set world.slip_max=0.15 --out runs/slippery",
    "omni montecarlo demo --runs 100000 --cluster tcp://192.168.1.10:8786",
)


def montecarlo(
    scenario_name: ScenarioArgument = "demo",
    runs: Annotated[int, typer.Option("--runs", help="How many seeds.")] = 1000,
    seed: SeedOption = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    batch: BatchOption = DEFAULT_BATCH,
    worst: Annotated[int, typer.Option("--worst", min=0, max=1000, help="How many of the worst runs to keep.")] = 5,
    worst_by: Annotated[
        str, typer.Option("--worst-by", metavar="FIGURE", help=f"What makes a run bad: {', '.join(FIGURES)}.")
    ] = "position_m",
    settings: SetOption = None,
    duration: DurationOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    out: StudyOutOption = None,
    fresh: FreshOption = False,
    json_wanted: JsonOption = False,
) -> None:
    """Run a scenario with very many seeds: what to expect, how sure that is, and the worst runs to look at again.

    The numbers depend on the scenario and its seeds alone, not on workers, cluster or interruptions. Interrupted, the
    same command goes on; with a larger --runs it adds to what is there.
    """
    scenario = study_scenario(scenario_name, plant, preset, settings, duration)
    known_figure(worst_by)
    if worst_by not in FIGURES:
        raise typer.BadParameter(f"--worst-by {worst_by}: choose one of {', '.join(FIGURES)}")
    first_seed = scenario.seed if seed is None else seed
    plan = study.Plan(scenario, runs, first_seed, batch, worst, worst_by)
    path = study_folder(out, scenario, "montecarlo")
    note(scenario.description, quiet=json_wanted)
    with (
        study_pool(workers, cluster) as pool,
        study.open_study(plan, path, fresh=fresh) as folder,
        study_progress(scenario.name, runs, path, json_wanted) as progress,
    ):
        outcome = study.run_study(plan, folder, pool, progress)
        _draw(plan, outcome, folder.path)
    if json_wanted:
        print_json({**outcome.summary, "folder": str(path)})
    else:
        _print(outcome, progress, str(path))


montecarlo.__doc__ = f"{montecarlo.__doc__}\n\n    {scenario_help()}\n    "


def _draw(plan: study.Plan, outcome: study.Outcome, path: Path) -> None:
    from hil_sim.studies.montecarlo_picture import draw_montecarlo  # here, not above: matplotlib takes a second
    from hil_sim.studies.tables import REPORT_FILE, write_montecarlo_page

    draw_montecarlo(plan, outcome, path / study.PICTURE_FILE)
    write_montecarlo_page(outcome.summary, study.PICTURE_FILE, path / REPORT_FILE)


def _print(outcome: study.Outcome, progress: StudyProgress, folder: str) -> None:
    from hil_sim.studies.tables import NO_FIGURES, SPREAD_HEADINGS, completion_line, fault_lines, spread_rows

    summary = outcome.summary
    if rows := spread_rows(summary):
        print_table(f"{summary['scenario']}: {summary['runs']} runs", SPREAD_HEADINGS, rows)
    else:
        console.print(f"{summary['scenario']}: {summary['runs']} runs; {NO_FIGURES}", markup=False)
    for line in (completion_line(summary), *fault_lines(summary)):
        console.print(line, markup=False)
    for entry in summary["worst"]:
        figure = FIGURES[summary["worst_by"]]
        value = f"{figure.show(entry[summary['worst_by']])} {figure.unit}".strip()
        console.print(f"  {value}: omni sim {folder}/{entry['file']}", markup=False, soft_wrap=True)
    print_end(progress, folder)
