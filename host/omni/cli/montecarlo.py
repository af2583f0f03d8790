# SPDX-License-Identifier: MIT
"""``omni montecarlo``: one scenario, very many seeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil_sim.limits import DEFAULT_BATCH
from hil_sim.studies.figures import FIGURES, known_figure
from omni.cli.common import console, examples, note, print_json
from omni.cli.options import takes
from omni.cli.run_output import ScenarioArgument, scenario_help
from omni.cli.study_output import (
    StudyOptions,
    StudyProgress,
    print_end,
    print_table,
    study_folder,
    study_pool,
    study_progress,
)

if TYPE_CHECKING:
    from hil_sim.studies import montecarlo as study

EXAMPLES = examples(
    "omni montecarlo demo --runs 1000",
    "omni montecarlo no_slip --runs 5000 --set ISMC_LAM_XY=8 --set world.slip_max=0.15 --out runs/slippery",
    "omni montecarlo demo --runs 100000 --cluster tcp://192.168.1.10:8786",
)


@takes(StudyOptions, runs=1000, batch=DEFAULT_BATCH)
def montecarlo(
    scenario_name: ScenarioArgument = "demo",
    worst: Annotated[int, typer.Option("--worst", min=0, max=1000, help="Number of worst runs to keep.")] = 5,
    worst_by: Annotated[
        str,
        typer.Option("--worst-by", metavar="FIGURE", help=f"Metric that ranks the runs: {', '.join(FIGURES)}."),
    ] = "position_m",
    *,
    wanted: StudyOptions,
) -> None:
    """Run a scenario with very many seeds: what to expect, how sure that is, and the worst runs to look at again.

    The numbers depend on the scenario and its seeds alone, not on workers, cluster or interruptions. Interrupted, the
    same command goes on; with a larger --runs it adds to what is there.
    """
    from hil_sim.studies import montecarlo as study

    scenario = wanted.scenario(scenario_name)
    known_figure(worst_by)
    if worst_by not in FIGURES:
        raise typer.BadParameter(f"--worst-by {worst_by}: choose one of {', '.join(FIGURES)}")
    first_seed = wanted.first_seed(scenario)
    plan = study.Plan(scenario, wanted.runs, first_seed, wanted.batch, worst, worst_by)
    path = study_folder(wanted.out, scenario, "montecarlo")
    note(scenario.description, quiet=wanted.json_wanted)
    with (
        study_pool(wanted.workers, wanted.cluster) as pool,
        study.open_study(plan, path, fresh=wanted.fresh) as folder,
        study_progress(scenario.name, wanted.runs, path, wanted.json_wanted) as progress,
    ):
        outcome = study.run_study(plan, folder, pool, progress)
        _draw(plan, outcome, folder.path)
    if wanted.json_wanted:
        print_json({**outcome.summary, "folder": str(path)})
    else:
        _print(outcome, progress, str(path))


montecarlo.__doc__ = f"{montecarlo.__doc__}\n\n    {scenario_help()}\n    "


def _draw(plan: study.Plan, outcome: study.Outcome, path: Path) -> None:
    from hil_sim.studies import montecarlo as study
    from hil_sim.studies.montecarlo_picture import draw_montecarlo  # here, not above: matplotlib takes a second
    from hil_sim.studies.tables import PAGE_FILE, write_montecarlo_page

    draw_montecarlo(plan, outcome, path / study.PICTURE_FILE)
    write_montecarlo_page(outcome.summary, study.PICTURE_FILE, path / PAGE_FILE)


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
        console.print(f"  {value}: omni run --core-only {folder}/{entry['file']}", markup=False, soft_wrap=True)
    print_end(progress, folder)
