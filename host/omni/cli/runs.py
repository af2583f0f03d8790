# SPDX-License-Identifier: MIT
"""``omni runs``: the folders that drives and simulated runs have left."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.padding import Padding
from rich.table import Table

from omni.cli.common import JsonOption, console, examples, print_json
from omniwheel.parameter_file import format_value
from omniwheel.robots import parameter_table

if TYPE_CHECKING:
    from omniwheel.drive_log.listing import RunEntry

EXAMPLES = examples(
    "omni runs",
    "omni runs --find rose",
    "omni runs demo-seed1 demo-seed1-2            # beside each other",
    "omni runs drive-pose-2 --rename new-wheels",
    "omni runs drive-pose-2 --delete",
)

DEFAULT_FOLDER = Path("runs")


def runs(
    one: Annotated[
        str | None, typer.Argument(metavar="[RUN]", help="A run's name, or its folder.", show_default=False)
    ] = None,
    other: Annotated[
        str | None, typer.Argument(metavar="[OTHER]", help="A run to compare it with.", show_default=False)
    ] = None,
    find: Annotated[
        str, typer.Option("--find", metavar="TEXT", help="Show only runs with this text in their name or command.")
    ] = "",
    new_name: Annotated[
        str | None, typer.Option("--rename", metavar="NAME", help="Rename the run.", show_default=False)
    ] = None,
    deleted: Annotated[bool, typer.Option("--delete", help="Delete the run with all its files.")] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Delete without confirmation.")] = False,
    folder: Annotated[Path, typer.Option("--folder", metavar="DIR", help="Folder of the runs.")] = DEFAULT_FOLDER,
    as_json: JsonOption = False,
) -> None:
    """List the folders that drives and runs have left, oldest first, or show one of them.

    With two runs: show them beside each other, with the parameters that differ.
    """
    from omniwheel.drive_log.listing import find_run, list_runs

    _refuse_mixed(one, other, find, new_name, deleted=deleted, yes=yes)
    entry = None if one is None else find_run(folder, one)
    if entry is None:
        _list(list_runs(folder, find), folder, as_json)
    elif other is not None:
        _compare(entry, find_run(folder, other), as_json)
    elif new_name is not None:
        _rename(entry, new_name, as_json)
    elif deleted:
        _delete(entry, yes, as_json)
    else:
        _list([entry], folder, as_json)


def _refuse_mixed(
    one: str | None, other: str | None, find: str, new_name: str | None, *, deleted: bool, yes: bool
) -> None:
    """Raise BadParameter for options that do not belong together."""
    if one is None and (new_name is not None or deleted):
        raise typer.BadParameter("which run? Give its name; `omni runs` lists them")
    if sum((other is not None, new_name is not None, deleted)) > 1:
        raise typer.BadParameter("a second run, --rename and --delete exclude each other: give one of them")
    if one is not None and find:
        raise typer.BadParameter("--find is for the list: leave out the run, or --find")
    if yes and not deleted:
        raise typer.BadParameter("--yes is for --delete: leave it out")


def _list(entries: Sequence[RunEntry], folder: Path, as_json: bool) -> None:
    from omniwheel.drive_log.listing import headline

    if as_json:
        print_json({"runs": [_document(entry) for entry in entries]})
        return
    if not entries:
        console.print(f"no runs in {escape(str(folder))}", soft_wrap=True)
        return
    for entry in entries:
        console.print(f"[cyan]{escape(entry.name)}[/]", soft_wrap=True)  # a name is copied: it stays in one piece
        controller = f"controller {entry.controller}" if entry.controller else ""
        told = "; ".join(text for text in (entry.asked, controller, entry.end, ", ".join(headline(entry))) if text)
        console.print(Padding(escape(told), (0, 0, 0, 4)))


def _document(entry: RunEntry) -> dict[str, Any]:
    return {**asdict(entry), "folder": str(entry.folder), "name": entry.name}


def _compare(first: RunEntry, second: RunEntry, as_json: bool) -> None:
    from omniwheel.drive_log.listing import cell, compare, different_parameters

    rows, parameters = compare(first, second), different_parameters(first, second)
    if as_json:
        numbers = {title: [a, b] for title, a, b in rows}
        print_json({"runs": [first.name, second.name], "numbers": numbers, "parameters": parameters})
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("", "A", "B"):
        table.add_column(title, justify="right" if title else "left", no_wrap=True)
    for title, a, b in rows:
        table.add_row(escape(title), cell(a), cell(b))
    for letter, run in (("A", first), ("B", second)):
        console.print(f"{letter}: [cyan]{escape(run.name)}[/]", soft_wrap=True)
    known = parameter_table()
    for name, (a, b) in parameters.items():
        table.add_row(f"[cyan]{escape(name)}[/]", format_value(known.get(name), a), format_value(known.get(name), b))
    console.print(table)


def _rename(entry: RunEntry, name: str, as_json: bool) -> None:
    from omniwheel.drive_log.listing import rename_run

    target = rename_run(entry, name)
    if as_json:
        print_json({"folder": str(target)})
    else:
        console.print(escape(str(target)), soft_wrap=True)


def _delete(entry: RunEntry, yes: bool, as_json: bool) -> None:
    from omniwheel.drive_log.listing import delete_run

    if not yes and not typer.confirm(f"delete {entry.folder} ({entry.asked})?", err=True):
        raise typer.Exit(1)
    delete_run(entry)
    if as_json:
        print_json({"deleted": str(entry.folder)})
    else:
        console.print(f"{escape(str(entry.folder))} deleted", soft_wrap=True)
