# SPDX-License-Identifier: MIT
"""``omni sitl``: firmware and world in real time, for any MAVLink program."""

from __future__ import annotations

import _thread
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from io import UnsupportedOperation
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, NoReturn

import typer
from rich.markup import escape

from omni.cli import completion
from omni.cli.common import JsonOption, console, error_console, examples, print_json, signals_interrupt
from omni.cli.options import HostOption, ListenPortOption, LossOption, RadioOption
from omni.cli.run_output import (
    BoardOption,
    ImageOption,
    RobotOption,
    SeedOption,
    WorldOption,
    is_emulated,
    world_of,
)
from omniwheel.errors import FirmwareEndedError

if TYPE_CHECKING:
    from hil_sim.scenario import Scenario
    from hil_sim.sitl import SimulatedRadio, Sitl
    from omni.cli.sitl_commands import Commands
    from omniwheel.firmware_child import FirmwareChild
    from omniwheel.radio_model import RadioSettings

EXAMPLES = examples(
    "omni sitl",
    "omni sitl --robot four_wheel --port 5761",
    "omni sitl --host 0.0.0.0                # let other computers connect",
    "omni sitl --link pty:/tmp/robot         # a pseudo-terminal instead of TCP",
    "omni sitl --radio 9600 --loss 0.2 --latency 0.2     # a second port, behind a bad XBee",
    'omni sitl --commands                    # type lines like {"fault": "ice", "on": true} while it runs',
    "omni sitl fault_battery_sag             # another scenario's world and faults",
    "omni sitl --world mujoco                # MuJoCo in the place of our world",
    "omni sitl --board cortex-m7             # the firmware on an emulated Cortex-M7",
    "omni sitl --image firmware.elf          # the very image that is flashed, on an emulated Teensy 4.0",
    "omni sitl --image firmware.elf --link usb=pty:/tmp/teensy --link uart=tcp:127.0.0.1:5761",
    "omni sitl --no-world --lockstep         # the firmware alone, for a simulator of your own",
    "mavproxy.py --master=tcp:127.0.0.1:5760 --mav20",
)
POLL_S = 0.1
_STANDING = "No world: the wheels stand still, or an external simulator moves them"
_PROFILES = (9600, 57600, 115200)

ScenarioNameArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="Scenario with world, faults and parameters; its events are left out.",
        autocompletion=completion.scenarios,
    ),
]
WorldRobotOption = Annotated[
    str | None,
    typer.Option(
        "--world-robot",
        metavar="NAME|FILE",
        help="Robot to simulate, if different from the firmware's parameters: to practise `omni bringup`.",
        autocompletion=completion.robots,
    ),
]
LinksOption = Annotated[
    list[str] | None,
    typer.Option(
        "--link", metavar="LINK", help="Instead of --port: tcp:HOST:PORT, pty[:PATH], udp:HOST:PORT; repeatable."
    ),
]
StorageOption = Annotated[Path | None, typer.Option("--storage", metavar="FILE", help="File of the stored parameters.")]
EndWithStdinOption = Annotated[
    bool, typer.Option("--end-with-stdin", help="End once standard input is closed: for programs that start this.")
]
CommandsOption = Annotated[
    bool,
    typer.Option(
        "--commands",
        help='Take commands from standard input, a JSON object per line: {"fault": NAME, "wheel": N, "on": true}, '
        '{"mend": true}, {"speed": 0.5}.',
    ),
]


def sitl(
    scenario_name: ScenarioNameArgument = "sitl",
    robot: RobotOption = None,
    world_robot: WorldRobotOption = None,
    board: BoardOption = None,
    image: ImageOption = None,
    port: ListenPortOption = 5760,
    host: HostOption = "127.0.0.1",
    link: LinksOption = None,
    storage: StorageOption = None,
    radio: RadioOption = None,
    loss: LossOption = 0.0,
    latency: Annotated[
        float, typer.Option("--latency", min=0.0, metavar="S", help="The radio's one-way delay.")
    ] = 0.02,
    seed: SeedOption = None,
    end_with_stdin: EndWithStdinOption = False,
    commands: CommandsOption = False,
    world: WorldOption = None,
    no_world: Annotated[bool, typer.Option("--no-world", help="The firmware alone; its wheels stand still.")] = False,
    lockstep: Annotated[
        bool,
        typer.Option(
            "--lockstep",
            help="With --no-world: time stands still until your simulator sends sensor values (OMNI_HIL_SENSORS).",
        ),
    ] = False,
    json_wanted: JsonOption = False,
) -> None:
    """Run the firmware in a simulated world, in real time, until Ctrl-C: connect to it as to a robot.

    The firmware is a process on this computer. With --board cortex-m7 it runs on an emulated Cortex-M7 (QEMU); with
    --image it is the file that is flashed, on an emulated Teensy (Unicorn), the world is at its pins, and its own
    parameters hold. The image's links are the Teensy's connectors: usb=LINK (also without a name) and uart=LINK.

    A TCP port serves one client at a time; give --link more than once for several.

    With --commands you break and mend things while it runs; docs/guides/studio.md lists them. A line that is no
    command is answered on standard error and changes nothing.

    For a simulator of your own (--no-world --lockstep): docs/guides/external-worlds.md.
    """
    from hil_sim.scenario import load_scenario
    from hil_sim.sitl import start_sitl
    from omniwheel.radio_model import RadioSettings

    emulated = is_emulated(board, image)
    if no_world:
        _refuse(
            "--no-world runs the firmware alone", world=world, world_robot=world_robot, radio=radio, commands=commands
        )
    elif lockstep:
        raise typer.BadParameter("--lockstep needs --no-world: otherwise the simulated world clocks the ticks")
    if image is not None:
        _refuse("the world around an image cannot be changed", world=world, radio=radio, commands=commands)
    if emulated:
        _refuse("the emulated board has no radio", radio=radio)
    simulated = _simulated_radio(radio, RadioSettings(radio or 0, loss, latency), host, seed or 1, link)
    scenario = load_scenario(scenario_name, robot, world_robot).with_seed(seed)
    links = link or [f"tcp:{host}:{port}"]
    try:
        with signals_interrupt():
            if no_world or image is not None:
                if end_with_stdin:
                    read_input(None, True)
                around = None if no_world else scenario_name
                alone = _firmware_alone(emulated, image, scenario, links, storage, lockstep, around, world_robot)
                with alone as firmware:
                    what = _STANDING if no_world else scenario.description
                    announce(firmware.urls, scenario.robot.name, what, json_wanted)
                    wait_for_end(firmware)
            external = world_of(world, scenario, json_wanted)
            started = start_sitl(scenario, links, storage=storage, radio=simulated, world=external, emulated=emulated)
            with started as running:
                serve_world(running, scenario, json_wanted, commands=commands, end_with_stdin=end_with_stdin)
    except KeyboardInterrupt:
        return


