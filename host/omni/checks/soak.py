# SPDX-License-Identifier: MIT
"""``python -m omni.checks soak``: a long drive on the emulated processor's own timing."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.markup import escape

from omni.cli import completion
from omni.cli.common import FAILED, JsonOption, console, examples, print_json
from omni.cli.options import simulated_time_option
from omni.cli.run_output import SeedOption, run_progress, scenario_help

EXAMPLES = examples(
    "python -m omni.checks soak --duration 60",
    "python -m omni.checks soak --duration 3600 --json",
    "python -m omni.checks soak four_wheel",
)


def soak(
    scenario_name: Annotated[
        str,
        typer.Argument(
            metavar="SCENARIO",
            help="World, faults and trajectory; its events are not played.",
            autocompletion=completion.scenarios,
        ),
    ] = "demo",
    duration: Annotated[float, simulated_time_option(6.0, 1e6)] = 60.0,
    seed: SeedOption = None,
    json_wanted: JsonOption = False,
) -> None:
    """Drive for long on an emulated Cortex-M7 that ticks by its own timer, the world in step with its clock.

    Exit code 1 if a tick was missed, the clock drifted, bytes piled up or got lost, or the robot stopped.
    """
    from hil_sim.scenario import load_scenario
    from hil_sim.soak import run_soak

    scenario = load_scenario(scenario_name).with_seed(seed)
    with run_progress(scenario.name, json_wanted) as progress:
        result = run_soak(scenario, duration / 60.0, progress)
    if json_wanted:
        print_json(result.as_dict())
    else:
        for name, value in result.as_dict().items():
            console.print(f"{escape(name):22} {value}")
    if result.failures:
        raise typer.Exit(FAILED)


soak.__doc__ = f"{soak.__doc__}\n\n{scenario_help()}"
