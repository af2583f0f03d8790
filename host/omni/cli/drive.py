# SPDX-License-Identifier: MIT
"""``omni drive``: move a connected robot. Whatever happens, it is disarmed at the end."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from typer.core import TyperGroup

from omni.cli import completion, host_control
from omni.cli.common import (
    LinkOption,
    TimeoutOption,
    console,
    examples,
    note,
    print_json,
    signals_interrupt,
)
from omni.cli.keyboard import KEYS_HELP, KeyDriver, raw_keys
from omni.cli.negative_numbers import NumberCommand
from omni.cli.options import DEFAULT_OUT, OutOption, stop_after_option, takes
from omni.cli.progress import Waiting
from omni.cli.robot_options import DriveOptions, LogOption
from omniwheel.errors import NotArrivedError, SetpointError
from omniwheel.frames import Pose
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.robots import parameter_table

if TYPE_CHECKING:
    from omniwheel.robot import Robot
    from omniwheel.telemetry import Tracking

HOST_CONTROL = "--host-control"


class DriveGroup(TyperGroup):
    """``omni drive --host-control ...`` is ``omni host-control ...``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the group's words."""
        return super().parse_args(ctx, ["host-control", *args[1:]] if args and args[0] == HOST_CONTROL else args)


app = typer.Typer(
    cls=DriveGroup,
    help="Move the robot. It is disarmed at the end and on Ctrl-C. With --host-control first, this is "
    "omni host-control: the original four-wheel robot, with the controller on this computer.",
    epilog=examples("omni drive trajectory rose", "omni drive pose 0.5 0 90deg", "omni drive keys"),
    no_args_is_help=True,
)
app.add_typer(host_control.app, name="host-control", hidden=True)

_SLICE_S = 0.25
_ARMED_S = 3.0
"""The robot's heartbeat says at once that it is armed, and once a second if that one got lost."""

DurationOption = Annotated[
    float, typer.Option("--duration", "-d", "--for", min=0.0, metavar="S", help="How long to drive.")
]
SpeedOption = Annotated[float, typer.Option("--speed", min=0.01, help="How fast to drive \\[m/s].")]
LapsOption = Annotated[
    float | None, typer.Option("--laps", min=0.0, help="Number of laps, instead of TRJ_LAPS; 0: endless.")
]
TurnOption = Annotated[float, typer.Option("--turn", min=0.01, help="Turn rate of the keys q and e \\[rad/s].")]


_TURN_DEG = 360.0
_ANGLE = re.compile(r"([-+0-9.eE]+|[-+]?inf|nan)\s*(deg|°|rad|)")


@contextmanager
def _armed(wanted: DriveOptions, asked: str, check: Callable[[Robot], object] = lambda _: None) -> Iterator[Robot]:
    """Connect, let ``check`` refuse what the robot cannot follow, then arm; disarm whatever happens.

    ``asked`` says in words what is driven.
    """
    from omniwheel.drive_log import DriveLog

    with ExitStack() as stack:
        stack.enter_context(signals_interrupt())
        log, quiet = None, wanted.as_json
        if wanted.log:
            log = stack.enter_context(DriveLog(wanted.out, "drive-" + asked.partition(" ")[0], asked))
        recorder = None if log is None else log.write
        robot = stack.enter_context(wanted.open(recorder))
        check(robot)
        if log is not None:
            stack.callback(log.leaving)
            log.connected(robot)
            stack.callback(
                note, f"[bold]{escape(str(log.folder))}[/]: run.png, drive.json, telemetry.tlog", quiet=quiet
            )
        try:
            robot.arm()
            robot.wait_until(lambda status: status.armed, _ARMED_S, "armed")
            note("armed; Ctrl-C stops and disarms", quiet=quiet)
            yield robot
        finally:
            if robot.armed_here:
                robot.disarm()
                note("disarmed", quiet=quiet)


def _drive_in_slices(robot: Robot, duration_s: float, ask: Callable[[], None], quiet: bool) -> None:
    """Repeat a setpoint until ``duration_s`` has passed, checking in between that the robot still drives."""
    start = robot.connection.clock()
    with Waiting("driving", duration_s, quiet=quiet) as waiting:
        while (left := start + duration_s - robot.connection.clock()) > 0.0:
            robot.repeat(ask, min(_SLICE_S, left))
            robot.guard.check()
            waiting.at(robot.connection.clock() - start)


def _result(robot: Robot, as_json: bool, **more: Any) -> None:
    from omniwheel.telemetry import Tracking

    pose = robot.wait_for(Tracking).pose
    quality = robot.status.quality
    if as_json:
        told = {} if quality is None else {"quality": quality.as_dict()}
        print_json({"pose": pose._asdict(), **more, **told})
    else:
        degrees = math.degrees(pose.theta)
        console.print(f"at x = {pose.x:.3f} m, y = {pose.y:.3f} m, theta = {pose.theta:.3f} rad ({degrees:.1f}°)")
        if quality is not None:
            console.print("; ".join(filter(None, (quality.text, quality.advice))), markup=False, highlight=False)


