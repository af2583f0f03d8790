# SPDX-License-Identifier: MIT
"""``omni bringup``: from bare boards to a driving robot, a check at each step."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from omniwheel.bringup import (
    Assumed,
    Person,
    Result,
    check_drive,
    check_encoders,
    check_i2c,
    check_link,
    check_motors,
    check_output_enable,
    check_radio,
    check_stop_button,
    check_stops,
)
from omniwheel.bringup import motors as motors_module
from omniwheel.bringup import output_enable as output_enable_module
from omniwheel.bringup.radio import BAUD, LOSS_LIMIT, ROUND_TRIP_LIMIT_S, RadioWindow, watch_radio
from omniwheel.bringup.results_page import as_dict, write_results
from omniwheel.bringup.sequence import bring_up
from omniwheel.cli import completion
from omniwheel.cli.bringup_person import TerminalPerson
from omniwheel.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    note,
    open_robot,
    print_json,
)
from omniwheel.errors import OutputFileError
from omniwheel.robot import DEFAULT_TIMEOUT_S, Robot
from omniwheel.robots import read_robot

app = typer.Typer(
    help="Check a new robot step by step: pass, or what to do. It is disarmed at the end, on Ctrl-C and on any error.",
    no_args_is_help=True,
)

YesOption = Annotated[
    bool,
    typer.Option("--yes", "-y", help="Ask nothing: the robot is ready, and nobody looks at it. Mind your fingers."),
]
RobotFileOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        "-r",
        metavar="NAME|FILE",
        help="The robot file it should have.",
        show_default=False,
        autocompletion=completion.robots,
    ),
]
RadioOption = Annotated[
    str | None,
    typer.Option("--radio", metavar="URL", help="The same robot over its other link.", show_default=False),
]
BaudOption = Annotated[int, typer.Option("--baud", min=1200, help="The radio's, for the share of bytes to use.")]
DutyOption = Annotated[float, typer.Option("--duty", min=0.05, max=0.5, help="How hard the motors are driven, 0..1.")]


@contextmanager
def _session(link: str | None, timeout_s: float, yes: bool) -> Iterator[tuple[Robot, Person]]:
    with open_robot(link, timeout_s=timeout_s) as robot:
        yield robot, Assumed() if yes else TerminalPerson(robot)


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


def _checked(link: str | None, timeout_s: float, as_json: bool, yes: bool, check: Callable[..., Result]) -> None:
    with _session(link, timeout_s, yes) as (robot, person):
        result = check(robot, person)
    _finish(result, as_json)


@app.command(
    "link", epilog=examples("omni bringup link", "omni bringup link --robot mine.toml --radio /dev/ttyUSB0,9600")
)
def link_command(
    robot_file: RobotFileOption = None,
    radio: RadioOption = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Heartbeats, firmware and parameter versions, the robot's numbers, latency, restarts."""
    file = None if robot_file is None else read_robot(robot_file)
    with ExitStack() as stack:
        robot = stack.enter_context(open_robot(link, timeout_s=timeout))
        other = None if radio is None else stack.enter_context(open_robot(radio, timeout_s=timeout))
        result = check_link(robot, file, other)
    _finish(result, as_json)


@app.command("i2c", epilog=examples("omni bringup i2c"))
def i2c(link: LinkOption = None, timeout: TimeoutOption = DEFAULT_TIMEOUT_S, as_json: JsonOption = False) -> None:
    """Ask who answers on the I2C bus: the PWM board should, at 0x40."""
    _checked(link, timeout, as_json, True, lambda robot, _: check_i2c(robot))


@app.command("encoders", epilog=examples("omni bringup encoders"))
def encoders(link: LinkOption = None, timeout: TimeoutOption = DEFAULT_TIMEOUT_S, as_json: JsonOption = False) -> None:
    """Turn each wheel by hand when asked: right encoder, direction, counts per turn, noise. Nothing is armed."""
    _checked(link, timeout, as_json, False, check_encoders)


