# SPDX-License-Identifier: MIT
"""``omni runs``: the folders that drives and simulated runs have left."""

from __future__ import annotations

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

app = typer.Typer(help="List, compare, name and delete the folders of drives and runs.", invoke_without_command=True)

FolderOption = Annotated[Path, typer.Option("--folder", metavar="DIR", help="Folder of the runs.")]
RunArgument = Annotated[str, typer.Argument(metavar="RUN", help="A run's name, or its folder.")]
DEFAULT_FOLDER = Path("runs")


@app.callback(epilog=examples("omni runs", "omni runs --find rose", "omni runs compare demo-seed1 demo-seed1-2"))
def runs(
    ctx: typer.Context,
    find: Annotated[
        str, typer.Option("--find", metavar="TEXT", help="Show only runs with this text in their name or command.")
    ] = "",
    folder: FolderOption = DEFAULT_FOLDER,
    as_json: JsonOption = False,
) -> None:
    """List the runs in a folder, oldest first, or work with them."""
    from omniwheel.drive_log.listing import headline, list_runs

    if ctx.invoked_subcommand is not None:
        return
    entries = list_runs(folder, find)
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


@app.command("compare", epilog=examples("omni runs compare drive-pose drive-pose-2"))
def compare_runs(
    one: RunArgument, other: RunArgument, folder: FolderOption = DEFAULT_FOLDER, as_json: JsonOption = False
) -> None:
    """Show two runs beside each other, with the parameters that differ."""
    from omniwheel.drive_log.listing import cell, compare, different_parameters, find_run

    first, second = find_run(folder, one), find_run(folder, other)
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


@app.command("name", epilog=examples("omni runs name drive-pose-2 new-wheels"))
def name_run(
    run: RunArgument,
    name: Annotated[str, typer.Argument(help="Its new name.")],
    folder: FolderOption = DEFAULT_FOLDER,
    as_json: JsonOption = False,
) -> None:
    """Rename a run."""
    from omniwheel.drive_log.listing import find_run, rename_run

    target = rename_run(find_run(folder, run), name)
    if as_json:
        print_json({"folder": str(target)})
    else:
        console.print(escape(str(target)), soft_wrap=True)


@app.command("delete", epilog=examples("omni runs delete drive-pose-2", "omni runs delete drive-pose --yes"))
def delete(
    run: RunArgument,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Delete without confirmation.")] = False,
    folder: FolderOption = DEFAULT_FOLDER,
    as_json: JsonOption = False,
) -> None:
    """Delete a run with all its files."""
    from omniwheel.drive_log.listing import delete_run, find_run

    entry = find_run(folder, run)
    if not yes and not typer.confirm(f"delete {entry.folder} ({entry.asked})?", err=True):
        raise typer.Exit(1)
    delete_run(entry)
    if as_json:
        print_json({"deleted": str(entry.folder)})
    else:
        console.print(f"{escape(str(entry.folder))} deleted", soft_wrap=True)
