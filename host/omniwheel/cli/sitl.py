# SPDX-License-Identifier: MIT
"""``omni sitl``: firmware and world in real time, for any MAVLink program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil_sim.scenario import load_scenario
from hil_sim.sitl import start_sitl
from omniwheel.cli.common import JsonOption, console, examples, print_json, signals_interrupt
from omniwheel.cli.run_output import SeedOption

EXAMPLES = examples(
    "omni sitl",
    "omni sitl --robot four_wheel --port 5761",
    "omni sitl --host 0.0.0.0                # let other computers connect",
    "omni sitl --link pty:/tmp/robot         # a pseudo-terminal instead of TCP",
    "omni sitl fault_battery_sag             # another scenario's world and faults",
    "mavproxy.py --master=tcp:127.0.0.1:5760 --mav20",
)


def sitl(
    scenario_name: Annotated[
        str, typer.Argument(metavar="SCENARIO", help="World, faults and parameters; its events are not played.")
    ] = "sitl",
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="NAME|FILE", help="The robot. [default: the scenario's]")
    ] = None,
    world_robot: Annotated[
        str | None,
        typer.Option(
            "--world-robot",
            metavar="NAME|FILE",
            help="The robot that is really there, if the firmware is to be wrong about it: to try `omni bringup`.",
        ),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="TCP port to listen on; 0 picks a free one.")
    ] = 5760,
    host: Annotated[str, typer.Option("--host", help="Address to listen on.")] = "127.0.0.1",
    link: Annotated[
        list[str] | None,
        typer.Option(
            "--link", metavar="LINK", help="Instead of --port: tcp:HOST:PORT, pty[:PATH], udp:HOST:PORT; repeatable."
        ),
    ] = None,
    storage: Annotated[
        Path | None, typer.Option("--storage", metavar="FILE", help="Keep stored parameters in this file.")
    ] = None,
    seed: SeedOption = None,
    json_wanted: JsonOption = False,
) -> None:
    """Run the firmware as a process in a simulated world, in real time, until Ctrl-C: connect to it as to a robot.

    A TCP port serves one client at a time; give --link more than once for several.
    """
    scenario = load_scenario(scenario_name, robot, world_robot).with_seed(seed)
    links = link or [f"tcp:{host}:{port}"]
    try:
        with signals_interrupt(), start_sitl(scenario, links, storage=storage) as running:
            if json_wanted:
                ready = {"ready": True, "links": list(running.urls), "robot": scenario.robot.name}
                print_json(ready, one_line=True)
            else:
                console.print(
                    f"{scenario.robot.name} is there: connect to [bold]{'[/] or [bold]'.join(running.urls)}[/]"
                )
                console.print(f"{scenario.description}. Ctrl-C ends it.")
            while True:
                running.advance()
    except KeyboardInterrupt:
        return
