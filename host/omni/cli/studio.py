# SPDX-License-Identifier: MIT
"""``omni studio``: see and tune a robot in the browser."""

from __future__ import annotations

import socket
import webbrowser
from functools import cache
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from omni.cli import completion
from omni.cli.common import JsonOption, LinkOption, console, error_console, examples, print_json, signals_interrupt
from omni.cli.options import DEFAULT_OUT, HostOption, ListenPortOption, OutOption, OwnSeedOption
from omni.cli.run_output import RobotOption
from omniwheel.default_system import default_system
from omniwheel.errors import LinkOpenError, MissingPackageError

EXAMPLES = examples(
    "omni studio                             # choose a robot on the page",
    "omni studio sitl",
    "omni studio fast",
    "omni studio --link /dev/ttyACM0",
)
_VENDOR_FILES = ("uPlot.esm.js", "uPlot.min.css")


def studio(
    scenario: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENARIO]",
            help="Start a simulated robot in this scenario's world.",
            show_default=False,
            autocompletion=completion.scenarios,
        ),
    ] = None,
    link: LinkOption = None,
    robot: RobotOption = None,
    seed: OwnSeedOption = 1,
    port: ListenPortOption = 8420,
    host: HostOption = "127.0.0.1",
    out: OutOption = DEFAULT_OUT,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    json_wanted: JsonOption = False,
) -> None:
    """Show a page on which a robot is driven, plotted and tuned, until Ctrl-C.

    The page is for this computer only. With another --host, others reach it, and need the token in its address.
    """
    if link and scenario:
        raise typer.BadParameter("a scenario and --link exclude each other")
    vendor = _vendor_dir()
    try:
        from omni.studio.server import StudioServer, uvicorn_server
    except ModuleNotFoundError as error:
        hint = "pip install 'omniwheel[studio]', or in the source: make setup"
        raise MissingPackageError(f"this needs the package {error.name}, which is not installed", hint=hint) from error
    from hil_sim.scenario import load_scenario, scenario_names
    from omni.studio.access import Access
    from omni.studio.simulated import Simulation
    from omni.studio.studio import Studio

    listener = _listen(host, port)
    access = Access(host)
    model = Studio(out)
    scenarios = cache(lambda: {name: load_scenario(name).description for name in scenario_names()})
    server = StudioServer(model, access, vendor, scenarios)
    try:
        if scenario:
            load_scenario(scenario, robot)  # what is wrong with it is said here
            model.simulate(Simulation(scenario, robot, seed))
        elif link:
            model.connect(link, default_system())
        address = _address(listener, access.token)
        _announce(address, access.local, json_wanted)
        if browser:
            webbrowser.open(address)
        with signals_interrupt():
            uvicorn_server(server.app()).run(sockets=[listener])
    except KeyboardInterrupt:
        return
    finally:
        server.runs.close()
        model.close()
        listener.close()


def _vendor_dir() -> Path:
    import omni.studio

    folder = Path(omni.studio.__file__).parent / "vendor"
    if not all((folder / name).is_file() for name in _VENDOR_FILES):
        raise MissingPackageError(
            "the page's plots are not built", hint="in the source: make studio-page; else install a release's wheel"
        )
    return folder


def _listen(host: str, port: int) -> socket.socket:
    try:
        return socket.create_server((host, port))
    except OSError as error:
        raise LinkOpenError(
            f"cannot listen at {host}:{port}: {error.strerror or error}", hint="--port 0 picks a free port"
        ) from error


def _address(listener: socket.socket, token: str) -> str:
    host, port = listener.getsockname()[:2]
    name = f"[{host}]" if ":" in host else host
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")


def _announce(address: str, local: bool, json_wanted: bool) -> None:
    if not local:
        error_console.print(
            "[yellow]warning:[/] everyone with this address can drive the robot; the connection is not encrypted"
        )
    if json_wanted:
        print_json({"ready": True, "url": address}, one_line=True)
    else:
        console.print(f"The studio is at [bold]{escape(address)}[/]. Ctrl-C ends it.")
