# SPDX-License-Identifier: MIT
"""``omni bringup``: from bare boards to a driving robot, a check at each step."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
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
from omni.cli.options import BaudOption, measure_option, page_option, takes
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
    from omniwheel.bringup import Result
    from omniwheel.bringup.radio import RadioWindow
    from omniwheel.robot import Robot

app = typer.Typer(
    help="Check a new robot step by step. Each check passes or names what to correct. It is disarmed at the end, on "
    "Ctrl-C and on any error.",
    no_args_is_help=True,
)

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
DutyOption = Annotated[float, typer.Option("--duty", min=0.05, max=0.5, help="Duty cycle of the motors, 0 to 1.")]


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


def _checked(wanted: RobotOptions, yes: bool | None, check: Callable[..., Result]) -> None:
    """Run a check and print it. ``yes``: what --yes says; None where there is no such option."""
    from omniwheel.bringup import Assumed

    with wanted.open() as robot:
        result = check(robot, Assumed() if yes else TerminalPerson(robot, may_be_assumed=yes is not None))
    _finish(result, wanted.as_json)


@app.command(
    "link", epilog=examples("omni bringup link", "omni bringup link --robot mine.toml --radio /dev/ttyUSB0,9600")
)
@takes(RobotOptions)
def link_command(
    robot_file: RobotFileOption = None,
    radio: RadioOption = None,
    *,
    wanted: RobotOptions,
) -> None:
    """Check the link: heartbeats, firmware and parameter versions, the robot's numbers, latency, restarts."""
    from omniwheel.bringup import check_link

    file = None if robot_file is None else read_robot(robot_file)
    with ExitStack() as stack:
        robot = stack.enter_context(wanted.open())
        other = None if radio is None else stack.enter_context(open_robot(radio, timeout_s=wanted.timeout))
        result = check_link(robot, file, other)
    _finish(result, wanted.as_json)


@app.command("i2c", epilog=examples("omni bringup i2c"))
@takes(RobotOptions)
def i2c(*, wanted: RobotOptions) -> None:
    """Scan the I2C bus and list the devices that respond. The PWM board must respond at 0x40."""
    from omniwheel.bringup import check_i2c

    _checked(wanted, True, lambda robot, _: check_i2c(robot))


@app.command("encoders", epilog=examples("omni bringup encoders"))
@takes(RobotOptions)
def encoders(*, wanted: RobotOptions) -> None:
    """Check the encoders while you turn each wheel by hand: order, direction, counts, noise. Nothing is armed."""
    from omniwheel.bringup import check_encoders

    _checked(wanted, None, check_encoders)


@app.command("motors", epilog=examples("omni bringup motors", "omni bringup motors --duty 0.3 --yes --json"))
@takes(RobotOptions)
def motors(
    duty: DutyOption = MOTORS_DUTY,
    yes: YesOption = False,
    *,
    wanted: RobotOptions,
) -> None:
    """Check the motors on a stand, wheel by wheel at low duty: order, direction, speed, deadband."""
    from omniwheel.bringup import check_motors

    _checked(wanted, yes, lambda robot, person: check_motors(robot, person, duty=duty))


@app.command("estop", epilog=examples("omni bringup estop", "omni bringup estop --yes --json"))
@takes(RobotOptions)
def estop(
    yes: YesOption = False,
    *,
    wanted: RobotOptions,
) -> None:
    """On a stand, measure how soon the wheels stop after an e-stop, and after setpoints or heartbeats are lost."""
    from omniwheel.bringup import check_stops

    _checked(wanted, yes, check_stops)


@app.command(
    "oe", epilog=examples("omni bringup oe", "omni bringup oe --robot mine.toml", "omni bringup oe --yes --json")
)
@takes(RobotOptions)
def output_enable(
    robot_file: RobotFileOption = None,
    duty: Annotated[
        float,
        typer.Option(
            "--duty",
            min=0.05,
            max=OUTPUT_ENABLE_LARGEST_DUTY,
            help="Duty cycle of the motors during the check, 0 to 1.",
        ),
    ] = OUTPUT_ENABLE_DUTY,
    yes: YesOption = False,
    *,
    wanted: RobotOptions,
) -> None:
    """On a stand, check that the output-enable pin stops the wheels, and that its pull-up does so too."""
    from omniwheel.bringup import check_output_enable

    file = None if robot_file is None else read_robot(robot_file)
    _checked(
        wanted,
        yes,
        lambda robot, person: check_output_enable(robot, person, duty=duty, file=file),
    )


