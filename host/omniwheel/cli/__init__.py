# SPDX-License-Identifier: MIT
"""The ``omni`` command line: one module per command, thin over the API."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omniwheel import __version__
from omniwheel.cli import (
    bench,
    bringup,
    check_image,
    demo,
    doctor,
    drive,
    emulate,
    flash,
    hil,
    identify,
    legacy,
    logs,
    mocap,
    monitor,
    montecarlo,
    optimize,
    params,
    plot,
    radio,
    record,
    replay,
    reproduce,
    robots,
    sim,
    sitl,
    soak,
    sweep,
    tune,
)
from omniwheel.cli.common import OmniGroup, console, use_signing_key

app = typer.Typer(
    name="omni",
    cls=OmniGroup,
    help="Drive, tune and simulate omni-wheel robots.",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_show_locals=False,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        console.print(f"omniwheel {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    signing_key: Annotated[
        Path | None,
        typer.Option(
            "--signing-key",
            envvar="OMNI_SIGNING_KEY",
            metavar="FILE",
            help="Sign with the key in this file (omni radio key), as a robot's radio may want it. For every command "
            "that takes --link, at any place in the line.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Drive, tune and simulate omni-wheel robots."""
    use_signing_key(signing_key)


app.command("demo", epilog=demo.EXAMPLES)(demo.demo)
app.command("sitl", epilog=sitl.EXAMPLES)(sitl.sitl)
app.command("emulate", epilog=emulate.EXAMPLES)(emulate.emulate)
app.command("hil", epilog=hil.EXAMPLES)(hil.hil)
app.command("sim", epilog=sim.EXAMPLES)(sim.sim)
app.command("montecarlo", epilog=montecarlo.EXAMPLES)(montecarlo.montecarlo)
app.command("sweep", epilog=sweep.EXAMPLES)(sweep.sweep)
app.command("optimize", epilog=optimize.EXAMPLES)(optimize.optimize)
app.command("soak", epilog=soak.EXAMPLES)(soak.soak)
app.command("tune", epilog=tune.EXAMPLES)(tune.tune)
app.command("plot", epilog=plot.EXAMPLES)(plot.plot)
app.command("reproduce", epilog=reproduce.EXAMPLES)(reproduce.reproduce)
app.command("bench", epilog=bench.EXAMPLES)(bench.bench)
app.add_typer(params.app, name="params")
app.add_typer(drive.app, name="drive")
app.add_typer(legacy.app, name="legacy")
app.add_typer(mocap.app, name="mocap")
app.add_typer(radio.app, name="radio")
app.command("monitor", epilog=monitor.EXAMPLES)(monitor.monitor)
app.command("record", epilog=record.EXAMPLES)(record.record)
app.add_typer(logs.app, name="logs")
app.command("replay", epilog=replay.EXAMPLES)(replay.replay_command)
app.add_typer(robots.app, name="robots")
app.add_typer(bringup.app, name="bringup")
app.add_typer(identify.app, name="identify")
app.command("check-image", epilog=check_image.EXAMPLES)(check_image.check_image)
app.command("flash", epilog=flash.EXAMPLES)(flash.flash)
app.command("doctor", epilog=doctor.EXAMPLES)(doctor.doctor)


def main() -> None:
    """Run the command line."""
    app()