@app.command(
    "velocity",
    cls=NumberCommand,
    epilog=examples("omni drive velocity 0.1 0 0 --duration 2", "omni drive velocity 0 -0.05 0.3"),
)
@takes(DriveOptions)
def velocity(
    vx: Annotated[float, typer.Argument(help="Forward \\[m/s].")],
    vy: Annotated[float, typer.Argument(help="To the left \\[m/s].")],
    wz: Annotated[float, typer.Argument(help="Counter-clockwise \\[rad/s].")],
    duration: DurationOption = 1.0,
    world: Annotated[
        bool, typer.Option("--world-frame", help="Velocities in the world frame instead of the body's.")
    ] = False,
    *,
    wanted: DriveOptions,
) -> None:
    """Drive with a constant velocity for --duration seconds.

    A velocity that the robot cannot follow is refused before it arms; exit code 2.
    """
    from omniwheel.setpoints import finite

    frame = "world" if world else "body"
    for name, value in (("vx", vx), ("vy", vy), ("wz", wz)):
        finite(name, value)
    asked = f"velocity {vx:g} {vy:g} {wz:g}{' world' if world else ''} for {duration:g} s"
    check = partial(_require_velocity, vx=vx, vy=vy, wz=wz, frame=frame, duration_s=duration)
    with _armed(wanted, asked, check) as robot:
        with Waiting("driving", duration, quiet=wanted.as_json) as waiting:
            robot.drive(vx, vy, wz, duration, frame=frame, progress=_shown(robot, waiting))
        _result(robot, wanted.as_json)


def _shown(robot: Robot, waiting: Waiting) -> Callable[[object], None]:
    """Return what shows the time that a drive has lasted."""
    start = robot.connection.clock()
    return lambda _: waiting.at(robot.connection.clock() - start)


def _require_velocity(robot: Robot, vx: float, vy: float, wz: float, frame: str, duration_s: float) -> None:
    from omniwheel.telemetry import Tracking

    if frame == "world":
        robot.wait_for(Tracking)  # the heading decides which wheels have to be fast
    robot.require_velocity(vx, vy, wz, frame=frame, duration_s=duration_s)


def _angle(text: str) -> float:
    """Read an angle: radians, or degrees with their unit."""
    from omniwheel.setpoints import finite

    match = _ANGLE.fullmatch(text.strip())
    try:
        value = finite("theta", float(match.group(1))) if match else None
    except ValueError:
        value = None
    if match is None or value is None:
        raise SetpointError(f"theta is {text!r}; must be an angle", hint="give radians, or degrees like 90deg")
    if match.group(2) not in ("deg", "°"):
        return value
    if abs(value) > _TURN_DEG:
        hint = f"equal to {math.remainder(value, _TURN_DEG):g}deg"
        raise SetpointError(f"theta is {value:g}°; must be within ±360°", hint=hint)
    return math.radians(value)


@app.command("pose", cls=NumberCommand, epilog=examples("omni drive pose 0.5 0 1.57", "omni drive pose -0.5 0 -90deg"))
@takes(DriveOptions)
def pose(
    x: Annotated[float, typer.Argument(help="World x \\[m].")],
    y: Annotated[float, typer.Argument(help="World y \\[m].")],
    theta: Annotated[str, typer.Argument(help="World theta, counter-clockwise \\[rad]; degrees as 90deg.")],
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration",
            "-d",
            "--for",
            min=0.0,
            metavar="S",
            show_default=False,
            help="Timeout. Default: 1.5 × estimated travel time + 3 s.",
        ),
    ] = None,
    *,
    wanted: DriveOptions,
) -> None:
    """Drive to a world pose; ends when the robot has reached it.

    Exit code 1: not there in time. Exit code 2: a pose that the robot cannot reach, or not in this time.
    """
    from omniwheel.setpoints import finite

    goal = Pose(finite("x", x), finite("y", y), _angle(theta))
    allowed: list[float] = []  # [s], one entry: found out before the robot arms

    def plan(robot: Robot) -> None:
        allowed.append(robot.allowed_time_s(goal, duration))
        if duration is None:
            note(f"about {robot.travel_time_s(goal):.0f} s away", quiet=wanted.as_json)

    arrived = True
    with _armed(wanted, f"pose {x:g} {y:g} {theta}", plan) as robot:
        with Waiting("driving", allowed[0], quiet=wanted.as_json) as waiting:
            try:
                robot.drive_to(*goal, timeout_s=allowed[0], progress=_shown(robot, waiting))
            except NotArrivedError as error:
                arrived, why = False, f"{error}; a longer --duration may help"
        _result(robot, wanted.as_json, arrived=arrived)
    if not arrived:
        note(why)
        raise typer.Exit(1)