@app.command("button", epilog=examples("omni bringup button", "omni bringup button --robot mine.toml"))
@takes(RobotOptions)
def stop_button(
    robot_file: RobotFileOption = None,
    *,
    wanted: RobotOptions,
) -> None:
    """On a stand, check that the stop button stops the wheels until a release. You press it when prompted."""
    from omniwheel.bringup import check_stop_button

    file = None if robot_file is None else read_robot(robot_file)
    _checked(wanted, None, lambda robot, person: check_stop_button(robot, person, file=file))


@app.command("gyro", epilog=examples("omni bringup gyro", "omni bringup gyro --robot mine.toml --json"))
@takes(RobotOptions)
def gyro(
    robot_file: RobotFileOption = None,
    *,
    wanted: RobotOptions,
) -> None:
    """Check the gyro's bias at rest, its sign and scale. You turn the robot by hand when prompted; no motor turns."""
    from omniwheel.bringup import check_gyro

    file = None if robot_file is None else read_robot(robot_file)
    _checked(wanted, None, lambda robot, person: check_gyro(robot, person, file=file))


@app.command("flow", epilog=examples("omni bringup flow", "omni bringup flow --robot mine.toml --json"))
@takes(RobotOptions)
def flow(
    robot_file: RobotFileOption = None,
    *,
    wanted: RobotOptions,
) -> None:
    """Check the floor odometry sensor's direction and scale. You push the robot by hand; no motor turns."""
    from omniwheel.bringup import check_flow

    file = None if robot_file is None else read_robot(robot_file)
    _checked(wanted, None, lambda robot, person: check_flow(robot, person, file=file))


@app.command("drive", epilog=examples("omni bringup drive"))
@takes(RobotOptions)
def drive(
    yes: YesOption = False,
    *,
    wanted: RobotOptions,
) -> None:
    """On the floor, drive a square of 20 cm and turn twice at low speed, and check directions and odometry."""
    from omniwheel.bringup import check_drive

    _checked(wanted, yes, check_drive)


@app.command(
    "radio", epilog=examples("omni bringup radio --link /dev/ttyUSB0,9600", "omni bringup radio --watch -l COM7,9600")
)
@takes(RobotOptions)
def radio_command(
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
    """Measure packet loss and round-trip time of the radio --link, with 30 % of its bandwidth at most."""
    from omniwheel.bringup import check_radio

    with wanted.open() as robot:
        if watch:
            _watch(robot, baud, wanted.as_json)
            return
        note(f"pinging for {duration:g} s …", quiet=wanted.as_json)
        result = check_radio(robot, duration_s=duration, baud=baud, loss_limit=loss, round_trip_limit_s=round_trip)
    _finish(result, wanted.as_json)


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


@app.command("all", epilog=examples("omni bringup all --robot mine.toml", "omni bringup all --radio /dev/ttyUSB0,9600"))
@takes(RobotOptions)
def all_command(
    robot_file: RobotFileOption = None,
    radio: RadioOption = None,
    baud: BaudOption = RADIO_BAUD,
    keep_going: Annotated[bool, typer.Option("--keep-going", help="Continue after a check that fails.")] = False,
    folder: Annotated[
        Path,
        page_option("DIR", exists=True, file_okay=False),
    ] = Path(),
    yes: YesOption = False,
    *,
    wanted: RobotOptions,
) -> None:
    """Run all checks in order, up to the first that fails; write bringup.json and bringup.md."""
    from omniwheel.bringup import Assumed
    from omniwheel.bringup.results_page import FILES, TITLE, as_dict, write_results
    from omniwheel.bringup.sequence import bring_up

    file = None if robot_file is None else read_robot(robot_file)
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
