# SPDX-License-Identifier: MIT
"""``omni params undo``: back to an earlier state of a robot's parameters; with ``--history``, what was changed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli.common import (
    WhyOption,
    console,
    examples,
    print_json,
    record_history,
)
from omni.cli.options import takes
from omni.cli.params_output import StoreOption, print_changes, store_in_flash
from omni.cli.robot_options import RobotOptions
from omniwheel.errors import HistoryError
from omniwheel.parameter_file import format_value, shortest
from omniwheel.robots import parameter_table

if TYPE_CHECKING:
    from omniwheel.history import Entry, RobotHistory

UNDO_EXAMPLES = examples("omni params undo --history", "omni params undo", "omni params undo 3 --store")


def _print_history(kept: RobotHistory, as_json: bool) -> None:
    entries = kept.entries()
    if as_json:
        print_json(
            {"file": None if kept.path is None else str(kept.path), "entries": [_document(entry) for entry in entries]}
        )
    elif not entries:
        console.print("the history is empty")
    else:
        console.print(_table(entries))


def _document(entry: Entry) -> dict[str, Any]:
    return {
        "number": entry.number,
        "time": entry.time,
        "who": entry.who,
        "command": entry.command,
        "why": entry.why,
        "changes": {name: [shortest(value) for value in pair] for name, pair in entry.changes.items()},
        "stored": entry.stored,
        "figures": {name: list(pair) for name, pair in entry.figures.items()},
    }


def _table(entries: list[Entry]) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("", justify="right", style="bold")
    table.add_column("when (UTC), who", no_wrap=True)
    table.add_column("change", overflow="fold")
    table.add_column("command, why", overflow="fold", style="dim")
    known = parameter_table()
    for entry in entries:
        changes = [
            f"[cyan]{escape(name)}[/] {format_value(known.get(name), before)} → {format_value(known.get(name), after)}"
            for name, (before, after) in entry.changes.items()
        ]
        if entry.stored:
            changes.append("stored on the robot")
        when = entry.time[:16].replace("T", " ")
        said = [escape(entry.command), *([f"[bold]{escape(entry.why)}[/]"] if entry.why else [])]
        table.add_row(str(entry.number), f"{when}\n{escape(entry.who)}", "\n".join(changes), "\n".join(said))
    return table


@takes(RobotOptions)
def undo(
    number: Annotated[
        int | None,
        typer.Argument(help="Number of the history entry to undo. Default: the last one.", show_default=False),
    ] = None,
    list_only: Annotated[
        bool, typer.Option("--history", help="List the changes instead: when, by whom, how and why.")
    ] = False,
    store: StoreOption = False,
    why: WhyOption = "",
    *,
    wanted: RobotOptions,
) -> None:
    """Set what was changed back to what it was before an entry of the history, all or none.

    The history holds what commands on this computer changed on the robot. This works after a restart of the robot, too.
    It is an entry of its own: undo again to take it back. A robot is known by its board's serial number; a simulated
    one, which has none, by its link.
    """
    from omniwheel.history import history_of

    with wanted.open() as robot:
        kept = history_of(robot)
        if list_only:
            _print_history(kept, wanted.as_json)
            return
        entries = kept.entries()
        if not entries:
            raise HistoryError("the history is empty: nothing to undo")
        earlier = kept.before(len(entries) if number is None else number)
        record_history(robot, why or f"undo {len(entries) if number is None else number}")
        old = {name: robot.parameters.read(name) for name in earlier}
        robot.parameters.set_many(earlier)
        store_in_flash(robot, store, wanted.as_json)
        changes = {name: (old[name], robot.parameters[name]) for name in earlier if old[name] != earlier[name]}
        print_changes(robot.parameters, changes, "before", "after", wanted.as_json)
