# SPDX-License-Identifier: MIT
"""What the commands that run scenarios share: options, progress, run folders and tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from hil_sim.limits import MAX_DURATION_S
from hil_sim.schema import WORLD
from omni.cli import completion
from omni.cli.common import console, error_console, note, print_json
from omni.cli.options import seed_option
from omni_schema.errors import did_you_mean
from omniwheel.errors import OmniError, OutputFileError
from omniwheel.number_text import shown
from omniwheel.presets import read_preset

if TYPE_CHECKING:
    from hil_sim import timeline
    from hil_sim.external import ExternalWorld
    from hil_sim.hil import AfterRunError
    from hil_sim.runs import Run
    from hil_sim.scenario import Scenario


ScenarioArgument = Annotated[
    str,
    typer.Argument(
        metavar="SCENARIO",
        help="A scenario of the package, or a .toml file.",
        show_default=True,
        autocompletion=completion.scenarios,
    ),
]


class Board(str, Enum):
    """A board that is emulated."""

    CORTEX_M7 = "cortex-m7"
    TEENSY = "teensy"


BoardOption = Annotated[
    Board | None,
    typer.Option(
        "--board",
        help="Run the firmware on this emulated board: a Cortex-M7 (QEMU), or a Teensy 4.0 with --image. "
        "\\[default: as a process on this computer]",
        show_default=False,
    ),
]
ImageOption = Annotated[
    Path | None,
    typer.Option(
        "--image",
        metavar="FILE",
        help="Run this image for a Teensy (.elf or .hex, by `make firmware`) on an emulated one.",
    ),
]
SeedOption = Annotated[int | None, seed_option("Seed of the world. \\[default: the scenario's]")]


PLANTS = tuple(WORLD.plants)


def _known_plant(name: str | None) -> str | None:
    if name is not None and name not in PLANTS:
        raise typer.BadParameter(
            f"{name!r} is not a plant{did_you_mean(name, PLANTS)}; must be one of {', '.join(PLANTS)}"
        )
    return name


PlantOption = Annotated[
    str | None,
    typer.Option(
        "--plant",
        metavar="|".join(PLANTS),
        callback=_known_plant,
        help="Model of motors, body and floor in the built-in world: full physics or a simpler one. "
        "\\[default: the scenario's]",
    ),
]
PresetOption = Annotated[
    str | None,
    typer.Option(
        "--preset",
        metavar="NAME",
        help="Gains to use instead of the scenario's: a preset (omni params list --presets) or a parameter file.",
        autocompletion=completion.presets,
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        "-r",
        metavar="NAME|FILE",
        help="The robot. \\[default: the scenario's]",
        show_default=False,
        autocompletion=completion.robots,
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Set a parameter, or a number of the world as world.NAME. Repeatable.",
        show_default=False,
    ),
]

DurationOption = Annotated[
    float | None,
    typer.Option(
        "--duration",
        "-d",
        min=0.1,
        max=MAX_DURATION_S,
        metavar="S",
        help="End every run at this time.",
        show_default=False,
    ),
]
WorldOption = Annotated[
    str | None,
    typer.Option(
        "--world",
        metavar="MODULE:CLASS|mujoco",
        help="External simulator: a Python class, or mujoco\\[:FLOOR.toml]. Default: the built-in world with --plant.",
    ),
]

Figures = Mapping[str, Any]
_MM, _MRAD = 1e3, 1e3


class RunFolderError(OmniError):
    """A run folder cannot be made or read."""

    exit_code = 2


def is_emulated(board: Board | None, image: Path | None) -> bool:
    """Return whether the firmware is built for the emulated Cortex-M7; BadParameter if board and image do not fit."""
    if board is Board.CORTEX_M7 and image is not None:
        raise typer.BadParameter("--image is for a Teensy: leave out --board cortex-m7")
    if board is Board.TEENSY and image is None:
        hint = "`make firmware` links .pio/build/three_wheel/firmware.elf"
        raise typer.BadParameter(f"--board teensy needs the image to run: add --image FILE; {hint}")
    return board is Board.CORTEX_M7


def world_of(place: str | None, scenario: Scenario, quiet: bool) -> ExternalWorld | None:
    """Make the world that --world names, and say what it leaves out of the scenario; None without the option."""
    from hil_sim.external import load_world

    if place is None:
        return None
    world = load_world(place, scenario)
    for line in getattr(world, "notes", ()):
        note(escape(line), quiet=quiet)
    return world


def scenario_help() -> str:
    """Return the line that names the scenarios of the package."""
    return f"Scenarios: {', '.join(completion.scenario_names())}. `omni run --list` describes them."


def print_scenarios(as_json: bool) -> None:
    """List the scenarios of the package, each with its robot and what it is."""
    from hil_sim.scenario import load_scenario

    found = [load_scenario(name) for name in completion.scenario_names()]
    if as_json:
        entries = [{"name": one.name, "robot": one.robot.name, "description": one.description} for one in found]
        print_json({"scenarios": entries})
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("scenario", "robot"):
        table.add_column(title, style="cyan" if title == "scenario" else "", no_wrap=True)
    table.add_column("what it is")
    for one in found:
        table.add_row(one.name, one.robot.name, escape(one.description))
    console.print(table)


@contextmanager
def run_progress(title: str, quiet: bool) -> Iterator[timeline.Progress]:
    """Show how far a run is, on standard error; yields the callback that a run takes."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=36),
        TextColumn("{task.fields[simulated]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=error_console, transient=True, disable=quiet) as progress:
        task = progress.add_task(title, total=None, simulated="")

        def show(time_s: float, end_s: float | None) -> None:
            progress.update(task, completed=time_s, total=end_s, simulated=f"{time_s:5.1f} s simulated")

        yield show


def scenario_of(
    name: str,
    *,
    robot: str | None = None,
    seed: int | None = None,
    plant: str | None = None,
    preset: str | None = None,
    settings: Sequence[str] | None = None,
    duration: float | None = None,
) -> Scenario:
    """Return the scenario that the options describe; a preset goes over the scenario's parameters, --set over both."""
    from hil_sim.scenario import load_scenario

    scenario = load_scenario(name, robot).with_seed(seed).with_plant(plant).with_duration(duration)
    return apply_settings(apply_preset(scenario, preset), settings)


def apply_settings(scenario: Scenario, settings: Sequence[str] | None) -> Scenario:
    """Return the scenario with NAME=VALUE words over its parameters, world.NAME=VALUE over its world."""
    from hil_sim.studies.errors import StudyInputError
    from hil_sim.studies.plan import WORLD_PREFIX
    from hil_sim.studies.space import parse_axes

    if not settings:
        return scenario
    for word in settings:
        name, _, value = word.partition("=")
        if not name.strip() or not value.strip() or ":" in value or "," in value:
            raise StudyInputError(f"--set {word} is not a setting", hint="write one NAME=VALUE")
    axes = parse_axes(list(settings), scenario.robot.table)
    values = {axis.name: axis.values[0] for axis in axes}
    own = {key: value for key, value in values.items() if not key.startswith(WORLD_PREFIX)}
    world = {key[len(WORLD_PREFIX) :]: value for key, value in values.items() if key not in own}
    return scenario.with_parameters(own).with_world(world)


def apply_preset(scenario: Scenario, name: str | None) -> Scenario:
    """Return the scenario with a preset's parameters over its own; None changes nothing."""
    if name is None:
        return scenario
    return scenario.with_parameters(read_preset(name, scenario.robot.table).parameters)


@contextmanager
def run_folder(out: Path, scenario: Scenario) -> Iterator[Path]:
    """Make a new run folder; RunFolderError says why it cannot be made. An error that leaves it empty takes it away."""
    from omniwheel.logs.run_folder import new_run_folder

    existed = out.exists()
    try:
        folder = new_run_folder(out, f"{scenario.name}-seed{scenario.seed}")
    except OutputFileError as error:
        raise RunFolderError(f"no run folder: {error}", hint="choose another folder with --out") from error
    try:
        yield folder
    except BaseException:
        with suppress(OSError):
            folder.rmdir()
            if not existed:
                out.rmdir()
        raise


def tried(run: Callable[[], Run]) -> tuple[Run, AfterRunError | None]:
    """Return a run, and what went wrong after its end: to be raised once the run is stored and shown."""
    from hil_sim.hil import AfterRunError

    try:
        return run(), None
    except AfterRunError as error:
        return error.run, error


def store(
    run: Run,
    summary: dict[str, Any],
    folder: Path,
    show: Callable[[], None],
    *,
    as_json: bool,
    trouble: OmniError | None = None,
) -> None:
    """Write the run's files, then ``show`` it, or print it as JSON.

    A run that cannot be stored is shown all the same, before the OutputFileError. So is one with ``trouble`` after its
    end, which is raised then.
    """
    from hil_sim.summary import PICTURE_FILE, save_run

    try:
        save_run(run, summary, folder)
        from hil_sim.run_picture import draw_run  # here, not above: matplotlib takes a second to import

        draw_run(summary, run.record, folder / PICTURE_FILE)
    except OutputFileError as error:
        error.found = summary
        if not as_json:
            show()
        raise
    if not as_json:
        show()
    if trouble is not None:
        raise trouble
    if as_json:
        print_json({**summary, "folder": str(folder)})


def comparison_table(title: str, columns: Sequence[tuple[str, Figures, Figures | None]]) -> Table:
    """Return a table of accuracy and effort; per column a heading, an ``rmse`` and perhaps an ``effort``."""
    table = Table(title=title, title_style="bold", title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("", no_wrap=True)
    for heading, _, _ in columns:
        table.add_column(heading, justify="right")
    accuracy = (
        ("position RMSE [mm]", "position_m", _MM),
        ("x RMSE [mm]", "x_m", _MM),
        ("y RMSE [mm]", "y_m", _MM),
        ("heading RMSE [mrad]", "theta_rad", _MRAD),
    )
    for name, key, factor in accuracy:
        style = "bold" if key in ("position_m", "theta_rad") else None
        table.add_row(escape(name), *(shown(rmse[key], factor) for _, rmse, _ in columns), style=style)
    effort = (
        ("peak wheel speed [rad/s]", "peak_wheel_rad_s", 1.0, 2),
        ("time at a limit [%]", "saturated_share", 100.0, 1),
        ("chatter index", "chatter", 1.0, 4),
    )
    for name, key, factor, digits in effort:
        table.add_row(
            escape(name), *("" if figures is None else shown(figures[key], factor, digits) for _, _, figures in columns)
        )
    return table


def print_run(summary: Figures, folder: Path, compared: Mapping[str, str]) -> None:
    """Print a run's table and what else is worth knowing; ``compared`` has the heading of each compared scenario."""
    columns: list[tuple[str, Figures, Figures | None]] = []
    change = summary["change"]
    if change is not None:
        columns += [("before", change["rmse_before"], None), ("after", change["rmse_after"], None)]
    columns.append(("all", summary["rmse"], summary["effort"]))
    comparison = summary.get("comparison", {})
    columns += [(compared[name], entry["rmse"], entry["effort"]) for name, entry in comparison.items()]
    external = summary["world"].get("external")
    where = f" (world {external})" if external else ""
    console.print(comparison_table(f"{summary['scenario']}{where}: {summary['description']}", columns))
    for name, entry in comparison.items():
        console.print(f"{compared[name]}: {entry['description']}", markup=False)
        if not entry["completed"]:
            console.print(f"[yellow]{name}: stopped before the end ({', '.join(entry['faults'])})[/]")
    print_facts(summary)
    files = ", ".join(sorted(path.name for path in folder.iterdir()))
    console.print(f"\n[bold]{escape(str(folder))}[/]: {escape(files)}")


def print_facts(summary: Figures) -> None:
    """Print how a run came about: change, faults, speed, timing."""
    change, tick = summary["change"], summary["tick_us"]
    console.print(f"controller {summary['controller']}")
    if change is not None:
        console.print(f"changed at {change['time_s']:.2f} s: {change['what']}")
    if summary["faults"]:
        console.print(f"[red]faults: {', '.join(summary['faults'])}[/]; the robot ended {summary['final_state']}")
    if summary["warnings"]:
        console.print(f"[yellow]warnings: {', '.join(summary['warnings'])}[/]")
    duration, factor = f"{summary['duration_s']:.1f} s simulated", f"{summary['realtime_factor']:.1f} × real time"
    timing = f"; tick {tick['mean']:.1f} µs mean, {tick['max']:.1f} µs longest" if tick else ""
    console.print(f"{duration} in {summary['wall_s']:.1f} s: {factor}{timing}")
