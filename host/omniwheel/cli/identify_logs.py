# SPDX-License-Identifier: MIT
"""``omni identify logs``: radii, wheel distance and motor curves of a robot from its imported logs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omniwheel.cli.common import JsonOption, console, examples, note, print_json, writable_path
from omniwheel.cli.log_options import RobotOption
from omniwheel.cli.old_options import with_old_key
from omniwheel.files import write_text
from omniwheel.robots import read_robot

EXAMPLES = examples(
    "omni identify logs run1.npz run2.npz run3.npz --robot nominal.toml --out identified.toml",
    "omni identify logs run?.npz --turn spin1.npz --lifted motor1.npz --robot nominal.toml --out identified.toml",
)
PAGE_FILE, PICTURE_FILE = "identification.md", "identification.png"


def identify_logs(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG.npz...", help="Imported logs with truth and heading.")],
    robot: RobotOption,
    out: Annotated[Path, typer.Option("--out", metavar="ROBOT.toml", help="The robot file to write.")],
    turn: Annotated[
        list[Path] | None,
        typer.Option("--turn", metavar="LOG.npz", help="A log that only turns; needs a heading, no truth."),
    ] = None,
    lifted: Annotated[
        list[Path] | None, typer.Option("--lifted", metavar="LOG.npz", help="A log with the wheels in the air.")
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option("--page", metavar="DIR", help="Where the page about it goes. \\[default: beside --out]"),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Identify effective radius per wheel and direction, wheel distance and motor curves from logs of other robots.

    Every run is also dead-reckoned with what the other runs say: that is the figure to trust. Writes the robot file,
    its calibration beside it, and a page that says what can be trusted.
    """
    from omniwheel.identification.log_page import KINDS, study_data, study_page
    from omniwheel.identification.log_plot import draw_study
    from omniwheel.identification.log_robot_file import write_robot_file
    from omniwheel.identification.log_study import identify_from_logs
    from omniwheel.logs.log import load_log

    folder = page if page is not None else out.parent
    if not folder.is_dir():
        raise typer.BadParameter(f"{folder}: the page needs a folder that exists")
    writable_path(out, "the robot file")
    nominal = read_robot(robot)
    runs = [load_log(path) for path in logs]
    note(f"identifying {len(runs) + 1} times: with all runs, and without each", quiet=as_json)
    study = identify_from_logs(
        runs, nominal, [load_log(path) for path in turn or ()], [load_log(path) for path in lifted or ()]
    )
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
        print_json({**study_data(study, nominal), "files": with_old_key(files, "page")})
        return
    for kind in KINDS:
        console.print(f"{kind.replace('_', ' '):24} {1e3 * study.median_m(kind):6.0f} mm RMS in the median")
    for name, path in files.items():
        console.print(f"[dim]{name:12}[/] {path}", soft_wrap=True)
