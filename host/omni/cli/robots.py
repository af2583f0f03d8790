# SPDX-License-Identifier: MIT
"""``omni robots``: the robot files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli import completion, robots_new
from omni.cli.common import JsonOption, console, examples, new_path, note, print_json, redrawn_path
from omni.cli.options import ForceOption
from omni.cli.robots_new import print_warnings, warnings_of
from omni_schema import Robot
from omniwheel import files
from omniwheel.core_config import robot_config
from omniwheel.errors import RobotFileError
from omniwheel.parameter_file import format_value, shortest
from omniwheel.robots import read_robot, robot_names
from omniwheel.wiring import HEADING, WiringPlan, connections, plan_wiring, write_wiring

if TYPE_CHECKING:
    from omniwheel.capability import Card

app = typer.Typer(help="List, show, check and start robot files.", invoke_without_command=True)

app.command("new", epilog=robots_new.EXAMPLES)(robots_new.new)

RobotArgument = Annotated[
    str,
    typer.Argument(
        metavar="NAME|FILE", help="Name of a shipped robot, or a robot file.", autocompletion=completion.robots
    ),
]


def _summary(robot: Robot) -> dict[str, Any]:
    return {"name": robot.name, "description": robot.description, "wheels": robot.wheels, "file": robot.source}


@app.callback(
    epilog=examples("omni robots", "omni robots --motors", "omni robots show three_wheel", "omni robots --json")
)
def list_robots(
    ctx: typer.Context,
    motors: Annotated[
        bool,
        typer.Option("--motors", help="List the gear motors with known data sheets, for `omni robots new --motor`."),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """List the robots that come with omniwheel, or work with a robot file."""
    if ctx.invoked_subcommand is None:
        (robots_new.print_motors if motors else _print_robots)(as_json)


def _print_robots(as_json: bool) -> None:
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


@app.command(
    "show",
    epilog=examples(
        "omni robots show three_wheel", "omni robots show mine.toml --json", "omni robots show mine.toml --params"
    ),
)
def show(
    name: RobotArgument,
    all_params: Annotated[
        bool,
        typer.Option(
            "--params",
            help="Print all parameters that follow from the file, as NAME=VALUE lines for omni-firmware --params. "
            "Enums and switches are numbers; units are SI.",
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Show a robot file and the parameters that it sets."""
    robot = read_robot(name)
    if all_params:
        _print_params(robot, as_json)
        return
    if as_json:
        print_json({**_summary(robot), "parameters": robot.parameter_values(), "simulation": dict(robot.simulation)})
        return
    console.print(f"[bold]{escape(robot.name)}[/]  {escape(robot.description)}\n[dim]{escape(robot.source)}[/]")
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("parameter", "value", "unit", "meaning"):
        table.add_column(title, style="cyan" if title == "parameter" else "")
    for parameter_name, value in robot.overrides.items():
        info = robot.table[parameter_name]
        table.add_row(parameter_name, format_value(info, value), escape(info.unit), escape(info.doc))
    console.print(table)


def _print_params(robot: Robot, as_json: bool) -> None:
    values = robot.parameter_values()
    if as_json:
        print_json({"name": robot.name, "parameters": {key: shortest(value) for key, value in values.items()}})
        return
    for key, value in values.items():
        typer.echo(f"{key}={format_value(None, value)}")