@app.command("motors", epilog=examples("omni bringup motors", "omni bringup motors --duty 0.3 --yes --json"))
def motors(
    duty: DutyOption = motors_module.DUTY,
    yes: YesOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """On a stand, wheel by wheel at low duty: right motor, direction, speed, dead band."""
    _checked(link, timeout, as_json, yes, lambda robot, person: check_motors(robot, person, duty=duty))


@app.command("estop", epilog=examples("omni bringup estop", "omni bringup estop --yes --json"))
def estop(
    yes: YesOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """On a stand, wheels turning: emergency stop, stop without set-points, stop without heartbeats, and how soon."""
    _checked(link, timeout, as_json, yes, check_stops)


@app.command(
    "oe", epilog=examples("omni bringup oe", "omni bringup oe --robot mine.toml", "omni bringup oe --yes --json")
)
def output_enable(
    robot_file: RobotFileOption = None,
    duty: Annotated[
        float, typer.Option("--duty", min=0.05, max=output_enable_module.LARGEST_DUTY, help="How hard, 0..0.3.")
    ] = output_enable_module.DUTY,
    yes: YesOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """On a stand, wheels turning: the output-enable pin alone stops them, and its pull-up when nobody drives it."""
    file = None if robot_file is None else read_robot(robot_file)
    _checked(
        link,
        timeout,
        as_json,
        yes,
        lambda robot, person: check_output_enable(robot, person, duty=duty, file=file),
    )


@app.command("button", epilog=examples("omni bringup button", "omni bringup button --robot mine.toml"))
def stop_button(
    robot_file: RobotFileOption = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """On a stand, wheels turning: press the stop button when asked; it stops, holds, and needs a release."""
    file = None if robot_file is None else read_robot(robot_file)
    _checked(link, timeout, as_json, False, lambda robot, person: check_stop_button(robot, person, file=file))


@app.command("drive", epilog=examples("omni bringup drive"))
def drive(
    yes: YesOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """On the floor: a square of 20 cm and two turns at low speed; directions and odometry must agree."""
    _checked(link, timeout, as_json, yes, check_drive)


@app.command(
    "radio", epilog=examples("omni bringup radio --link /dev/ttyUSB0,9600", "omni bringup radio --watch -l COM7,9600")
)
def radio_command(
    duration: Annotated[
        float, typer.Option("--duration", "-d", "--for", min=1.0, metavar="S", help="How long to measure.")
    ] = 10.0,
    baud: BaudOption = BAUD,
    loss: Annotated[float, typer.Option("--loss", min=0.0, max=1.0, help="Share that may get lost.")] = LOSS_LIMIT,
    round_trip: Annotated[
        float, typer.Option("--round-trip", min=0.001, metavar="S", help="Longest of 95 % of the round trips.")
    ] = ROUND_TRIP_LIMIT_S,
    watch: Annotated[
        bool, typer.Option("--watch", help="A line every 2 s until Ctrl-C: for a walk with the robot.")
    ] = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Round trips and losses of the radio, within 30 % of its bytes. Connect over the radio."""
    with open_robot(link, timeout_s=timeout) as robot:
        if watch:
            _watch(robot, baud, as_json)
            return
        note(f"pinging for {duration:g} s …", quiet=as_json)
        result = check_radio(robot, duration_s=duration, baud=baud, loss_limit=loss, round_trip_limit_s=round_trip)
    _finish(result, as_json)


def _watch(robot: Robot, baud: int, as_json: bool) -> None:
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
def all_command(
    robot_file: RobotFileOption = None,
    radio: RadioOption = None,
    baud: BaudOption = BAUD,
    keep_going: Annotated[bool, typer.Option("--keep-going", help="Go on after a check that fails.")] = False,
    folder: Annotated[
        Path, typer.Option("--folder", metavar="DIR", exists=True, file_okay=False, help="Where the report goes.")
    ] = Path(),
    yes: YesOption = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """All of them in order, up to the first that fails; leaves bringup.json and bringup.md."""
    file = None if robot_file is None else read_robot(robot_file)
    title = "Bring-up" if file is None else f"Bring-up of {file.name}"
    results: list[Result] = []
    with ExitStack() as stack:
        robot = stack.enter_context(open_robot(link, timeout_s=timeout))
        others = [] if radio is None else [stack.enter_context(open_robot(radio, timeout_s=timeout))]
        person = Assumed() if yes else TerminalPerson(robot, *others)
        try:
            for result in bring_up(
                robot, person, file=file, radio=others[0] if others else None, baud=baud, keep_going=keep_going
            ):
                results.append(result)
                if not as_json:
                    _print(result)
        except BaseException:
            with suppress(OutputFileError):  # what went wrong with the robot is to be heard
                write_results(results, folder, title)
            raise
    paths = write_results(results, folder, title)
    note(f"report: {paths[0]}, {paths[1]}", quiet=as_json)
    if as_json:
        print_json(as_dict(results))
    if not all(result.ok for result in results):
        raise typer.Exit(1)
