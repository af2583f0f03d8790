# SPDX-License-Identifier: MIT
"""What the commands for logs share: options, reading a log with robot and calibration, the study extra."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omni_schema import Robot
from omniwheel.limits import LOG_KINDS
from omniwheel.robots import find_robot_file, read_robot

if TYPE_CHECKING:
    from omniwheel.logs.calibration import Calibration
    from omniwheel.logs.log import WheelLog

LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help=f"{LOG_KINDS}.")]
RobotOption = Annotated[str, typer.Option("--robot", "-r", metavar="NAME|FILE", help="The robot's name or file.")]
MAPPING = typer.Option(
    "--mapping", metavar="FILE", help="Which column of a CSV file, or topic of a ROS bag, is what.", show_default=False
)
MappingOption = Annotated[Path | None, MAPPING]
TRUTH = typer.Option(
    "--truth",
    metavar="FILE",
    help="Ground truth of the run: CSV, or OptiTrack Motive's export. With several logs one per log, in their order.",
    show_default=False,
)
TruthOption = Annotated[Path | None, TRUTH]
TruthsOption = Annotated[list[Path] | None, TRUTH]
RobotFileOption = Annotated[Path | None, typer.Option("--out", metavar="ROBOT.toml", help="The robot file to write.")]
PartOption = Annotated[
    int | None,
    typer.Option(
        "--part", min=1, metavar="N", help="Part of a telemetry log that has restarts, from 1.", show_default=False
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        "--calibration", metavar="FILE", help="Default: ROBOT.calibration.toml beside the robot file, if there is one."
    ),
]
NoCalibrationOption = Annotated[bool, typer.Option("--no-calibration", help="Do not use a calibration file.")]


def robot_and_calibration(
    name: str, calibration: Path | None, no_calibration: bool
) -> tuple[Robot, Calibration | None, Path | None]:
    """Return the robot, its calibration and where that was read from."""
    from omniwheel.logs.calibration import calibration_path, load_calibration

    robot = read_robot(name)
    if no_calibration and calibration is not None:
        raise typer.BadParameter("--calibration and --no-calibration exclude each other")
    beside = calibration_path(find_robot_file(name))
    path = calibration if calibration is not None else (beside if beside.is_file() and not no_calibration else None)
    return robot, None if path is None else load_calibration(path, robot.wheels), path


SMALLEST_SHARE = 1e-3
"""Below it a share would be rounded to 0.0 %, though a single row may be what matters."""


def shares_of(shares: Iterable[float], rows: int) -> str:
    """Return shares of a log's rows in percent, and small ones as the number of rows."""
    return ", ".join(
        f"{round(share * rows)} of {rows} rows" if 0.0 < share < SMALLEST_SHARE else f"{100.0 * share:.1f} %"
        for share in shares
    )


MOST_JUMPS = 5


def jumps_of_truth(log: WheelLog) -> list[str]:
    """Say where the robot's own estimate, which is a log's truth, jumps; nothing if it does not."""
    jumps = () if log.truth is None else log.truth.jumps
    said = [f"at {jump.time_s:.2f} s {jump.text}: the jump is taken out" for jump in jumps[:MOST_JUMPS]]
    return [*said, f"{len(jumps)} jumps in total"] if len(jumps) > MOST_JUMPS else said
