# SPDX-License-Identifier: MIT
"""``omni params``: the parameters of a connected robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from omni_schema import Parameter, ParameterTable
from omniwheel import parameter_file
from omniwheel.cli import completion
from omniwheel.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    error_console,
    examples,
    note,
    open_robot,
    parse_assignments,
    print_json,
    writable_path,
)
from omniwheel.errors import UnknownParameterError
from omniwheel.parameter_file import format_value, shortest
from omniwheel.parameters import Parameters, checked_value
from omniwheel.presets import Preset, find_parameter_file, preset_names, read_preset
from omniwheel.robot import DEFAULT_TIMEOUT_S, Robot
from omniwheel.robots import is_robot_file, parameter_table, read_robot, robot_names

app = typer.Typer(help="Read, set, save and compare the robot's parameters.", no_args_is_help=True)

Changes = Mapping[str, tuple[float, float]]
StoreOption = Annotated[bool, typer.Option("--store", help="Keep the change over a restart (only while disarmed).")]
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
    info = parameters.info(name)
    if info is None:
        return [name, format_value(None, value), "", "", "", "unknown to this version of omniwheel"]
    allowed = ", ".join(info.values) or f"{info.minimum:.7g} … {info.maximum:.7g}"
    shown = format_value(info, value)
    changed = value != info.default
    return [
        name,
        f"[bold]{shown}[/]" if changed else shown,
        escape(info.unit),
        allowed,
        format_value(info, info.default),
        escape(info.doc),
    ]


def _table(parameters: Parameters, values: Mapping[str, float]) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title, style in (("name", "cyan"), ("value", ""), ("unit", "dim"), ("allowed", "dim"), ("default", "dim")):
        table.add_column(title, style=style, no_wrap=title in ("name", "value"))
    table.add_column("meaning", overflow="fold")
    for name, value in values.items():
        table.add_row(*_row(parameters, name, value))
    return table


def _print_changes(parameters: Parameters, changes: Changes, before: str, after: str, as_json: bool) -> None:
    if as_json:
        print_json({name: {before: shortest(old), after: shortest(new)} for name, (old, new) in changes.items()})
        return
    if not changes:
        console.print("no difference")
    for name, (old, new) in changes.items():
        info = parameters.info(name)
        console.print(f"[cyan]{name}[/]  {format_value(info, old)} → [bold]{format_value(info, new)}[/]")


def _keep(robot: Robot, wanted: bool, quiet: bool) -> None:
    if wanted:
        robot.store()
        note("stored", quiet=quiet)


@app.command("list", epilog=examples(f"omni params list {_LINK}", "omni params list ISMC", "omni params list --json"))
def list_parameters(
    filter_text: Annotated[str, typer.Argument(metavar="[TEXT]", help="Only names that contain this.")] = "",
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Show parameters with unit, range, default and meaning; values that differ from the default are bold."""
    with open_robot(link, timeout_s=timeout) as robot:
        values = {n: v for n, v in _download(robot, as_json).items() if filter_text.upper() in n}
        if as_json:
            print_json({name: _described(robot.parameters, name, value) for name, value in values.items()})
        else:
            console.print(_table(robot.parameters, values))


