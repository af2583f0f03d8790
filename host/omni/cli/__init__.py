# SPDX-License-Identifier: MIT
"""The ``omni`` command line: one module per command, thin over the API, listed in ``command_table``."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Annotated

import typer

from omni.cli.group import OmniGroup
from omniwheel.default_key import set_default_key
from omniwheel.default_system import LAST_SYSTEM, set_default_system

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
        from importlib.metadata import version  # it takes long to import

        from omni.cli.common import console
        from omniwheel.build_record import load_record

        record = load_record()
        own = (
            f", controller {record.controller} from {record.controller_folder}" if record and record.controller else ""
        )
        console.print(f"omniwheel {version('omniwheel')}{own}", markup=False, soft_wrap=True)
        raise typer.Exit


@app.callback()
def _options(
    ctx: typer.Context,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    signing_key: Annotated[
        Path | None,
        typer.Option(
            "--signing-key",
            envvar="OMNI_SIGNING_KEY",
            metavar="FILE",
            help="Sign messages with the key in this file (see omni radio); needed if the robot's radio has a "
            "key. For every command "
            "that takes --link, at any place in the line.",
            show_default=False,
        ),
    ] = None,
    system: Annotated[
        int | None,
        typer.Option(
            "--system",
            envvar="OMNI_SYSTEM",
            metavar="N",
            min=1,
            max=LAST_SYSTEM,
            help="The robot's system id (SYS_ID), where several robots share one link. For every command that takes "
            "--link, at any place in the line.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Drive, tune and simulate omni-wheel robots."""
    key = None
    if signing_key is not None:
        from omniwheel.signing import read_key_file

        key = read_key_file(signing_key)
    set_default_key(key)
    set_default_system(system)
    ctx.call_on_close(lambda: set_default_system(None))


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal or file that lacks a character shows another one for it
            stream.reconfigure(errors="replace")
    app()
