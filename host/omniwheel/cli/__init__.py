# SPDX-License-Identifier: MIT
"""The ``omni`` command line."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console

from omniwheel import __version__

console = Console()
app = typer.Typer(
    name="omni",
    help="Drive, tune and simulate omni-wheel robots.",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        console.print(f"omniwheel {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Drive, tune and simulate omni-wheel robots."""


def main() -> None:
    """Run the command line."""
    app()
