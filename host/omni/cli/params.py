# SPDX-License-Identifier: MIT
"""``omni params``: the parameters of a connected robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.padding import Padding
from rich.progress import Progress
from rich.table import Table

from omni.cli import completion, params_history
from omni.cli.common import (
    WhyOption,
    console,
    error_console,
    examples,
    new_path,
    note,
    parse_assignments,
    print_json,
    record_history,
)
from omni.cli.options import ForceOption, takes
from omni.cli.params_output import StoreOption, print_changes, store_in_flash
from omni.cli.robot_options import RobotOptions
from omni_schema import Parameter, ParameterTable
from omni_schema.errors import did_you_mean
from omniwheel import parameter_file
from omniwheel.errors import UnknownParameterError
from omniwheel.parameter_file import format_value, shortest
from omniwheel.presets import Preset, find_parameter_file, preset_names, read_preset
from omniwheel.robots import is_robot_file, parameter_table, read_robot, robot_names

if TYPE_CHECKING:
    from omniwheel.parameters import Parameters
    from omniwheel.robot import Robot

app = typer.Typer(help="Read, set, save and compare the robot's parameters.", no_args_is_help=True)

app.command("undo", epilog=params_history.UNDO_EXAMPLES)(params_history.undo)
_LINK = "--link tcp:127.0.0.1:5760"


def _download(robot: Robot, quiet: bool) -> dict[str, float]:
    with Progress(console=error_console, transient=True, disable=quiet) as progress:
        task = progress.add_task("parameters", total=None)
        return robot.parameters.download(lambda done, total: progress.update(task, completed=done, total=total))


def _described(parameters: Parameters, name: str, value: float) -> dict[str, Any]:
    info = parameters.info(name)
    known = {} if info is None else _description(info)
    return {"value": shortest(value), **known}


def _description(info: Parameter) -> dict[str, Any]:
    return {
        "unit": info.unit,
        "min": shortest(info.minimum),
        "max": shortest(info.maximum),
        "default": shortest(info.default),
        "values": dict(info.values),
        "doc": info.doc,
    }


def _row(parameters: Parameters, name: str, value: float) -> list[str]:
    """Return name, value, unit, what is allowed, default, meaning; a value that is not the default is bold."""
    info = parameters.info(name)
    if info is None:
        return [name, format_value(None, value), "", "", "", "unknown to this version of omniwheel"]
    allowed = ", ".join(info.values) or f"{info.shown(info.minimum)} … {info.shown(info.maximum)}"
    shown = format_value(info, value)
    return [
        name,
        f"[bold]{shown}[/]" if value != info.default else shown,
        escape(info.unit),
        allowed,
        format_value(info, info.default),
        escape(info.doc),
    ]


def _print_short(rows: Sequence[Sequence[str]]) -> None:
    table = Table(box=None, header_style="bold", pad_edge=False, collapse_padding=True)
    for title, style in (("name", "cyan"), ("value", ""), ("unit", "dim"), ("allowed", "dim"), ("default", "dim")):
        table.add_column(title, style=style, no_wrap=title != "allowed")
    for row in rows:
        table.add_row(*row[:5])
    console.print(table)


def _print_long(rows: Sequence[Sequence[str]]) -> None:
    for name, value, unit, allowed, default, meaning in rows:
        console.print(f"[cyan]{escape(name)}[/] = {value} {unit}".rstrip())
        if allowed:
            console.print(Padding(f"[dim]allowed: {allowed}; default: {default}[/]", (0, 0, 0, 4)))
        console.print(Padding(meaning, (0, 0, 0, 4)))


@app.command(
    "list",
    epilog=examples(
        f"omni params list {_LINK}",
        "omni params list ISMC --long",
        "omni params list WHEELS TRJ_TYPE --json",
        "omni params list --presets",
        "omni params list --presets report_ismc",
    ),
)
@takes(RobotOptions)
def list_parameters(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME|TEXT]...",
            help="Show these parameters, or all whose names contain a text; with --presets, these presets.",
            autocompletion=completion.parameters,
            show_default=False,
        ),
    ] = None,
    long: Annotated[bool, typer.Option("--long", help="Show descriptions too.")] = False,
    presets: Annotated[
        bool,
        typer.Option(
            "--presets", help="List the sets of gains that come with omniwheel; `omni params load NAME` sets one."
        ),
    ] = False,
    *,
    wanted: RobotOptions,
) -> None:
    """Show parameters with unit, range and default; values that differ from the default are bold.

    Names alone are read one by one, which is quick on a slow radio.
    """
    if presets:
        _print_presets(names or [], wanted.as_json)
        return
    asked = [name.upper() for name in names or []]
    with wanted.open() as robot:
        if asked and all(name in robot.table for name in asked):
            values = {name: robot.parameters[name] for name in asked}
        else:
            values = _found(_download(robot, wanted.as_json), asked)
        if wanted.as_json:
            print_json({name: _described(robot.parameters, name, value) for name, value in values.items()})
        else:
            rows = [_row(robot.parameters, name, value) for name, value in values.items()]
            (_print_long if long else _print_short)(rows)


def _found(known: Mapping[str, float], asked: Sequence[str]) -> dict[str, float]:
    """Return the parameters whose names are one of those asked for, or contain one of them; all if there are none."""
    for text in asked:
        if not any(text in name for name in known):
            hint = "`omni params list` shows all"
            raise UnknownParameterError(f"no parameter's name contains {text}{did_you_mean(text, known)}", hint=hint)

    def is_asked(name: str) -> bool:
        return any(name == text if text in known else text in name for text in asked)

    return {name: value for name, value in known.items() if not asked or is_asked(name)}


@app.command(
    "set", epilog=examples("omni params set ISMC_LAM_XY=15 ISMC_LAM_TH=15", "omni params set CTL_MODE=pid --store")
)
@takes(RobotOptions)
def set_parameters(
    assignments: Annotated[
        list[str],
        typer.Argument(
            metavar="NAME=VALUE...",
            help="All are set, or none, unless the link is lost.",
            autocompletion=completion.assignments,
        ),
    ],
    store: StoreOption = False,
    why: WhyOption = "",
    *,
    wanted: RobotOptions,
) -> None:
    """Set parameters and wait until the robot has confirmed each.

    Exit code 1: one was refused, and the others have their old values again; or the link was lost, and the message says
    which ones were set.
    """
    from omniwheel.parameters import checked_value

    values = parse_assignments(assignments)
    table = parameter_table()
    for name, value in values.items():
        checked_value(table, name, value)
    with wanted.open() as robot:
        record_history(robot, why)
        old = {name: robot.parameters[name] for name in values}
        robot.parameters.set_many(values)
        store_in_flash(robot, store, wanted.as_json)
        changes = {name: (old[name], robot.parameters[name]) for name in values}
        print_changes(robot.parameters, changes, "before", "after", wanted.as_json)


@app.command("save", epilog=examples("omni params save mine.toml", f"omni params save mine.toml {_LINK}"))
@takes(RobotOptions)
def save(
    file: Annotated[Path, typer.Argument(help="TOML file to write.")],
    force: ForceOption = False,
    *,
    wanted: RobotOptions,
) -> None:
    """Save all parameters as a commented TOML file."""
    new_path(file, "save", force=force)
    with wanted.open() as robot:
        values = _download(robot, wanted.as_json)
        robot.parameters.save(file)
    if wanted.as_json:
        print_json({"file": str(file), "parameters": len(values)})
    else:
        console.print(f"{len(values)} parameters saved to {escape(str(file))}")


@app.command("load", epilog=examples("omni params load mine.toml --store", "omni params load report_torque"))
@takes(RobotOptions)
def load(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE|PRESET",
            help="TOML file with a table \\[parameters], or a preset's name.",
            autocompletion=completion.presets,
        ),
    ],
    store: StoreOption = False,
    other_robot: Annotated[
        bool,
        typer.Option(
            "--other-robot", help="Also set wheels, geometry and wiring, even if they differ from the robot's."
        ),
    ] = False,
    why: WhyOption = "",
    *,
    wanted: RobotOptions,
) -> None:
    """Set the parameters of a file or preset, all or none, and show what changed.

    Exit code 1: the file's wheels, geometry or wiring differ from the robot's; they are listed, and nothing is set.

    The robot keeps its system id, SYS_ID. `omni params set SYS_ID=2` changes it.
    """
    from omniwheel.parameters import SYSTEM

    path = find_parameter_file(file)
    system = parameter_file.read(path, parameter_table()).get(SYSTEM)
    with wanted.open() as robot:
        record_history(robot, why)
        _download(robot, wanted.as_json)
        changes = robot.parameters.load(path, force=other_robot)
        if system not in (None, robot.parameters[SYSTEM]):
            note(
                f"the robot keeps {SYSTEM} {robot.parameters[SYSTEM]:g}; "
                f"`omni params set {SYSTEM}={system:g}` sets the file's",
                quiet=wanted.as_json,
            )
        store_in_flash(robot, store, wanted.as_json)
        print_changes(robot.parameters, changes, "before", "after", wanted.as_json)


def _print_presets(names: Sequence[str], as_json: bool) -> None:
    table = parameter_table()
    chosen = [read_preset(entry, table) for entry in (names or preset_names())]
    if as_json:
        print_json({"presets": [_preset_facts(preset, with_values=bool(names)) for preset in chosen]})
        return
    shown = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("parameter", "value", "unit", "meaning") if names else ("preset", "description", "from"):
        first = title in ("preset", "parameter")
        shown.add_column(title, style="cyan" if first else "", no_wrap=first)
    for preset in chosen:
        if not names:
            shown.add_row(preset.name, escape(preset.description), escape(preset.source))
            continue
        console.print(f"[bold]{escape(preset.name)}[/]  {escape(preset.description)}\n[dim]{escape(preset.source)}[/]")
        for key, value in preset.parameters.items():
            shown.add_row(key, format_value(table[key], value), escape(table[key].unit), escape(table[key].doc))
    console.print(shown)


def _preset_facts(preset: Preset, with_values: bool) -> dict[str, Any]:
    facts: dict[str, Any] = {"name": preset.name, "description": preset.description, "source": preset.source}
    if with_values:
        facts["parameters"] = {key: shortest(value) for key, value in preset.parameters.items()}
    return facts


def _compared(name: str | None, table: ParameterTable) -> tuple[Mapping[str, float], str]:
    """Return the parameters to compare with, and what they are: a robot's, a file's or a preset's, or the defaults."""
    if name is None:
        return table.defaults(), "the defaults of params.toml"
    if name in robot_names() or is_robot_file(name):
        robot = read_robot(name)
        return robot.parameter_values(), f"the robot file {name}"
    return parameter_file.read(find_parameter_file(name), table), name


