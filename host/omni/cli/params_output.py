# SPDX-License-Identifier: MIT
"""What the commands below ``omni params`` share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from omni.cli.common import console, note, print_json
from omniwheel.parameter_file import format_value, shortest

if TYPE_CHECKING:
    from omniwheel.parameters import Parameters
    from omniwheel.robot import Robot

Changes = Mapping[str, tuple[float, float]]
StoreOption = Annotated[
    bool, typer.Option("--store", help="Store the change in the robot's flash (only while disarmed).")
]


def print_changes(parameters: Parameters, changes: Changes, before: str, after: str, as_json: bool) -> None:
    """Show changes {name: (one value, other value)}; ``before`` and ``after`` are their names in JSON."""
    if as_json:
        print_json({name: {before: shortest(old), after: shortest(new)} for name, (old, new) in changes.items()})
        return
    if not changes:
        console.print("no difference")
    for name, (old, new) in changes.items():
        info = parameters.info(name)
        console.print(f"[cyan]{escape(name)}[/]  {format_value(info, old)} → [bold]{format_value(info, new)}[/]")


def store_in_flash(robot: Robot, wanted: bool, quiet: bool) -> None:
    """Have the robot store its parameters if that is wanted."""
    if wanted:
        robot.store()
        note("stored", quiet=quiet)