@app.command("trajectory", epilog=examples("omni drive trajectory rose", "omni drive trajectory circle --laps 2"))
@takes(DriveOptions)
def trajectory(
    type_name: Annotated[
        str,
        typer.Argument(
            metavar="TYPE",
            help="A value of TRJ_TYPE: rose, circle, ...; `omni params list TRJ_TYPE` shows all.",
            autocompletion=completion.trajectories,
        ),
    ],
    laps: LapsOption = None,
    duration: Annotated[float, stop_after_option(0.0, "no limit")] = math.inf,
    *,
    wanted: DriveOptions,
) -> None:
    """Follow the on-board trajectory that the TRJ_* parameters describe, until it is done."""
    from omniwheel.parameters import checked_value

    checked_value(parameter_table(), "TRJ_TYPE", type_name)
    with _armed(wanted, f"trajectory {type_name}") as robot:
        phase = _to_the_end(wanted, partial(robot.follow_trajectory, type_name, laps, timeout_s=duration))
        _result(robot, wanted.as_json, phase=phase)


@app.command("path", epilog=examples("omni drive path line.csv --speed 0.3", "omni drive path loop.csv --laps 3"))
@takes(DriveOptions)
def path(
    file: Annotated[Path, typer.Argument(metavar="LINE.csv", help="World x and y \\[m] of a point on each line.")],
    speed: SpeedOption = 0.2,
    laps: LapsOption = None,
    heading: Annotated[
        str | None,
        typer.Option(
            "--heading",
            show_default=False,
            help="Heading along the whole path \\[rad], or 90deg. Default: the path's direction.",
        ),
    ] = None,
    duration: Annotated[float, stop_after_option(0.0, "no limit")] = math.inf,
    *,
    wanted: DriveOptions,
) -> None:
    """Follow a line of a file on a smooth path, without a stop at its points.

    The robot gets 32 points of it and slows down to what its limits need. Without --laps it drives once, from end to
    end. With more laps the line is closed.
    """
    from omniwheel.drawn_path import drawn_path, read_line

    heading_rad = None if heading is None else _angle(heading)
    line = drawn_path(read_line(file), speed, heading_rad=heading_rad, laps=1.0 if laps is None else laps)
    with _armed(wanted, f"path {file.name}", line.require) as robot:
        phase = _to_the_end(wanted, partial(robot.follow, line, timeout_s=duration))
        _result(robot, wanted.as_json, phase=phase)


def _to_the_end(wanted: DriveOptions, follow: Callable[..., object]) -> str:
    """Follow a path to its end, or until its time is over; return the phase it was in."""
    phases = ["none"]
    with Waiting("on the path", math.inf, quiet=wanted.as_json) as waiting:

        def show(tracking: Tracking) -> None:
            phases.append(tracking.phase)
            waiting.at(tracking.path_time_s)

        with suppress(NotArrivedError):
            follow(progress=show)
    return phases[-1]


@app.command(
    "duty", cls=NumberCommand, epilog=examples("omni drive duty 0.2 0.2 0.2 --duration 2", "omni drive duty -0.3 0 0")
)
@takes(DriveOptions)
def duty(
    duties: Annotated[
        list[float],
        typer.Argument(
            metavar="DUTY...", help="Duty cycle of each wheel, -1 to 1; + turns the body counter-clockwise."
        ),
    ],
    duration: DurationOption = 1.0,
    *,
    wanted: DriveOptions,
) -> None:
    """Drive the motors open loop with constant duty cycles, for bring-up and identification. Lift the wheels first."""
    from omniwheel.setpoints import check_duty

    check_duty(duties)
    asked = f"duty {' '.join(f'{value:g}' for value in duties)} for {duration:g} s"
    with _armed(wanted, asked, lambda r: r.require_duty(duties)) as robot:
        _drive_in_slices(robot, duration, lambda: robot.set_duty(duties), wanted.as_json)
        robot.drive_duty([0.0] * len(duties), _SLICE_S)
        _result(robot, wanted.as_json)


@app.command("keys", epilog=examples("omni drive keys", "omni drive keys --speed 0.15 --turn 0.5"))
def keys(
    speed: SpeedOption = 0.1,
    turn: TurnOption = 0.5,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    out: OutOption = DEFAULT_OUT,
    log: LogOption = True,
) -> None:
    """Drive with the keyboard."""
    from omniwheel.robot import SETPOINT_PERIOD_S

    wanted = DriveOptions(link, timeout, out=out, log=log)
    check = partial(_require_keys, speed=speed, turn=turn)
    with raw_keys() as read_key, _armed(wanted, "keys", check) as robot:
        note(KEYS_HELP)
        driver = KeyDriver(speed, turn)
        while driver.take(read_key(), robot.connection.clock()):
            twist = driver.twist(robot.connection.clock())
            robot.set_velocity(*twist)
            robot.pump(SETPOINT_PERIOD_S)
            robot.guard.check()


def _require_keys(robot: Robot, speed: float, turn: float) -> None:
    for twist in ((speed, 0.0, 0.0), (0.0, speed, 0.0), (0.0, 0.0, turn)):
        robot.require_velocity(*twist)