@app.command("get", epilog=examples("omni params get ISMC_LAM_XY", "omni params get WHEELS TRJ_TYPE --json"))
def get(
    names: Annotated[list[str], typer.Argument(help="Parameter names.", autocompletion=completion.parameters)],
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Read parameters from the robot."""
    with open_robot(link, timeout_s=timeout) as robot:
        values = {name.upper(): robot.parameters[name.upper()] for name in names}
        if as_json:
            print_json({name: shortest(value) for name, value in values.items()})
            return
        for name, value in values.items():
            console.print(f"[cyan]{name}[/] = {format_value(robot.parameters.info(name), value)}")


@app.command(
    "set", epilog=examples("omni params set ISMC_LAM_XY=15 ISMC_LAM_TH=15", "omni params set CTL_MODE=pid --store")
)
def set_parameters(
    assignments: Annotated[
        list[str],
        typer.Argument(metavar="NAME=VALUE...", help="All are set, or none.", autocompletion=completion.assignments),
    ],
    store: StoreOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Set parameters and wait until the robot has confirmed each. Exit code 1: refused, nothing changed."""
    values = parse_assignments(assignments)
    table = parameter_table()
    for name, value in values.items():
        checked_value(table, name, value)
    with open_robot(link, timeout_s=timeout) as robot:
        old = {name: robot.parameters[name] for name in values}
        robot.parameters.set_many(values)
        _keep(robot, store, as_json)
        changes = {name: (old[name], robot.parameters[name]) for name in values}
        _print_changes(robot.parameters, changes, "before", "after", as_json)


@app.command("save", epilog=examples("omni params save mine.toml", f"omni params save mine.toml {_LINK}"))
def save(
    file: Annotated[Path, typer.Argument(help="TOML file to write.")],
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Save all parameters as a commented TOML file."""
    writable_path(file, "save")
    with open_robot(link, timeout_s=timeout) as robot:
        values = _download(robot, as_json)
        robot.parameters.save(file)
    if as_json:
        print_json({"file": str(file), "parameters": len(values)})
    else:
        console.print(f"{len(values)} parameters saved to {file}")


@app.command("load", epilog=examples("omni params load mine.toml --store", "omni params load report_torque"))
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
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Set the parameters of a file or preset, all or none, and show what changed."""
    path = find_parameter_file(file)
    parameter_file.read(path, parameter_table())
    with open_robot(link, timeout_s=timeout) as robot:
        _download(robot, as_json)
        changes = robot.parameters.load(path)
        _keep(robot, store, as_json)
        _print_changes(robot.parameters, changes, "before", "after", as_json)


@app.command("presets", epilog=examples("omni params presets", "omni params presets report_ismc --json"))
def presets(
    name: Annotated[str | None, typer.Argument(help="Show this one; without it, list all.")] = None,
    as_json: JsonOption = False,
) -> None:
    """List the sets of gains that come with omniwheel, or show one. `omni params load NAME` sets them on a robot."""
    table = parameter_table()
    chosen = [read_preset(entry, table) for entry in ([name] if name else preset_names())]
    if as_json:
        print_json({"presets": [_preset_facts(preset, with_values=name is not None) for preset in chosen]})
        return
    shown = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("parameter", "value", "unit", "meaning") if name else ("preset", "description", "from"):
        shown.add_column(title, style="cyan" if title in ("preset", "parameter") else "")
    for preset in chosen:
        if name is None:
            shown.add_row(preset.name, escape(preset.description), escape(preset.source))
            continue
        console.print(f"[bold]{preset.name}[/]  {escape(preset.description)}\n[dim]{escape(preset.source)}[/]")
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
def diff(
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROBOT|FILE|PRESET]",
            help="Robot or robot file, parameter file, or preset; without it, the defaults of params.toml.",
            autocompletion=completion.robots,
        ),
    ] = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Show where the robot differs from its robot file, another file, or the defaults (robot → file).

    A robot file sets its own numbers over the defaults. So a fresh robot differs from the defaults only there: compare
    it with its robot file to see what was tuned. Exit code 1: it differs.
    """
    other, what = _compared(file, parameter_table())
    note(f"compared with {what}", quiet=as_json)
    with open_robot(link, timeout_s=timeout) as robot:
        _download(robot, as_json)
        changes = robot.parameters.diff(other)
        _print_changes(robot.parameters, changes, "robot", "file" if file else "default", as_json)
    if changes:
        raise typer.Exit(1)


@app.command("reset", epilog=examples("omni params reset --store", "omni params reset ISMC_LAM_XY"))
def reset(
    names: Annotated[list[str] | None, typer.Argument(help="Only these, to the defaults of params.toml.")] = None,
    store: StoreOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Set all parameters back to the robot's own file, or the named ones to their defaults."""
    with open_robot(link, timeout_s=timeout) as robot:
        before = _download(robot, as_json)
        if names:
            robot.parameters.set_many({name: _default(robot, name) for name in map(str.upper, names)})
        else:
            robot.reset_parameters()
        after = _download(robot, as_json)
        _keep(robot, store, as_json)
        changes = {name: (before[name], after[name]) for name in after if before.get(name) != after[name]}
        _print_changes(robot.parameters, changes, "before", "after", as_json)


def _default(robot: Robot, name: str) -> float:
    info = robot.parameters.info(name)
    if info is None:
        raise UnknownParameterError(f"there is no parameter {name}", hint="`omni params list` shows all")
    return info.default
