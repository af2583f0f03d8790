# SPDX-License-Identifier: MIT
"""``python -m omni.checks autotune``: whether it keeps what it promises, on very many robots drawn at random."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omni.cli.common import JsonOption, console, examples, print_json
from omni.cli.options import DEFAULT_OUT, LossOption, OwnSeedOption, RadioOption
from omni.cli.study_output import FreshOption, StudyOutOption, WorkersOption, print_end, study_progress

EXAMPLES = examples(
    "python -m omni.checks autotune --robots 100",
    "python -m omni.checks autotune --robots 50 --radio 9600 --loss 0.05",
    "python -m omni.checks autotune --robots 20 --emulated",
    "python -m omni.checks autotune --robots 1000 --rivals 100 --stops 200 --workers 8 --out runs/study",
)


def autotune(
    robots: Annotated[int, typer.Option("--robots", min=1, max=100_000, help="Number of random robots.")] = 20,
    rivals: Annotated[
        int,
        typer.Option(
            "--rivals", min=0, help="Number of robots for which an optimiser with the true model is run for comparison."
        ),
    ] = 0,
    stops: Annotated[
        int, typer.Option("--stops", min=0, help="Number of tunings that are interrupted at random moments.")
    ] = 0,
    seed: OwnSeedOption = 1,
    radio: RadioOption = None,
    loss: LossOption = 0.05,
    emulated: Annotated[
        bool, typer.Option("--emulated", help="Run the firmware on an emulated Cortex-M7 instead of as a process.")
    ] = False,
    workers: WorkersOption = None,
    out: StudyOutOption = None,
    fresh: FreshOption = False,
    json_wanted: JsonOption = False,
) -> None:
    """Run omni autotune on random robots, in simulated time with the real firmware, and rate the results.

    Every number of a robot file has an error of up to 30 %. Robots are rated by their true pose on another path,
    before and after, on seeds that the tuning did not use. An interrupted study continues with the same command; a
    larger --robots extends it. With --radio or --emulated it is another study, in another folder.
    """
    from hil_sim.processes import usable_processors
    from hil_sim.studies.autotune_link import Way
    from hil_sim.studies.autotune_study import Plan, run_study
    from hil_sim.studies.autotune_summary import page
    from omniwheel.radio_model import RadioSettings

    way = Way(None if radio is None else RadioSettings(radio, loss), emulated)
    plan = Plan(robots, seed, min(rivals, robots), stops, way=way)
    path: Path = out if out is not None else DEFAULT_OUT / f"study-autotune{way.suffix}"
    total = robots + plan.rivals + stops
    with study_progress("autotune", total, path, json_wanted) as progress:
        summary = run_study(plan, path, workers or usable_processors(), fresh=fresh, told=progress)
    if json_wanted:
        print_json({**summary, "folder": str(path)})
        return
    console.print(page(summary), markup=False, highlight=False)
    print_end(progress, str(path))
