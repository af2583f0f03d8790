# SPDX-License-Identifier: MIT
"""``omni optimize``: parameters that make a number of many runs smallest, within constraints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from hil_sim.limits import SAMPLERS
from hil_sim.studies.figures import FIGURES
from omni.cli.common import console, examples, note, print_json
from omni.cli.options import takes
from omni.cli.run_output import ScenarioArgument, scenario_help
from omni.cli.study_output import (
    StudyOptions,
    StudyProgress,
    print_table,
    study_folder,
    study_pool,
    study_progress,
)
from omniwheel import parameter_file

if TYPE_CHECKING:
    from hil_sim.studies import optimize as study

EXAMPLES = examples(
    "omni optimize no_slip --param ISMC_LAM_XY=1:30:log --param ISMC_LAM_TH=1:30:log --trials 50 --runs 16",
    'omni optimize demo --param ISMC_LAM_XY=1:30:log --minimise position_m.p95 --constraint "chatter.mean<=0.1"',
)
BATCH = 8
"""Runs of a batch: small, because the next trial has to wait for all of this one's."""


@takes(StudyOptions, runs=16, batch=BATCH)
def optimize(
    scenario_name: ScenarioArgument,
    param: Annotated[
        list[str],
        typer.Option(
            "--param",
            metavar="NAME=LOW:HIGH[:log]",
            help="A parameter and the range to search. Repeat for more.",
            show_default=False,
        ),
    ],
    minimise: Annotated[
        str,
        typer.Option(
            "--minimise",
            "--minimize",
            metavar="FIGURE[.STATISTIC]",
            help="Objective to minimise: a metric's mean, sd, median, p95, ...",
        ),
    ] = "position_m.mean",
    constraint: Annotated[
        list[str] | None,
        typer.Option(
            "--constraint",
            metavar='"FIGURE.STATISTIC<=X"',
            help="Constraint, in SI units and fractions. Without one on completed, every run must reach its end.",
            show_default=False,
        ),
    ] = None,
    trials: Annotated[
        int, typer.Option("--trials", min=1, max=100_000, help="Number of parameter sets to evaluate.")
    ] = 100,
    sampler: Annotated[
        str, typer.Option("--sampler", metavar="|".join(SAMPLERS), help="Sampler that chooses the next set.")
    ] = "tpe",
    *,
    wanted: StudyOptions,
) -> None:
    """Search the parameters that make a number of many runs smallest; check them on seeds that the search never saw.

    Writes best.toml, a parameter file for --preset and for omni params load; no robot is touched. A parameter set that
    the control core refuses counts as one that breaks a constraint. Interrupted, the same command goes on.
    """
    from hil_sim.studies import optimize as study
    from hil_sim.studies.figures import parse_constraint, parse_number
    from hil_sim.studies.space import parse_axes

    scenario = wanted.scenario(scenario_name)
    plan = study.Plan(
        scenario=scenario,
        axes=parse_axes(param, scenario.robot.table),
        minimise=parse_number(minimise),
        constraints=tuple(parse_constraint(text) for text in constraint or ()),
        trials=trials,
        runs=wanted.runs,
        first_seed=wanted.first_seed(scenario),
        batch_runs=wanted.batch,
        sampler=sampler,
    )
    path = study_folder(wanted.out, scenario, "optimize")
    note(scenario.description, quiet=wanted.json_wanted)
    with (
        study_pool(wanted.workers, wanted.cluster) as pool,
        study.open_study(plan, path, fresh=wanted.fresh) as folder,
        study_progress(scenario.name, (trials + 2) * wanted.runs, path, wanted.json_wanted) as progress,
    ):
        outcome = study.run_study(plan, folder, pool, progress, _teller(plan, progress))
        from hil_sim.studies.optimize_picture import draw_history  # here, not above: matplotlib takes a second

        draw_history(plan, outcome, path / study.PICTURE_FILE)
    if wanted.json_wanted:
        print_json({**study.document(plan, outcome), "folder": str(path)})
    else:
        _print(plan, outcome, progress, str(path))


optimize.__doc__ = f"{optimize.__doc__}\n\n    {scenario_help()}\n    "


def _teller(plan: study.Plan, progress: StudyProgress) -> study.Told:
    def told(trial: study.Trial, best: study.Trial | None) -> None:
        if trial.refusal:
            progress(plan.runs, 0.0, kept=True)
        found = "none feasible yet" if best is None else f"best {plan.minimise.show(best.objective)}"
        progress.title(f"{plan.scenario.name}, trial {trial.number + 1}/{plan.trials}, {found}")

    return told


def _print(plan: study.Plan, outcome: study.Outcome, progress: StudyProgress, folder: str) -> None:
    from hil_sim.studies import optimize as study

    before, after = outcome.before, outcome.after
    table = plan.scenario.robot.table
    rows = [
        [
            axis.heading,
            *(parameter_file.format_value(table[axis.name], side.values[axis.name]) for side in (before, after)),
        ]
        for axis in plan.axes
    ]
    rows.append([str(plan.minimise), *(plan.minimise.show(side.objective) for side in (before, after))])
    for name, figure in FIGURES.items():
        if figure.detail:
            continue
        cells = ["–" if s.summary is None else figure.show(s.summary["figures"][name]["mean"]) for s in (before, after)]
        rows.append([f"mean {figure.heading}", *cells])
    shares = ["–" if s.summary is None else f"{100.0 * s.summary['completed']['share']:.4g}" for s in (before, after)]
    rows.append(["driven to the end [%]", *shares])
    rows.append(["keeps the constraints", *("yes" if side.feasible else "no" for side in (before, after))])
    first, last = outcome.fresh_seeds
    title = f"{plan.scenario.name}: checked on fresh seeds {first} to {last}"
    print_table(title, ("", "before", "after"), rows)
    feasible = sum(trial.feasible for trial in outcome.trials)
    console.print(
        f"best of {len(outcome.trials)} trials is trial {outcome.best.number}; {feasible} keep the constraints "
        f"({', '.join(map(str, plan.bounds))})",
        markup=False,
    )
    console.print(progress.speed_line(), markup=False)
    if not after.feasible:
        console.print("[yellow]on the fresh seeds the best set breaks a constraint: use more --runs[/]")
    console.print(
        f"\n[bold]{escape(str(folder))}/{study.BEST_FILE}[/]: --preset FILE, omni params load FILE", soft_wrap=True
    )