@app.command("diff", epilog=examples("omni params diff three_wheel", "omni params diff mine.toml", "omni params diff"))
@takes(RobotOptions)
def diff(
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROBOT|FILE|PRESET]",
            help="Robot or robot file, parameter file, or preset; without it, the defaults of params.toml.",
            autocompletion=completion.robots,
        ),
    ] = None,
    *,
    wanted: RobotOptions,
) -> None:
    """Show where the robot differs from its robot file, another file, or the defaults (robot → file).

    A robot file overrides some defaults: compare a robot with its file to see what was tuned. Exit code 1: it differs.
    """
    other, what = _compared(file, parameter_table())
    note(f"compared with {what}", quiet=wanted.as_json)
    with wanted.open() as robot:
        _download(robot, wanted.as_json)
        changes = robot.parameters.diff(other)
        print_changes(robot.parameters, changes, "robot", "file" if file else "default", wanted.as_json)
    if changes:
        raise typer.Exit(1)


@app.command("reset", epilog=examples("omni params reset --store", "omni params reset ISMC_LAM_XY"))
@takes(RobotOptions)
def reset(
    names: Annotated[list[str] | None, typer.Argument(help="Reset only these, to the defaults of params.toml.")] = None,
    store: StoreOption = False,
    why: WhyOption = "",
    *,
    wanted: RobotOptions,
) -> None:
    """Set all parameters back to the robot's own file, or the named ones to their defaults.

    The robot keeps its system id, SYS_ID, unless it is named.
    """
    with wanted.open() as robot:
        record_history(robot, why)
        before = _download(robot, wanted.as_json)
        if names:
            robot.parameters.set_many({name: _default(robot, name) for name in map(str.upper, names)})
        else:
            robot.reset_parameters()
        after = _download(robot, wanted.as_json)
        changes = {name: (before[name], after[name]) for name in after if before.get(name) != after[name]}
        if not names:
            robot.parameters.report_changes(changes)
        store_in_flash(robot, store, wanted.as_json)
        print_changes(robot.parameters, changes, "before", "after", wanted.as_json)


def _default(robot: Robot, name: str) -> float:
    from omniwheel.parameters import unknown_parameter

    info = robot.parameters.info(name)
    if info is None:
        raise unknown_parameter(name, robot.parameters.table)
    return info.default
