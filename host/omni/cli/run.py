# SPDX-License-Identifier: MIT
"""``omni run``: a scenario from its start to its end, in simulated time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from omni.cli import completion
from omni.cli.common import FAILED, JsonOption, console, examples, note
from omni.cli.options import DEFAULT_OUT, ListOption, OutOption
from omni.cli.run_output import (
    Board,
    BoardOption,
    DurationOption,
    ImageOption,
    PlantOption,
    PresetOption,
    RobotOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    WorldOption,
    is_emulated,
    print_run,
    print_scenarios,
    run_folder,
    run_progress,
    scenario_help,
    scenario_of,
    store,
    tried,
    world_of,
)

if TYPE_CHECKING:
    from hil_sim.external import ExternalWorld, ExternalWorldError
    from hil_sim.runs import Run
    from hil_sim.scenario import Scenario
    from hil_sim.timeline import Progress

EXAMPLES = examples(
    "omni run                               # the fast robot on its rose",
    "omni run demo --compare                # the slow robot, and other controllers beside it",
    "omni run --list",
    "omni run fault_encoder_stuck --seed 3 --json",
    "omni run my_scenario.toml --out /tmp/runs",
    "omni run four_wheel --core-only        # without firmware and link: the fastest",
    "omni run demo --robot fast_three_wheel --set world.slip_max=0.2",
    "omni run --preset report_torque --plant slip",
    "omni run --duration 5                  # the first five seconds",
    "omni run --board cortex-m7             # the firmware on an emulated Cortex-M7",
    "omni run --image firmware.elf          # the very image that is flashed, on an emulated Teensy",
    "omni run --link /dev/ttyACM0           # a Teensy, its motors unplugged",
    "omni run --world my_simulator:MyWorld  # a simulator of your own around the firmware",
    "omni run no_slip --world mujoco        # every roller a body: needs pip install 'omniwheel[mujoco]'",
)


def run(
    scenario_name: ScenarioArgument = "fast",
    core_only: Annotated[
        bool,
        typer.Option("--core-only", help="Run only the control core, without firmware and messages: much faster."),
    ] = False,
    board: BoardOption = None,
    image: ImageOption = None,
    link: Annotated[
        str | None,
        typer.Option(
            "--link",
            "-l",
            metavar="URL",
            help="Use the firmware of a real Teensy, or of `omni sitl`, at this address.",
            autocompletion=completion.ports,
        ),
    ] = None,
    seed: SeedOption = None,
    robot: RobotOption = None,
    settings: SetOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    world: WorldOption = None,
    duration: DurationOption = None,
    compare: Annotated[
        bool,
        typer.Option("--compare", help="Also run the scenarios that this one names for comparison, core only."),
    ] = False,
    listed: ListOption = False,
    out: OutOption = DEFAULT_OUT,
    json_wanted: JsonOption = False,
) -> None:
    """Run a scenario to its end in simulated time: the real firmware, as a process, in a simulated world.

    Firmware and world exchange MAVLink messages in lockstep, so that the same seed gives the same run. For a robot in
    real time, to which other programs connect, see `omni sitl`.

    Leaves a folder with summary.json, run.png and, with firmware, telemetry.tlog. Exit code 1 if the robot did not
    reach the end of its path, unless the scenario has faults.
    """
    if listed:
        print_scenarios(json_wanted)
        return
    emulated = is_emulated(board, image)
    _refuse_other_firmware(core_only, board, image, link, world)
    scenario = scenario_of(
        scenario_name, robot=robot, seed=seed, plant=plant, preset=preset, settings=settings, duration=duration
    )
    if compare and not scenario.compared:
        raise typer.BadParameter(f"--compare: scenario {scenario.name} has no section [compare]")
    external = world_of(world, scenario, json_wanted)
    with run_folder(out, scenario) as folder:
        note(scenario.description, quiet=json_wanted)
        with run_progress(scenario.name, json_wanted) as progress:
            firmware = {"link": link, "out_dir": folder, "emulated": emulated, "image": image, "world": external}
            done, trouble = tried(partial(_driven, scenario, progress, None if core_only else firmware))
        unfinished = None if external is None else _finished(external, folder)
        from hil_sim.summary import summarize

        summary = summarize(done)
        if compare:
            summary["comparison"] = {name: _compared(name, scenario, robot, json_wanted) for name in scenario.compared}
        show = partial(print_run, summary, folder, scenario.compared)
        store(done, summary, folder, show, as_json=json_wanted, trouble=trouble or unfinished)
    if done.stopped_early:
        if not json_wanted:
            console.print("[bold red]the path was not driven to its end[/]")
        raise typer.Exit(FAILED)


run.__doc__ = f"{run.__doc__}\n\n{scenario_help()}"


def _refuse_other_firmware(
    core_only: bool, board: Board | None, image: Path | None, link: str | None, world: str | None
) -> None:
    """Raise BadParameter for options that are about another firmware than the one chosen."""
    given = {"--board": board, "--image": image, "--link": link, "--world": world}
    words = [name for name, value in given.items() if value is not None]
    if core_only and words:
        raise typer.BadParameter(f"--core-only runs no firmware: leave out {' and '.join(words)}")
    if link is not None and (board is not None or image is not None):
        raise typer.BadParameter("--link uses a firmware that runs already: leave out --board and --image")


def _driven(scenario: Scenario, progress: Progress, firmware: Mapping[str, Any] | None) -> Run:
    """Run a scenario with this firmware, described by the arguments of ``run_hil``; None: with the core alone."""
    if firmware is None:
        from hil_sim.runs import run_in_process

        return run_in_process(scenario, progress=progress)
    from hil_sim.hil import run_hil

    return run_hil(scenario, progress=progress, **firmware)


def _compared(name: str, shown: Scenario, robot: str | None, quiet: bool) -> dict[str, Any]:
    from hil_sim.runs import run_in_process
    from hil_sim.summary import comparable, summarize

    scenario = scenario_of(name, robot=robot, plant=shown.plant)
    with run_progress(name.replace("_", " "), quiet) as progress:
        return comparable(summarize(run_in_process(scenario, shown.seed, progress)))


def _finished(world: ExternalWorld, folder: Path) -> ExternalWorldError | None:
    """Let the world write its files; what goes wrong then is told once the run is stored and shown."""
    from hil_sim.external import ExternalWorldError, finish_world

    try:
        finish_world(world, folder)
    except ExternalWorldError as error:
        return error
    return None
