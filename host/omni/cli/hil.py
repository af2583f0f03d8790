# SPDX-License-Identifier: MIT
"""``omni hil``: a scenario with real firmware in the loop."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omni.cli.common import JsonOption, examples, note
from omni.cli.options import DEFAULT_OUT, ListOption, OutOption
from omni.cli.run_output import (
    DurationOption,
    EmulatedOption,
    ImageOption,
    PlantOption,
    PresetOption,
    RobotOption,
    ScenarioArgument,
    SeedOption,
    SetOption,
    WorldOption,
    print_scenarios,
    run_folder,
    run_progress,
    scenario_help,
    scenario_of,
    store_and_print,
    tried,
    world_of,
)

if TYPE_CHECKING:
    from hil_sim.external import ExternalWorld, ExternalWorldError

EXAMPLES = examples(
    "omni hil",
    "omni hil --list",
    "omni hil fault_encoder_stuck",
    "omni hil my_scenario.toml --seed 3 --json",
    "omni hil --emulated                    # the firmware on an emulated Cortex-M7",
    "omni hil --image firmware.elf          # the very image that is flashed, on an emulated Teensy",
    "omni hil --link /dev/ttyACM0           # a Teensy, its motors unplugged",
    "omni hil --world my_simulator:MyWorld  # a simulator of your own around the firmware",
    "omni hil demo --duration 5             # the first five seconds",
    "omni hil no_slip --world mujoco        # every roller a body: needs pip install 'omniwheel[mujoco]'",
)


def hil(
    scenario_name: ScenarioArgument = "demo",
    link: Annotated[
        str | None,
        typer.Option("--link", "-l", metavar="URL", help="Firmware to use. Default: a firmware process of its own."),
    ] = None,
    emulated: EmulatedOption = False,
    image: ImageOption = None,
    seed: SeedOption = None,
    robot: RobotOption = None,
    settings: SetOption = None,
    plant: PlantOption = None,
    preset: PresetOption = None,
    world: WorldOption = None,
    duration: DurationOption = None,
    listed: ListOption = False,
    out: OutOption = DEFAULT_OUT,
    json_wanted: JsonOption = False,
) -> None:
    """Run a scenario host-in-the-loop: the simulated world around the real firmware, in lockstep over MAVLink."""
    from hil_sim.hil import run_hil

    if listed:
        print_scenarios(json_wanted)
        return
    if sum((emulated, image is not None, link is not None)) > 1:
        raise typer.BadParameter("--emulated, --image and --link exclude each other: give one")
    scenario = scenario_of(
        scenario_name, robot=robot, seed=seed, plant=plant, preset=preset, settings=settings, duration=duration
    )
    external = world_of(world, scenario, json_wanted)
    with run_folder(out, scenario) as folder:
        note(scenario.description, quiet=json_wanted)
        with run_progress(scenario.name, json_wanted) as progress:
            run, trouble = tried(
                partial(
                    run_hil,
                    scenario,
                    link,
                    out_dir=folder,
                    progress=progress,
                    emulated=emulated,
                    image=image,
                    world=external,
                )
            )
        unfinished = None if external is None else _finished(external, folder)
        store_and_print(run, folder, as_json=json_wanted, trouble=trouble or unfinished)


def _finished(world: ExternalWorld, folder: Path) -> ExternalWorldError | None:
    """Let the world write its files; what goes wrong then is told once the run is stored and shown."""
    from hil_sim.external import ExternalWorldError, finish_world

    try:
        finish_world(world, folder)
    except ExternalWorldError as error:
        return error
    return None


hil.__doc__ = f"{hil.__doc__}\n\n{scenario_help()}"
