# SPDX-License-Identifier: MIT
"""``omni emulate``: the firmware on an emulated Cortex-M7, for any MAVLink program."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from omni.cli.common import JsonOption, examples, signals_interrupt
from omni.cli.options import HostOption, ListenPortOption
from omni.cli.run_output import ImageOption, RobotOption, SeedOption
from omni.cli.sitl import (
    CommandsOption,
    EndWithStdinOption,
    LinksOption,
    ScenarioNameArgument,
    StorageOption,
    WorldRobotOption,
    announce,
    read_input,
    serve_world,
)
from omni.cli.sitl import wait_for_end as _wait_for_end

if TYPE_CHECKING:
    from hil_sim.scenario import Scenario

EXAMPLES = examples(
    "omni emulate                                # a robot in a simulated world, as omni sitl",
    "omni emulate --robot four_wheel --link pty:/tmp/robot",
    "omni emulate --no-world                     # the board alone, for:",
    "omni hil --link tcp:127.0.0.1:5760",
    'omni emulate --commands                     # type lines like {"mend": true}, as for omni sitl',
    "omni emulate --image firmware.elf           # the very image that is flashed, on an emulated Teensy 4.0",
    "omni emulate --image firmware.elf --link usb=pty:/tmp/teensy --link uart=tcp:127.0.0.1:5761",
    "mavproxy.py --master=tcp:127.0.0.1:5760 --mav20",
)
POLL_S = 0.1


def emulate(
    scenario_name: ScenarioNameArgument = "sitl",
    robot: RobotOption = None,
    world_robot: WorldRobotOption = None,
    port: ListenPortOption = 5760,
    host: HostOption = "127.0.0.1",
    link: LinksOption = None,
    storage: StorageOption = None,
    world: Annotated[
        bool,
        typer.Option("--with-world/--no-world", help="Simulate robot and floor; without, the wheels stand still."),
    ] = True,
    lockstep: Annotated[
        bool,
        typer.Option(
            "--lockstep",
            help="Tick only when a host sends sensor values; the simulated time stops in between. Needs --no-world "
            "or --image.",
        ),
    ] = False,
    image: ImageOption = None,
    seed: SeedOption = None,
    end_with_stdin: EndWithStdinOption = False,
    commands: CommandsOption = False,
    json_wanted: JsonOption = False,
) -> None:
    """Run the firmware on an emulated Cortex-M7 (QEMU), in real time, until Ctrl-C: connect to it as to a robot.

    A link is a serial port of the board: a second client waits until the first has gone.
    With --image it is the image for a Teensy, on an emulated one (Unicorn). The world is at its pins, and its
    own parameters hold. Links are its connectors: usb=LINK (also without a name) and uart=LINK.
    """
    from hil_sim.scenario import load_scenario
    from hil_sim.sitl import start_sitl

    if lockstep and world and image is None:
        raise typer.BadParameter("--lockstep needs --no-world: the simulated world clocks the ticks")
    if commands and (image is not None or not world):
        raise typer.BadParameter("--commands needs the simulated world around QEMU: leave out --image and --no-world")
    scenario = load_scenario(scenario_name, robot, world_robot).with_seed(seed)
    links = link or [f"tcp:{host}:{port}"]
    try:
        with signals_interrupt():
            if end_with_stdin and (image is not None or not world):
                read_input(None, end_with_stdin)
            if image is not None:
                _image(
                    image,
                    scenario,
                    scenario_name if world else None,
                    world_robot,
                    links,
                    storage,
                    lockstep,
                    json_wanted,
                )
            if not world:
                _bare(links, scenario.robot.name, storage, lockstep, json_wanted, scenario.parameter_values())
            with start_sitl(scenario, links, storage=storage, emulated=True) as running:
                serve_world(running, scenario, json_wanted, commands=commands, end_with_stdin=end_with_stdin)
    except KeyboardInterrupt:
        return


def _image(
    image: Path,
    scenario: Scenario,
    world: str | None,
    world_robot: str | None,
    links: Sequence[str],
    storage: Path | None,
    lockstep: bool,
    json_wanted: bool,
) -> NoReturn:
    from hil_sim.image_firmware import ImageFirmware

    with ImageFirmware(
        image,
        scenario.robot.source,
        links=links,
        lockstep=lockstep,
        storage=storage,
        scenario=world,
        world_robot=world_robot,
        seed=scenario.seed,
    ) as firmware:
        what = scenario.description if world else "Without a world: the wheels stand still"
        announce(firmware.urls, scenario.robot.name, what, json_wanted)
        _wait_for_end(firmware)


def _bare(
    links: Sequence[str], name: str, storage: Path | None, lockstep: bool, json_wanted: bool, values: dict[str, float]
) -> NoReturn:
    from omniwheel.emulated_firmware import EmulatedFirmware

    with EmulatedFirmware(links=links, lockstep=lockstep, storage=storage, parameters=values) as firmware:
        announce(firmware.urls, name, "Without a world: the wheels stand still", json_wanted)
        _wait_for_end(firmware)
