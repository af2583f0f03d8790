# SPDX-License-Identifier: MIT
"""``omni sweep``: the same seeds at many settings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from hil_sim.limits import DEFAULT_BATCH
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
    from hil_sim.scenario import Scenario
    from hil_sim.studies import sweep as study
    from hil_sim.studies.plan import Point
    from hil_sim.studies.space import Axis

EXAMPLES = examples(
    "omni sweep demo --param world.slip_max=0:0.3:7 --runs 64",
    "omni sweep no_slip --param ISMC_LAM_XY=2:20:7 --param ISMC_LAM_TH=2:20:7 --show position_m.p95",
    "omni sweep demo --param ISMC_LAM_XY=1:30:log --param world.fix_delay_s=0:0.1 --sobol 64",
)
ParamOption = Annotated[
    list[str],
    typer.Option(
        "--param",
        metavar="NAME=LOW:HIGH[:N]",
        help="Parameter, or world.NAME for a number of the world: a range, for --grid with its number of points, "
        "or values a,b,c. :log spaces them logarithmically. Repeatable.",
        show_default=False,
    ),
]
_SHOWN_ROWS = 40


@takes(StudyOptions, runs=32, batch=DEFAULT_BATCH)
def sweep(
    scenario_name: ScenarioArgument,
    param: ParamOption,
    on_grid: Annotated[bool, typer.Option("--grid", help="Every combination; the default.")] = False,
    sobol_count: Annotated[
        int | None,
        typer.Option(
            "--sobol", min=1, metavar="N", help="N points of a Sobol sequence in the ranges.", show_default=False
        ),
    ] = None,
    show: Annotated[
        str, typer.Option("--show", metavar="FIGURE[.STATISTIC]", help="Metric of the table and the plot.")
    ] = "position_m.mean",
    *,
    wanted: StudyOptions,
) -> None:
    """Run a scenario at many settings of its parameters or of its world, with the same seeds at each.

    A point that the control core refuses is marked and left out. Interrupted, the same command goes on.
    """
    from hil_sim.studies import sweep as study
    from hil_sim.studies.figures import parse_number
    from hil_sim.studies.space import parse_axes

    if on_grid and sobol_count is not None:
        raise typer.BadParameter("--grid and --sobol exclude each other")
    scenario = wanted.scenario(scenario_name)
    axes = parse_axes(param, scenario.robot.table)
    first_seed = wanted.first_seed(scenario)
    points = _points(axes, scenario, sobol_count, first_seed)
    plan = study.Plan(scenario, axes, points, wanted.runs, first_seed, wanted.batch, parse_number(show))
    path = study_folder(wanted.out, scenario, "sweep")
    note(scenario.description, quiet=wanted.json_wanted)
    with (
        study_pool(wanted.workers, wanted.cluster) as pool,
        study.open_study(plan, path, fresh=wanted.fresh) as folder,
        study_progress(
            f"{scenario.name}, {len(points)} points", len(points) * wanted.runs, path, wanted.json_wanted
        ) as progress,
    ):
        results = study.run_study(plan, folder, pool, progress)
        from hil_sim.studies.sweep_picture import draw_sweep  # here, not above: matplotlib takes a second to import

        results_in = plan.results_folder(path)
        draw_sweep(plan, results, results_in / study.PICTURE_FILE)
    if wanted.json_wanted:
        print_json({**study.document(plan, results), "folder": str(results_in)})
    else:
        _print(plan, results, progress, str(results_in))


sweep.__doc__ = f"{sweep.__doc__}\n\n    {scenario_help()}\n    "


def _points(axes: list[Axis], scenario: Scenario, sobol_count: int | None, seed: int) -> list[Point]:
    from hil_sim.studies.space import grid, sobol

    return grid(axes, scenario) if sobol_count is None else sobol(axes, scenario, sobol_count, seed)


def _print(plan: study.Plan, results: list[study.PointResult], progress: StudyProgress, folder: str) -> None:
    from hil_sim.studies import sweep as study
    from hil_sim.studies.figures import FIGURES

    means = [name for name in ("position_m", "theta_rad") if str(plan.shown) != f"{name}.mean"]
    unit = FIGURES[plan.shown.figure].unit if plan.shown.figure in FIGURES else ""
    shown = f"{plan.shown} [{unit}]" if unit and plan.shown.statistic == "mean" else str(plan.shown)
    axes = [axis.heading for axis in plan.axes]
    headings = [*axes, shown, *(f"mean {FIGURES[name].heading}" for name in means), "driven to the end [%]"]
    rows = []
    for result in results[:_SHOWN_ROWS]:
        values = [axis.show(result.point.values[axis.name]) for axis in plan.axes]
        rows.append([*values, *_cells(plan, result, means)])
    print_table(f"{plan.scenario.name}: {len(results)} points × {plan.runs} runs", headings, rows, len(axes))
    if len(results) > _SHOWN_ROWS:
        console.print(f"{len(results) - _SHOWN_ROWS} more points are in {study.TABLE_FILE}")
    print_end(progress, folder)


def _cells(plan: study.Plan, result: study.PointResult, means: list[str]) -> list[str]:
    if result.summary is None:
        return [f"refused: {result.refusal}", *("–" for _ in means), "–"]
    figures = result.summary["figures"]
    shown = _mean(plan.shown.figure, figures) if plan.shown.statistic == "mean" and plan.shown.figure in figures else ""
    cells = [shown or plan.shown.show(result.shown), *(_mean(name, figures) for name in means)]
    return [*cells, f"{100.0 * result.summary['completed']['share']:.4g}"]


def _mean(name: str, figures: dict[str, Any]) -> str:
    """A mean with its 95 % interval."""
    from hil_sim.studies.figures import FIGURES

    entry, figure = figures[name], FIGURES[name]
    interval = entry["mean_95"]
    half = "" if interval is None else f" ± {figure.show(0.5 * (interval[1] - interval[0]))}"
    return f"{figure.show(entry['mean'])}{half}"