@app.command(
    "export",
    epilog=examples(
        "omni robots export three_wheel three_wheel.urdf", "omni robots export four_wheel robot.xml --format mjcf"
    ),
)
def export(
    name: RobotArgument,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", dir_okay=False, help="The file to write.", show_default=False)
    ],
    wanted: Annotated[
        str | None,
        typer.Option("--format", metavar="urdf|sdf|proto|mjcf", help="File format. \\[default: by the file's suffix]"),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a robot's bodies for another simulator: chassis, wheels, and every roller with its hinge.

    URDF for ROS and many others, SDF for Gazebo, PROTO for Webots, MJCF for MuJoCo. Motors and their electronics are
    not included; docs/guides/external-worlds.md describes the simulator's interface to the firmware.
    """
    from hil_sim.models.export import FORMATS, missing_in

    chosen = wanted or file.suffix.removeprefix(".")
    if chosen not in FORMATS:
        asked = f"--format {wanted}" if wanted else str(file)
        raise typer.BadParameter(f"{asked}: give --format, one of {', '.join(FORMATS)}")
    robot = read_robot(name)
    new_path(file, "export", force=force)
    files.write_text(file, FORMATS[chosen](robot))
    missing = missing_in(robot, chosen)
    if as_json:
        print_json({"name": robot.name, "format": chosen, "file": str(file), "left_out": missing})
        return
    console.print(f"{escape(str(file))} written: {escape(robot.name)} as {chosen.upper()}")
    for sentence in missing:
        console.print(f"Left out: {sentence}.")


@app.command("check", epilog=examples("omni robots check mine.toml", "omni robots check four_wheel --plot speeds.png"))
def check(
    name: RobotArgument,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE.png", dir_okay=False, help="Save a plot of the top speed by direction to FILE."
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Check a robot file and show the robot's capability: speeds, accelerations, currents, and the limit of each.

    Warns of risky values. Exit code 2: a value is invalid; the message gives its range.
    """
    from omniwheel.capability import card, drive_model, problems
    from omniwheel.capability.picture import draw_speeds

    robot = read_robot(name)
    model = drive_model(robot)
    _refuse(robot, problems(model))
    robot_config(robot.parameter_values(), robot.table, 0)
    shown = card(model)
    warnings = [*warnings_of(robot, model), *_not_simulated(robot)]
    if plot is not None:
        draw_speeds(model, robot.name, _png(plot))
    if as_json:
        print_json({**_summary(robot), "ok": True, "warnings": warnings, **_card_json(shown)})
        return
    console.print(
        f"{escape(name)}: valid: {escape(robot.name)}, {robot.wheels} wheels, {len(robot.overrides)} parameters"
    )
    _print_card(shown)
    print_warnings(warnings)
    if plot is not None:
        note(f"{plot} written")


def _not_simulated(robot: Robot) -> list[str]:
    """Return why no simulated world can be made for this robot; a real one needs none."""
    from hil_sim.world import World, WorldError, world_config  # here, not above: the other commands need no world

    try:
        World(world_config(robot))
    except WorldError as error:
        return [f"It cannot be simulated: {error}. For omni run and omni sitl {error.hint or 'correct it'}."]
    return []


def _refuse(robot: Robot, found: list[str]) -> None:
    if found:
        raise RobotFileError(f"{robot.source}: " + "; ".join(found), hint="correct the file, then check it again")


def _png(path: Path) -> Path:
    if path.suffix.lower() != ".png":
        raise typer.BadParameter(f"--plot {path}: the picture is a PNG file; give a name that ends in .png")
    return redrawn_path(path, "--plot")


def _card_json(shown: Card) -> dict[str, Any]:
    rows = {row.key: {"value": row.value, "unit": row.unit, "limited_by": row.limited_by} for row in shown.rows}
    speeds = [
        {"angle_deg": 360.0 * k / len(shown.speeds), "m_s": b.value, "limited_by": b.cause}
        for k, b in enumerate(shown.speeds)
    ]
    return {"card": rows, "speed_by_direction": speeds, "sensors": list(shown.sensors)}


def _print_card(shown: Card) -> None:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("what it can do", "", "", "limited by"):
        table.add_column(title, justify="right" if title == "" else "left")
    for row in shown.rows:
        table.add_row(row.label, f"{row.value:.3g}", escape(row.unit), row.limited_by)
    console.print(table)
    for line in shown.sensors:
        console.print(f"[dim]{escape(line)}[/]")


@app.command(
    "wiring",
    epilog=examples("omni robots wiring three_wheel", "omni robots wiring mine.toml --out wiring.svg"),
)
def wiring(
    name: RobotArgument,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.svg", dir_okay=False, help="Save the wiring diagram to FILE.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Show the wiring as a table with warnings; with --out, as a drawing."""
    plan = plan_wiring(read_robot(name))
    if out is not None:
        if out.suffix.lower() != ".svg":
            raise typer.BadParameter(f"--out {out}: the drawing is an SVG file; give a name that ends in .svg")
        write_wiring(plan, redrawn_path(out, "--out"))
    if as_json:
        table = [vars(connection) for connection in connections(plan)]
        drawing = None if out is None else str(out)
        print_json({"name": plan.name, "connections": table, "warnings": plan.warnings, "drawing": drawing})
        return
    _print_wiring(plan)
    if out is not None:
        note(f"{escape(str(out))} written: open it in a browser, print it", quiet=False)


def _print_wiring(plan: WiringPlan) -> None:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("from", "to", HEADING):
        table.add_column(title, overflow="fold")
    for connection in connections(plan):
        table.add_row(escape(connection.start), escape(connection.end), escape(connection.note))
    console.print(table)
    print_warnings(plan.warnings)
