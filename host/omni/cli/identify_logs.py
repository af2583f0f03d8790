# SPDX-License-Identifier: MIT
"""``omni identify logs``: radii, wheel distance and motor curves of a robot from its imported logs."""

from __future__ import annotations

from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from omni.cli.common import JsonOption, console, examples, note, print_json, writable_path
from omni.cli.log_options import RobotFileOption, RobotOption
from omniwheel.files import write_text
from omniwheel.robots import read_robot

if TYPE_CHECKING:
    from omniwheel.identification.log_study import LogStudy

EXAMPLES = examples(
    "omni identify logs run1.npz run2.npz run3.npz --robot nominal.toml --out identified.toml",
    "omni identify logs run?.npz --turn spin1.npz --lifted motor1.npz --robot nominal.toml --out identified.toml",
    "omni identify logs run?.npz --turn spin1.npz --robot nominal.toml --leave-one-out",
)
PAGE_FILE, PICTURE_FILE = "identification.md", "identification.png"


def identify_logs(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG.npz...", help="Imported logs with ground truth and heading.")
    ],
    robot: RobotOption,
    out: RobotFileOption = None,
    turn: Annotated[
        list[Path] | None,
        typer.Option("--turn", metavar="LOG.npz", help="Log of turning on the spot; needs a heading, no ground truth."),
    ] = None,
    lifted: Annotated[
        list[Path] | None, typer.Option("--lifted", metavar="LOG.npz", help="Log with lifted wheels.")
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="DIR", help="Folder of the report. \\[default: beside --out]"),
    ] = None,
    leave_one_out: Annotated[
        bool,
        typer.Option(
            "--leave-one-out",
            help="Only cross-validate: predict each run from the others. Writes nothing, needs no --out.",
        ),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Identify effective radius per wheel and direction, wheel distance and motor curves from logs of other robots.

    Every run is also dead-reckoned with what the other runs say: that is the figure to trust. Writes the robot file,
    its calibration beside it, and a report that rates the results.
    """
    from omniwheel.identification.log_page import study_data, study_page
    from omniwheel.identification.log_plot import draw_study
    from omniwheel.identification.log_robot_file import write_robot_file
    from omniwheel.identification.log_study import identify_from_logs
    from omniwheel.logs.log import load_log

    if leave_one_out and (out is not None or page is not None):
        raise typer.BadParameter("--leave-one-out writes nothing: leave out --out and --page, or --leave-one-out")
    folder = page if page is not None else (out or Path()).parent
    if not leave_one_out:
        if out is None:
            raise typer.BadParameter("give --out ROBOT.toml, or --leave-one-out to write nothing")
        if not folder.is_dir():
            raise typer.BadParameter(f"{folder}: this folder does not exist; the report needs an existing one")
        writable_path(out, "the robot file")
    nominal = read_robot(robot)
    runs = [load_log(path) for path in logs]
    note(f"identifying {len(runs) + 1} times: with all runs, and without each", quiet=as_json)
    study = identify_from_logs(
        runs, nominal, [load_log(path) for path in turn or ()], [load_log(path) for path in lifted or ()]
    )
    if out is None:
        if as_json:
            print_json(study_data(study, nominal))
        else:
            _print_runs(study)
        return
    robot_file, calibration = write_robot_file(study.whole, robot, out)
    draw_study(study, runs, folder / PICTURE_FILE)
    write_text(folder / PAGE_FILE, study_page(study, nominal, runs, PICTURE_FILE))
    files = {
        "robot": str(robot_file),
        "calibration": str(calibration),
        "page": str(folder / PAGE_FILE),
        "picture": str(folder / PICTURE_FILE),
    }
    if as_json:
        print_json({**study_data(study, nominal), "files": files})
        return
    _print_runs(study)
    for name, path in files.items():
        console.print(f"[dim]{escape(name):12}[/] {escape(str(path))}", soft_wrap=True)


def _print_runs(study: LogStudy) -> None:
    """Say how far each run is from its truth, in every way, and what was chosen without it."""
    from omniwheel.identification.log_page import KINDS, settings_text

    console.print(
        f"{'mm RMS':24} {'median':>7}" + "".join(f"{escape(run.name):>8}" for run in study.scored), soft_wrap=True
    )
    for kind in KINDS:
        cells = "".join(f"{1e3 * getattr(run, kind).alignment.rms_m:8.0f}" for run in study.scored)
        console.print(f"{kind.replace('_', ' '):24} {1e3 * study.median_m(kind):7.0f}{cells}", soft_wrap=True)
    shapes = [1e3 * run.held_out.alignment.shape_rms_m for run in study.scored]
    cells = "".join(f"{shape:8.0f}" for shape in shapes)
    console.print(f"{'held out, best scale':24} {median(shapes):7.0f}{cells}", soft_wrap=True)
    for run, other in zip(study.scored, study.without, strict=True):
        console.print(f"[dim]without {escape(run.name)}:[/] {settings_text(other.settings)}", soft_wrap=True)
