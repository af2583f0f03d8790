# SPDX-License-Identifier: MIT
"""Options that commands of several modules share: each has its name, its words and its range here, once.

Options of all commands that talk to a robot are in ``common``. Those of scenarios are in ``run_output``, of studies in
``study_output``, and of logs in ``log_options``. ``tests/structure`` finds what is declared twice.
"""

from __future__ import annotations

import enum
import inspect
from collections.abc import Callable, Collection
from dataclasses import fields
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from omni.cli import completion

LARGEST_SEED = 2**63 - 1
LEAST_BAUD = 1200


class Axis(str, enum.Enum):
    """An axis of the world."""

    X = "x"
    Y = "y"
    THETA = "theta"


AxisOption = Annotated[Axis, typer.Option("--axis", help="Axis of the world frame.")]


def seed_option(words: str) -> Any:
    """Return the option of a seed. Its upper limit of 19 digits is checked, but not shown."""
    return typer.Option("--seed", min=0, metavar="N", callback=_possible_seed, help=words)


def _possible_seed(seed: int | None) -> int | None:
    if seed is not None and seed > LARGEST_SEED:
        raise typer.BadParameter(f"{seed} must be at most {LARGEST_SEED}")
    return seed


OwnSeedOption = Annotated[int, seed_option("Random seed.")]
SOURCE = typer.Option(
    "--source", metavar="STREAM", help="vicon: or natnet:HOST/OBJECT, camera:FILE, recorded:FILE, simulated."
)
SourceOption = Annotated[str, SOURCE]
ForceOption = Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")]
BaudOption = Annotated[int, typer.Option("--baud", min=LEAST_BAUD, help="Baud rate of the radio.")]
ListenPortOption = Annotated[
    int, typer.Option("--port", min=0, max=65535, help="TCP port to listen on; 0 picks a free one.")
]
HostOption = Annotated[str, typer.Option("--host", help="Address to listen on.")]
RobotFolderOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for NAME.toml.")]
ListOption = Annotated[bool, typer.Option("--list", help="List the choices and exit.")]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Parent of the new results folder.")]
DEFAULT_OUT = Path("runs")
NameOption = Annotated[str, typer.Option("--name", metavar="NAME", help="Name of the new robot: NAME.toml.")]
RoomOption = Annotated[
    float, typer.Option("--room", min=0.1, max=20.0, metavar="M", help="Side of the free square around the robot.")
]
LiftedOption = Annotated[bool, typer.Option("--wheels-up", help="The wheels are lifted and carry no load.")]
KEEP = typer.Option(
    "--keep/--revert", help="Keep the new values, or restore the old ones. Default: as described above."
)
PLOT = typer.Option("--plot", metavar="FILE.png", help="Save the plot to FILE.")
XBEE = typer.Option(
    "--link",
    "-l",
    metavar="URL",
    help="The XBee: /dev/ttyUSB0, COM3 or tcp:HOST:PORT.",
    autocompletion=completion.ports,
)


RadioOption = Annotated[
    int | None,
    typer.Option(
        "--radio",
        metavar="BAUD",
        help="A simulated XBee of this speed: 9600, 57600 or 115200.",
        show_default=False,
    ),
]
LossOption = Annotated[
    float, typer.Option("--loss", min=0.0, max=1.0, help="Fraction of the radio's packets that are lost, 0 to 1.")
]
ASSIGNMENTS = typer.Option(
    "--set",
    metavar="NAME=VALUE",
    help="Change a parameter; repeatable.",
    autocompletion=completion.assignments,
)


def page_option(metavar: str, **checks: Any) -> Any:
    """Return the option of where a page with results goes: a file or a folder, as ``metavar`` says."""
    return typer.Option("--out", metavar=metavar, help="File for the report.", **checks)


def simulated_time_option(least_s: float, most_s: float) -> Any:
    """Return the option of how long a run is to take in the simulated world."""
    words = ("--duration", "-d", "--seconds")
    return typer.Option(*words, min=least_s, max=most_s, metavar="S", help="Simulated time of each run.")


def rounds_option(least: int) -> Any:
    """Return the option of how often old and new values are tried, from ``least``."""
    return typer.Option(
        "--rounds",
        min=least,
        max=100,
        metavar="N",
        help="Rounds per set. With 2 or more each metric gets a significance verdict.",
    )


def stop_after_option(least_s: float, show_default: bool | str = True) -> Any:
    """Return the option of when a drive ends at the latest, from ``least_s``; ``show_default`` may be words."""
    return typer.Option(
        "--duration",
        "-d",
        "--for",
        min=least_s,
        metavar="S",
        help="Time limit.",
        show_default=show_default,
    )


def takes(kind: type[Any], **defaults: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the options that a dataclass lists: a field each, with its default or the one of ``defaults``.

    The command gets them as one object, its parameter ``wanted``; other parameters of it stay arguments and options.
    """
    hints = get_type_hints(kind, include_extras=True)
    names = [field.name for field in fields(kind)]
    shared = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=defaults.get(field.name, field.default),
            annotation=hints[field.name],
        )
        for field in fields(kind)
    ]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def flat(**given: Any) -> None:
            wanted = kind(**{name: given.pop(name) for name in names})
            command(**given, wanted=wanted)

        own_hints = get_type_hints(command, include_extras=True)
        own = [
            parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=own_hints[name])
            for name, parameter in inspect.signature(command).parameters.items()
            if name != "wanted"
        ]
        flat.__signature__ = inspect.Signature([*own, *shared])  # type: ignore[attr-defined]
        flat.__annotations__ = {parameter.name: parameter.annotation for parameter in (*own, *shared)}
        return flat

    return decorate


def refuse_unused(ctx: typer.Context, chosen: str, used: Collection[str], special: Collection[str]) -> None:
    """Raise BadParameter for an option in the command line that ``chosen`` does not have.

    ``special`` are the options, by the names of their parameters, that only some choices have; ``used`` those of
    ``chosen``.
    """
    for parameter in ctx.command.params:
        name = parameter.name or ""
        source = ctx.get_parameter_source(name)
        if name in special and name not in used and source is not None and source.name == "COMMANDLINE":
            raise typer.BadParameter(f"{parameter.opts[0]} does not apply to {chosen}: leave it out")


def measure_option(least_s: float) -> Any:
    """Return the option of a command that measures for a while, at least ``least_s``."""
    return typer.Option("--duration", "-d", "--for", min=least_s, metavar="S", help="Duration of the measurement.")
