# SPDX-License-Identifier: MIT
"""``omni bringup``: from bare boards to a driving robot, a check at each step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli import completion
from omni.cli.bringup_person import TerminalPerson
from omni.cli.common import (
    console,
    examples,
    note,
    open_robot,
    print_json,
    redrawn_path,
)
from omni.cli.options import BaudOption, measure_option, page_option, refuse_unused, takes
from omni.cli.robot_options import RobotOptions
from omniwheel.errors import OutputFileError
from omniwheel.limits import (
    MOTORS_DUTY,
    OUTPUT_ENABLE_DUTY,
    OUTPUT_ENABLE_LARGEST_DUTY,
    RADIO_BAUD,
    RADIO_LOSS_LIMIT,
    RADIO_ROUND_TRIP_LIMIT_S,
)
from omniwheel.robots import read_robot

if TYPE_CHECKING:
    from omni_schema import Robot as RobotFile
    from omniwheel.bringup import Result
    from omniwheel.bringup.radio import RadioWindow
    from omniwheel.robot import Robot

EXAMPLES = examples(
    "omni bringup --robot mine.toml",
    "omni bringup --radio /dev/ttyUSB0,9600",
    "omni bringup link --robot mine.toml --radio /dev/ttyUSB0,9600",
    "omni bringup encoders",
    "omni bringup motors --duty 0.3 --yes --json",
    "omni bringup oe --robot mine.toml",
    "omni bringup button --robot mine.toml",
    "omni bringup gyro --robot mine.toml --json",
    "omni bringup drive",
    "omni bringup radio --link /dev/ttyUSB0,9600",
    "omni bringup radio --watch -l COM7,9600",
)


class Check(str, Enum):
    """What is checked: one thing, or all."""

    ALL = "all"
    LINK = "link"
    I2C = "i2c"
    ENCODERS = "encoders"
    GYRO = "gyro"
    FLOW = "flow"
    MOTORS = "motors"
    ESTOP = "estop"
    OE = "oe"
    BUTTON = "button"
    DRIVE = "drive"
    RADIO = "radio"


OPTIONS: Mapping[str, frozenset[str]] = {
    Check.ALL: frozenset({"robot_file", "radio", "baud", "keep_going", "folder", "yes"}),
    Check.LINK: frozenset({"robot_file", "radio"}),
    Check.I2C: frozenset(),
    Check.ENCODERS: frozenset(),
    Check.GYRO: frozenset({"robot_file"}),
    Check.FLOW: frozenset({"robot_file"}),
    Check.MOTORS: frozenset({"duty", "yes"}),
    Check.ESTOP: frozenset({"yes"}),
    Check.OE: frozenset({"robot_file", "duty", "yes"}),
    Check.BUTTON: frozenset({"robot_file"}),
    Check.DRIVE: frozenset({"yes"}),
    Check.RADIO: frozenset({"duration", "baud", "loss", "round_trip", "watch"}),
}
"""The options that each check has besides those of every command that talks to a robot."""

YesOption = Annotated[
    bool,
    typer.Option(
        "--yes",
        "-y",
        help="No questions: the wheels turn immediately, and errors that only an observer can see are not found.",
    ),
]
RobotFileOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        "-r",
        metavar="NAME|FILE",
        help="Robot file to compare the robot with.",
        show_default=False,
        autocompletion=completion.robots,
    ),
]
RadioOption = Annotated[
    str | None,
    typer.Option("--radio", metavar="URL", help="The robot's radio link, checked beside --link.", show_default=False),
]
DutyOption = Annotated[
    float | None,
    typer.Option(
        "--duty",
        min=0.05,
        max=0.5,
        help=f"Duty cycle of the motors, 0 to 1: of motors and oe, there at most {OUTPUT_ENABLE_LARGEST_DUTY:g}.",
        show_default=False,
    ),
]


@takes(RobotOptions)
def bringup(
    ctx: typer.Context,
    check: Annotated[Check, typer.Argument(metavar="CHECK", help="What to check.")] = Check.ALL,
    robot_file: RobotFileOption = None,
    radio: RadioOption = None,
    yes: YesOption = False,
    keep_going: Annotated[bool, typer.Option("--keep-going", help="Continue after a check that fails.")] = False,
    folder: Annotated[Path, page_option("DIR", exists=True, file_okay=False)] = Path(),
    duty: DutyOption = None,
    duration: Annotated[float, measure_option(1.0)] = 10.0,
    baud: BaudOption = RADIO_BAUD,
    loss: Annotated[
        float, typer.Option("--loss", min=0.0, max=1.0, help="Largest fraction of lost messages that passes, 0 to 1.")
    ] = RADIO_LOSS_LIMIT,
    round_trip: Annotated[
        float,
        typer.Option(
            "--round-trip",
            min=0.001,
            metavar="S",
            help="Largest 95th percentile of the round-trip time that passes \\[s].",
        ),
    ] = RADIO_ROUND_TRIP_LIMIT_S,
    watch: Annotated[
        bool, typer.Option("--watch", help="Print a line every 2 s until Ctrl-C, while you walk away with the robot.")
    ] = False,
    *,
    wanted: RobotOptions,
) -> None:
    """Check a new robot step by step. Each check passes or names what to correct. Exit code 1: one did not pass.

    Without a name all checks run in this order, up to the first that fails, and bringup.json and bringup.md are
    written. The robot is disarmed at the end, on Ctrl-C and on any error.

    link: heartbeats, firmware and parameter versions, the robot's numbers, latency, restarts.

    i2c: the devices that respond on the I2C bus. The PWM board must respond at 0x40.

    encoders: order, direction, counts, noise, while you turn each wheel by hand. Nothing is armed.

    gyro: bias at rest, sign and scale. You turn the robot by hand when prompted; no motor turns.

    flow: direction and scale of the floor odometry sensor. You push the robot by hand; no motor turns.

    motors: order, direction, speed, deadband, wheel by wheel at low duty. On a stand.

    estop: how soon the wheels stop after an e-stop, and after setpoints or heartbeats are lost. On a stand.

    oe: the output-enable pin stops the wheels, and so does its pull-up. On a stand.

    button: the stop button stops the wheels until a release. You press it when prompted. On a stand.

    drive: a square of 20 cm and two turns at low speed, for directions and odometry. On the floor.

    radio: packet loss and round-trip time of the radio --link, with 30 % of its bandwidth at most.
    """
    refuse_unused(ctx, check.value, OPTIONS[check], frozenset().union(*OPTIONS.values()))
    file = None if robot_file is None else read_robot(robot_file)
    if check is Check.ALL:
        _all(wanted, file, radio, baud, keep_going=keep_going, folder=folder, yes=yes)
    elif check is Check.LINK:
        _link(wanted, file, radio)
    elif check is Check.RADIO and watch:
        with wanted.open() as robot:
            _watch(robot, baud, wanted.as_json)
    elif check is Check.RADIO:
        from omniwheel.bringup import check_radio

        with wanted.open() as robot:
            note(f"pinging for {duration:g} s …", quiet=wanted.as_json)
            result = check_radio(robot, duration_s=duration, baud=baud, loss_limit=loss, round_trip_limit_s=round_trip)
        _finish(result, wanted.as_json)
    else:
        _one(check, wanted, file, duty, yes=yes)


def _one(check: Check, wanted: RobotOptions, file: RobotFile | None, duty: float | None, *, yes: bool) -> None:
    """Run a check that a person may have to watch or to help with."""
    from omniwheel import bringup as checks

    if check is Check.OE and duty is not None and duty > OUTPUT_ENABLE_LARGEST_DUTY:
        raise typer.BadParameter(f"--duty {duty:g}: must be at most {OUTPUT_ENABLE_LARGEST_DUTY:g} for oe")
    runs: Mapping[Check, Callable[[Robot, checks.Person], Result]] = {
        Check.I2C: lambda robot, _: checks.check_i2c(robot),
        Check.ENCODERS: checks.check_encoders,
        Check.GYRO: partial(checks.check_gyro, file=file),
        Check.FLOW: partial(checks.check_flow, file=file),
        Check.MOTORS: partial(checks.check_motors, duty=duty or MOTORS_DUTY),
        Check.ESTOP: checks.check_stops,
        Check.OE: partial(checks.check_output_enable, duty=duty or OUTPUT_ENABLE_DUTY, file=file),
        Check.BUTTON: partial(checks.check_stop_button, file=file),
        Check.DRIVE: checks.check_drive,
    }
    with wanted.open() as robot:
        person = checks.Assumed() if yes else TerminalPerson(robot, may_be_assumed="yes" in OPTIONS[check])
        result = runs[check](robot, person)
    _finish(result, wanted.as_json)


def _link(wanted: RobotOptions, file: RobotFile | None, radio: str | None) -> None:
    from omniwheel.bringup import check_link

    with ExitStack() as stack:
        robot = stack.enter_context(wanted.open())
        other = None if radio is None else stack.enter_context(open_robot(radio, timeout_s=wanted.timeout))
        result = check_link(robot, file, other)
    _finish(result, wanted.as_json)


def _all(
    wanted: RobotOptions,
    file: RobotFile | None,
    radio: str | None,
    baud: int,
    *,
    keep_going: bool,
    folder: Path,
    yes: bool,
) -> None:
    from omniwheel.bringup import Assumed
    from omniwheel.bringup.results_page import FILES, TITLE, as_dict, write_results
    from omniwheel.bringup.sequence import bring_up

    title = TITLE if file is None else f"{TITLE} of {file.name}"
    for name, beginning in FILES.items():
        redrawn_path(folder / name, "--out", beginning)
    results: list[Result] = []
    with ExitStack() as stack:
        robot = stack.enter_context(wanted.open())
        others = [] if radio is None else [stack.enter_context(open_robot(radio, timeout_s=wanted.timeout))]
        person = Assumed() if yes else TerminalPerson(robot, *others)
        try:
            for result in bring_up(
                robot, person, file=file, radio=others[0] if others else None, baud=baud, keep_going=keep_going
            ):
                results.append(result)
                if not wanted.as_json:
                    _print(result)
        except BaseException:
            with suppress(OutputFileError):  # what went wrong with the robot is to be heard
                write_results(results, folder, title)
            raise
    paths = write_results(results, folder, title)
    note(f"results: {paths[0]}, {paths[1]}", quiet=wanted.as_json)
    if wanted.as_json:
        print_json(as_dict(results))
    if not all(result.ok for result in results):
        raise typer.Exit(1)


def _finish(result: Result, as_json: bool) -> None:
    if as_json:
        print_json(result.as_dict())
    else:
        _print(result)
    if not result.ok:
        raise typer.Exit(1)


def _print(result: Result) -> None:
    table = Table(box=None, show_header=False, pad_edge=False)
    for _ in range(2):
        table.add_column()
    table.add_column(overflow="fold")
    for finding in result.findings:
        mark = "[green]✓[/]" if finding.ok else "[bold red]✗[/]"
        table.add_row(mark, escape(finding.name), escape(finding.seen))
        if finding.advice:
            table.add_row("", "", f"[yellow]{escape(finding.advice)}[/]")
    console.print(table)
    verdict = "[bold green]pass[/]" if result.ok else "[bold red]not yet[/]"
    console.print(f"{result.check}: {verdict}")


def _watch(robot: Robot, baud: int, as_json: bool) -> None:
    from omniwheel.bringup.radio import watch_radio

    try:
        for window in watch_radio(robot, baud=baud):
            if as_json:
                print_json({**vars(window), "loss": window.loss}, one_line=True)
            else:
                console.print(_line(window))
    except KeyboardInterrupt:
        return


def _line(window: RadioWindow) -> str:
    bar = "█" * round(10 * window.answered / max(window.sent, 1))
    signal = "" if window.rssi is None else f"  RSSI {window.rssi}/{window.remote_rssi}"
    return (
        f"{bar:<10} {100 * window.loss:5.1f} % lost, from the robot {100 * window.down_loss:5.1f} %, "
        f"round trip {1e3 * window.percentile_s(0.5):4.0f} ms{signal}"
    )
