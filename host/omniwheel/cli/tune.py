# SPDX-License-Identifier: MIT
"""``omni tune``: change gains on a live robot and see at once what it does."""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omniwheel.cli import completion
from omniwheel.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    note,
    open_robot,
    parse_assignments,
    print_json,
    signals_interrupt,
    writable_path,
)
from omniwheel.robot import DEFAULT_TIMEOUT_S, Robot
from omniwheel.tuning import Experiment, Figures, Trace

EXAMPLES = examples(
    "omni tune --link tcp:127.0.0.1:5760 --set ISMC_LAM_XY=15",
    "omni tune --set WS_P=6 --set WS_I=150 --axis theta --size 0.5",
    "omni tune --experiment trajectory --set CTL_MODE=pid --revert --json",
    "omni tune --set ISMC_LAM_XY=15 --keep --store",
)


class Kind(str, enum.Enum):
    """Which experiment."""

    STEP = "step"
    TRAJECTORY = "trajectory"


class Axis(str, enum.Enum):
    """Along which axis of the world a step goes."""

    X = "x"
    Y = "y"
    THETA = "theta"


def tune(
    link: LinkOption = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A parameter to change; repeatable.",
            autocompletion=completion.assignments,
        ),
    ] = None,
    experiment: Annotated[
        Kind, typer.Option("--experiment", "-e", help="What the robot does before and after.")
    ] = Kind.STEP,
    axis: Annotated[Axis, typer.Option("--axis", help="Direction of the step, in the world.")] = Axis.X,
    size: Annotated[float, typer.Option("--size", min=-3.0, max=3.0, help="Size of the step [m or rad].")] = 0.1,
    duration_s: Annotated[
        float | None,
        typer.Option(
            "--duration",
            "-d",
            min=0.2,
            metavar="S",
            help="Time to watch a step [3], or allowed for a trajectory [600].",
        ),
    ] = None,
    keep: Annotated[
        bool | None,
        typer.Option(
            "--keep/--revert", help="Keep the new values or go back. Default: ask; without a terminal revert."
        ),
    ] = None,
    store: Annotated[bool, typer.Option("--store", help="With --keep: keep them over a restart too.")] = False,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Where to draw the picture.")] = Path("tune.png"),
    timeout_s: TimeoutOption = DEFAULT_TIMEOUT_S,
    json_wanted: JsonOption = False,
) -> None:
    """Drive an experiment with the present gains and with others, compare, and keep the new ones or go back.

    Shown are rise time, overshoot, settling time and RMSE.

    The robot moves: a step goes there and back, and needs that much room. Whatever goes wrong, the old values come
    back and the robot is disarmed.
    """
    wanted = parse_assignments(assignments or [])
    if not wanted:
        raise typer.BadParameter("give at least one --set NAME=VALUE")
    if size == 0.0:
        raise typer.BadParameter("--size must not be 0")
    from omniwheel.tuning_plot import draw_tuning  # here, not above: matplotlib takes a second to import

    target = writable_path(out, "the picture")
    kept = False
    with signals_interrupt(), open_robot(link, timeout_s=timeout_s) as robot:
        new = {name: robot.parameters.check(name, value) for name, value in wanted.items()}
        old = {name: robot.parameters[name] for name in new}
        try:
            traces, figures = _both(robot, new, _Plan(experiment, axis, size, duration_s), json_wanted)
            what = ", ".join(f"{name} {old[name]:g} → {new[name]:g}" for name in new)
            draw_tuning(*traces, what, target)
            if not json_wanted:
                console.print(_table(what, figures), f"\n[bold]{target}[/]")
            kept = _wants_to_keep(keep, json_wanted)
        finally:
            if not kept:
                robot.parameters.set_many(old)
        if kept and store:
            robot.store()
    if json_wanted:
        result = {"experiment": experiment.value, "old": old, "new": new, "kept": kept, "report": str(target)}
        print_json({**result, "before": figures[0].as_dict(), "after": figures[1].as_dict()})
    else:
        console.print("kept" if kept else "old values restored")


class _Plan:
    """The experiment that is run twice."""

    def __init__(self, kind: Kind, axis: Axis, size: float, duration_s: float | None) -> None:
        self.kind, self.axis, self.size = kind, axis, size
        self.duration_s = duration_s if duration_s is not None else 3.0 if kind is Kind.STEP else 600.0

    def run(self, robot: Robot) -> tuple[Trace, Figures]:
        if self.kind is Kind.STEP:
            return Experiment(robot).step(self.axis.value, self.size, self.duration_s)
        return Experiment(robot).trajectory(self.duration_s)


def _both(
    robot: Robot, new: dict[str, float], plan: _Plan, quiet: bool
) -> tuple[tuple[Trace, Trace], tuple[Figures, Figures]]:
    note("with the present values …", quiet=quiet)
    before, figures_before = plan.run(robot)
    robot.parameters.set_many(new)
    note("with the new values …", quiet=quiet)
    after, figures_after = plan.run(robot)
    return (before, after), (figures_before, figures_after)


def _wants_to_keep(keep: bool | None, json_wanted: bool) -> bool:
    if keep is not None:
        return keep
    return not json_wanted and sys.stdin.isatty() and typer.confirm("Keep the new values?", default=False)


def _table(what: str, figures: tuple[Figures, Figures]) -> Table:
    table = Table(title=what, title_style="bold", title_justify="left")
    for heading in ("", "before", "after"):
        table.add_column(heading, justify="right" if heading else "left")
    rows: tuple[tuple[str, str, float, int], ...] = (
        ("rise time [ms]", "rise_s", 1e3, 0),
        ("overshoot [%]", "overshoot", 1e2, 1),
        ("settling time [ms]", "settling_s", 1e3, 0),
        ("position RMSE [mm]", "position_m", 1e3, 2),
        ("heading RMSE [mrad]", "theta_rad", 1e3, 2),
    )
    for name, key, factor, digits in rows:
        values: list[Any] = [entry.as_dict()[key] for entry in figures]
        if not all(value != value for value in values):
            table.add_row(
                escape(name), *("–" if value != value else f"{value * factor:.{digits}f}" for value in values)
            )
    return table