def serve_world(
    running: Sitl, scenario: Scenario, json_wanted: bool, *, commands: bool, end_with_stdin: bool
) -> NoReturn:
    """Say where the robot is, and keep its world going until KeyboardInterrupt; apply_command commands if wanted."""
    from omni.cli.sitl_commands import Commands

    more = {"world": running.live.catalogue()} if commands else {}
    announce(running.urls, scenario.robot.name, scenario.description, json_wanted, more)
    if running.stopped:
        release = f"omni stop --release --link {running.urls[0]}"
        said = f"stopped since before the restart: nothing moves until you release it ({release})"
        error_console.print(said, soft_wrap=True)  # one line: the studio reads it
    obeyed = Commands(running.live, json_wanted) if commands else None
    if end_with_stdin or commands:
        read_input(obeyed, end_with_stdin)
    while True:
        running.advance()
        if obeyed is not None:
            obeyed.serve()


def read_input(commands: Commands | None, end_with_it: bool) -> None:
    """Read standard input in a thread of its own; its end is a KeyboardInterrupt if ``end_with_it``."""
    threading.Thread(target=_read_input, args=(commands, end_with_it), daemon=True).start()


def _refuse(reason: str, **options: object) -> None:
    """Raise BadParameter with the reason if one of the options is given; their names as in Python."""
    given = [f"--{name.replace('_', '-')}" for name, value in options.items() if value not in (None, False)]
    if given:
        raise typer.BadParameter(f"{reason}: leave out {' and '.join(given)}")


def _firmware_alone(
    emulated: bool,
    image: Path | None,
    scenario: Scenario,
    links: Sequence[str],
    storage: Path | None,
    lockstep: bool,
    around: str | None,
    world_robot: str | None,
) -> FirmwareChild:
    """Return a firmware that runs by itself: without a world, or an image with the scenario ``around`` at its pins."""
    from hil_sim.image_firmware import ImageFirmware
    from omniwheel.emulated_firmware import EmulatedFirmware
    from omniwheel.firmware_process import FirmwareProcess

    robot, values = scenario.robot.source, scenario.parameter_values()
    if image is not None:
        return ImageFirmware(
            image,
            robot,
            links=links,
            lockstep=lockstep,
            storage=storage,
            scenario=around,
            world_robot=world_robot,
            seed=scenario.seed,
        )
    kind = EmulatedFirmware if emulated else FirmwareProcess
    return kind(robot, links=links, lockstep=lockstep, storage=storage, parameters=values)


def wait_for_end(firmware: FirmwareChild) -> NoReturn:
    """Wait until Ctrl-C, or raise FirmwareEndedError when the firmware ends by itself."""
    while firmware.running:
        time.sleep(POLL_S)
    raise FirmwareEndedError(firmware.exit_code or 0, firmware.messages)


def _read_input(commands: Commands | None, end_with_it: bool) -> None:
    from omni.cli.sitl_commands import lines_of

    with _standard_input() as stream:
        for line in lines_of(stream):
            if commands is not None:
                commands.take(line)
    if end_with_it:
        _thread.interrupt_main()


def _standard_input() -> AbstractContextManager[BinaryIO]:
    """Not sys.stdin's own buffer: Python closes that at the program's end, and aborts if a thread still waits in it."""
    try:
        number = sys.stdin.fileno()
    except UnsupportedOperation:  # replaced by a buffer
        return nullcontext(sys.stdin.buffer)
    return open(number, "rb", buffering=0, closefd=False)


def _simulated_radio(
    baud: int | None, settings: RadioSettings, host: str, seed: int, links: list[str] | None
) -> SimulatedRadio | None:
    from hil_sim.sitl import SimulatedRadio

    if baud is None:
        return None
    if baud not in _PROFILES:
        raise typer.BadParameter(f"--radio {baud}: must be one of {', '.join(map(str, _PROFILES))} baud")
    if links and len(links) > 1:
        raise typer.BadParameter("--radio makes the second link itself: give --link once at most")
    return SimulatedRadio(settings, host, seed=seed)


def announce(
    urls: Sequence[str], robot: str, description: str, json_wanted: bool, more: Mapping[str, Any] | None = None
) -> None:
    """Say where the robot is to be found, in JSON with ``more``."""
    if json_wanted:
        print_json({"ready": True, "links": list(urls), "robot": robot, **(more or {})}, one_line=True)
    else:
        console.print(f"{escape(robot)} is running: connect to [bold]{'[/] or [bold]'.join(map(escape, urls))}[/]")
        console.print(f"{description}. Ctrl-C ends it.")
