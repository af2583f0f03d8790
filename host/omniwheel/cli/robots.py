# SPDX-License-Identifier: MIT
"""``omni robots``: the robot files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni_schema import Robot
from omniwheel.cli.common import JsonOption, console, examples, print_json
from omniwheel.parameter_file import format_value
from omniwheel.robots import find_robot_file, new_robot_file, read_robot, robot_names

app = typer.Typer(help="List, show, check and start robot files.", invoke_without_command=True)


def _summary(robot: Robot) -> dict[str, Any]:
    return {"name": robot.name, "description": robot.description, "wheels": robot.wheels, "file": robot.source}


@app.callback(epilog=examples("omni robots", "omni robots show three_wheel", "omni robots new mine --from three_wheel"))
def list_robots(ctx: typer.Context, as_json: JsonOption = False) -> None:
    """List the robots that come with omniwheel, or work with a robot file."""
    if ctx.invoked_subcommand is not None:
        return
    robots = [_summary(read_robot(name)) for name in robot_names()]
    if as_json:
        print_json({"robots": robots})
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("name", "wheels", "description"):
        table.add_column(title, style="cyan" if title == "name" else "")
    for robot in robots:
        table.add_row(robot["name"], str(robot["wheels"]), escape(robot["description"]))
    console.print(table)


@app.command("show", epilog=examples("omni robots show three_wheel", "omni robots show mine.toml --json"))
def show(name: Annotated[str, typer.Argument(help="A robot's name, or a file.")], as_json: JsonOption = False) -> None:
    """Show a robot file and what it sets."""
    robot = read_robot(name)
    if as_json:
        print_json({**_summary(robot), "parameters": robot.parameter_values(), "simulation": dict(robot.simulation)})
        return
    console.print(f"[bold]{robot.name}[/]  {escape(robot.description)}\n[dim]{escape(robot.source)}[/]")
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("parameter", "value", "unit", "meaning"):
        table.add_column(title, style="cyan" if title == "parameter" else "")
    for parameter_name, value in robot.overrides.items():
        info = robot.table[parameter_name]
        table.add_row(parameter_name, format_value(info, value), escape(info.unit), escape(info.doc))
    console.print(table)


@app.command("check", epilog=examples("omni robots check mine.toml"))
def check(file: Annotated[Path, typer.Argument(help="A robot file.")], as_json: JsonOption = False) -> None:
    """Check a robot file. Exit code 2: something in it is wrong, and the message says what is allowed."""
    robot = read_robot(file)
    if as_json:
        print_json({**_summary(robot), "ok": True})
    else:
        console.print(f"{file}: fine: {robot.name}, {robot.wheels} wheels, {len(robot.overrides)} parameters")


@app.command("new", epilog=examples("omni robots new mine --from three_wheel", "omni robots new mine --folder robots"))
def new(
    name: Annotated[str, typer.Argument(help="Name of the new robot: a-z 0-9 _.")],
    template: Annotated[str, typer.Option("--from", help="Robot to copy.")] = "three_wheel",
    folder: Annotated[Path, typer.Option("--folder", help="Where to write NAME.toml.")] = Path(),
    as_json: JsonOption = False,
) -> None:
    """Start a robot file of your own as a copy of another."""
    target = new_robot_file(name, template, folder)
    if as_json:
        print_json({"file": str(target), "from": str(find_robot_file(template))})
    else:
        console.print(f"{target} written; change its numbers, then: omni robots check {target}")
