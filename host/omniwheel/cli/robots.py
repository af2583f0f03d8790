# SPDX-License-Identifier: MIT
"""``omni robots``: the robot files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni_schema import Robot
from omniwheel.cli import completion
from omniwheel.cli.common import JsonOption, console, examples, note, print_json
from omniwheel.parameter_file import format_value
from omniwheel.robots import find_robot_file, new_robot_file, read_robot, robot_names
from omniwheel.wiring import WiringPlan, connections, plan_wiring, write_wiring

app = typer.Typer(help="List, show, check and start robot files.", invoke_without_command=True)

RobotArgument = Annotated[
    str, typer.Argument(metavar="NAME|FILE", help="A robot's name, or a file.", autocompletion=completion.robots)
]


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
def show(name: RobotArgument, as_json: JsonOption = False) -> None:
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


@app.command("check", epilog=examples("omni robots check mine.toml", "omni robots check four_wheel"))
def check(name: RobotArgument, as_json: JsonOption = False) -> None:
    """Check a robot file, and warn of wiring that is unwise or that the firmware for a Teensy cannot be built with.

    Exit code 2: something in it is wrong, and the message says what is allowed.
    """
    robot = read_robot(name)
    warnings = plan_wiring(robot).warnings
    if as_json:
        print_json({**_summary(robot), "ok": True, "warnings": warnings})
    else:
        console.print(f"{name}: fine: {robot.name}, {robot.wheels} wheels, {len(robot.overrides)} parameters")
        _print_warnings(warnings)


@app.command("new", epilog=examples("omni robots new mine --from three_wheel", "omni robots new mine --folder robots"))
def new(
    name: Annotated[str, typer.Argument(help="Name of the new robot: a-z 0-9 _.")],
    template: Annotated[
        str, typer.Option("--from", help="Robot to copy.", autocompletion=completion.robots)
    ] = "three_wheel",
    folder: Annotated[Path, typer.Option("--folder", help="Where to write NAME.toml.")] = Path(),
    as_json: JsonOption = False,
) -> None:
    """Start a robot file of your own as a copy of another."""
    target = new_robot_file(name, template, folder)
    warnings = plan_wiring(read_robot(target)).warnings
    if as_json:
        print_json({"file": str(target), "from": str(find_robot_file(template)), "warnings": warnings})
    else:
        console.print(f"{target} written; change its numbers, then: omni robots check {target}")
        _print_warnings(warnings)


@app.command(
    "wiring",
    epilog=examples("omni robots wiring three_wheel", "omni robots wiring mine.toml --out wiring.svg"),
)
def wiring(
    name: RobotArgument,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.svg", dir_okay=False, help="Draw the wiring diagram there.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show what is wired to what, and what to mind; with --out, as a drawing to print and build from."""
    plan = plan_wiring(read_robot(name))
    if out is not None:
        if out.suffix.lower() != ".svg":
            raise typer.BadParameter(f"--out {out}: the drawing is an SVG file; give a name that ends in .svg")
        write_wiring(plan, out)
    if as_json:
        table = [vars(connection) for connection in connections(plan)]
        drawing = None if out is None else str(out)
        print_json({"name": plan.name, "connections": table, "warnings": plan.warnings, "drawing": drawing})
        return
    _print_wiring(plan)
    if out is not None:
        note(f"{out} written: open it in a browser, print it", quiet=False)


def _print_wiring(plan: WiringPlan) -> None:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("from", "to", "mind"):
        table.add_column(title, overflow="fold")
    for connection in connections(plan):
        table.add_row(escape(connection.start), escape(connection.end), escape(connection.mind))
    console.print(table)
    _print_warnings(plan.warnings)


def _print_warnings(warnings: Iterable[str]) -> None:
    for warning in warnings:
        console.print(f"[bold red]![/] {escape(warning)}")
