# SPDX-License-Identifier: MIT
"""``omni identify geometry``: radii, wheel distance and the tracked point from counts beside measured poses."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli.common import JsonOption, console, examples, note, print_json, redrawn_path, writable_path
from omni.cli.log_options import MappingOption, RobotFileOption, RobotOption, TruthsOption
from omni.cli.options import PLOT
from omniwheel.limits import LOG_KINDS
from omniwheel.robots import read_robot

if TYPE_CHECKING:
    from omni_schema import Robot
    from omniwheel.identification.estimate import Estimate
    from omniwheel.identification.pose_fit.study import GeometryStudy
    from omniwheel.identification.pose_fit.wheel_model import WheelModel
    from omniwheel.identification.pose_fit.windows import Run

EXAMPLES = examples(
    "omni identify geometry run1.npz run2.npz run3.npz --robot mine.toml --out identified.toml",
    "omni identify geometry day1/*.csv day2/*.csv --mapping mapping.toml --robot mine.toml --plot geometry.png",
    "omni identify geometry run1.csv run2.csv --truth t1.csv --truth t2.csv --mapping mapping.toml -r mine.toml",
)
MOST_GROUPS = 10
PlotOption = Annotated[Path | None, PLOT]


class LeaveOut(str, Enum):
    """What is left out together."""

    FOLDER = "folder"
    LOG = "log"


def identify_geometry(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=f"{LOG_KINDS}; with poses.")],
    robot: RobotOption,
    mapping: MappingOption = None,
    truth: TruthsOption = None,
    leave_out: Annotated[
        LeaveOut | None,
        typer.Option(
            "--leave-out",
            help="Cross-validation groups. Default: one per folder; with a single folder, one per log.",
            show_default=False,
        ),
    ] = None,
    out: RobotFileOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
) -> None:
    """Identify odometry geometry from encoder counts and measured poses; no IMU and no motor duties are needed.

    The poses are in the logs (truth.in_log in the column mapping) or in --truth files. Positions of one marker suffice,
    which may be off the robot's centre. Fits the integrated pose. Groups of runs are left out in turn; dead reckoning
    of these runs is the figure to trust.
    """
    from omniwheel.identification.pose_fit.result_data import study_data
    from omniwheel.identification.pose_fit.robot_file import write_geometry
    from omniwheel.identification.pose_fit.study import identify_geometry as identify
    from omniwheel.identification.pose_fit.wheel_model import wheel_model

    if truth and len(truth) != len(logs):
        raise typer.BadParameter(f"{len(truth)} --truth files beside {len(logs)} logs; give one per log, or none")
    if out is not None:
        writable_path(out, "the robot file")
    if plot is not None:
        redrawn_path(plot, "--plot")
    nominal = read_robot(robot)
    layout = wheel_model(nominal)
    runs = _runs(logs, truth or [None] * len(logs), mapping, nominal, leave_out, layout)
    groups = len({run.group for run in runs})
    note(f"{len(runs)} runs in {groups} groups; each group is left out in turn", quiet=as_json)
    study = identify(runs, layout)
    written = write_geometry(study, robot, out) if out is not None else None
    drawn = plot if plot is not None and _draw(study, plot, as_json=as_json) else None
    files = {name: None if path is None else str(path) for name, path in (("file", written), ("plot", drawn))}
    if as_json:
        print_json({**study_data(study), **files})
        return
    print_study(study)
    for path in filter(None, files.values()):
        console.print(f"\n[bold]{escape(path)}[/]", soft_wrap=True)


def _draw(study: GeometryStudy, path: Path, *, as_json: bool) -> bool:
    """Draw the left-out runs; say why if there are none."""
    from omniwheel.identification.pose_fit.picture import draw_study

    if not study.held_out:
        note("no plot: cross-validation needs two or more runs", quiet=as_json)
        return False
    draw_study(study, path)
    return True


def _runs(
    logs: list[Path],
    truths: list[Path] | list[None],
    mapping: Path | None,
    robot: Robot,
    leave_out: LeaveOut | None,
    layout: WheelModel,
) -> list[Run]:
    """Read the logs; the groups that are left out together are fixed here, before any fit."""
    from omniwheel.identification.pose_fit.study import left_out_together
    from omniwheel.identification.pose_fit.windows import run_of
    from omniwheel.log_sources import open_log

    folders = {path.resolve().parent for path in logs}
    by_folder = leave_out is LeaveOut.FOLDER or (leave_out is None and len(folders) > 1)
    runs = []
    for path, truth in zip(logs, truths, strict=True):
        folder = str(path.parent)
        runs.append(run_of(open_log(path, robot, mapping, truth), folder, layout))
    if by_folder:
        return runs
    if len(runs) > MOST_GROUPS:
        return left_out_together(runs, MOST_GROUPS)
    return [replace(run, group=str(path)) for run, path in zip(runs, logs, strict=True)]


def print_study(study: GeometryStudy) -> None:
    """Print parameters, refusals, clocks and the errors of left-out runs."""
    from omniwheel.identification.pose_fit.result_data import clock_text, split_text

    whole = study.whole
    console.print(_parameters("plain geometry", whole.plain, study))
    if len(whole.chosen.names) > len(whole.plain.names):
        console.print(_parameters(f"{whole.model.name}: predicts left-out runs better", whole.chosen, study))
    for refusal in whole.refused:
        console.print(
            f"[yellow]not identified: {refusal.name}[/] ({refusal.why}); it keeps its nominal value. "
            f"To identify it: {refusal.motion}"
        )
    console.print(clock_text(study))
    console.print(split_text(study))
    if study.held_out:
        console.print(_errors(study))


def _parameters(title: str, found: Estimate, study: GeometryStudy) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False, title=title, title_justify="left")
    table.add_column("parameter", style="cyan")
    for name in ("nominal", "value", "± 95 %"):
        table.add_column(name, justify="right")
    nominal = dict(zip(study.layout.names, study.layout.nominal, strict=True))
    for name in found.names:
        table.add_row(name, f"{nominal[name]:.5g}", f"{found[name]:.5g}", f"{found.half_width(name):.2g}")
    return table


def _errors(study: GeometryStudy) -> Table:
    from omniwheel.identification.pose_fit.result_data import KINDS, MEASURES, summaries

    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("left-out runs, start pose given, no alignment", style="cyan")
    for name in ("median", "95 %", "largest", "unit"):
        table.add_column(name, justify="right")
    for measure, (_, factor, unit) in MEASURES.items():
        for kind, found in summaries(study, measure).items():
            values = (factor * value for value in (found.median, found.percentile_95, found.largest))
            cells = ("–" if math.isnan(value) else f"{value:.3g}" for value in values)
            table.add_row(f"{measure}: {KINDS[kind][1]}", *cells, unit)
    return table
