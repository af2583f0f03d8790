# SPDX-License-Identifier: MIT
"""``omni drive``: move a connected robot. Whatever happens, it is disarmed at the end."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from omniwheel.capability.reach import SETTLING_S, travel_time_s
from omniwheel.cli import completion, host_control
from omniwheel.cli.common import (
    JsonOption,
    LinkOption,
    TimeoutOption,
    console,
    examples,
    note,
    open_robot,
    print_json,
    signals_interrupt,
)
from omniwheel.cli.keyboard import KEYS_HELP, KeyDriver, raw_keys
from omniwheel.cli.negative_numbers import NumberCommand
from omniwheel.cli.progress import Waiting
from omniwheel.drive_log import DriveLog
from omniwheel.errors import LimitError, OmniError, SetpointError
from omniwheel.frames import Pose
from omniwheel.parameters import checked_value
from omniwheel.robot import DEFAULT_TIMEOUT_S, Robot
from omniwheel.robots import parameter_table
from omniwheel.setpoints import check_duty, finite
from omniwheel.telemetry import Tracking

HOST_CONTROL = ("--host-control", "--legacy")
"""The option, and its old name for one more release."""


class DriveGroup(TyperGroup):
    """``omni drive --host-control ...`` is ``omni host-control ...``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the group's words."""
        return super().parse_args(ctx, ["host-control", *args[1:]] if args and args[0] in HOST_CONTROL else args)


app = typer.Typer(
    cls=DriveGroup,
    help="Move the robot. It is disarmed at the end and on Ctrl-C. With --host-control first, this is "
    "omni host-control: the original four-wheel robot, with the controller on this computer.",
    no_args_is_help=True,
)
app.add_typer(host_control.app, name="host-control", hidden=True)

_SLICE_S = 0.25
_SETTLED_M = 0.005
_SETTLED_RAD = 0.02

DurationOption = Annotated[
    float, typer.Option("--duration", "-d", "--for", min=0.0, metavar="S", help="How long to drive.")
]
OutOption = Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the drive's folder is made.")]
LogOption = Annotated[
    bool, typer.Option("--log/--no-log", help="Keep telemetry, parameters and a picture of the drive.")
]
DEFAULT_OUT = Path("runs")
SpeedOption = Annotated[float, typer.Option("--speed", min=0.01, help="Speed of the arrow keys \\[m/s].")]
TurnOption = Annotated[float, typer.Option("--turn", min=0.01, help="Turn rate of the keys q and e \\[rad/s].")]


class StoppedError(OmniError):
    """The robot stopped by itself while it was to drive."""


_PATIENCE = 1.5
"""Time for a pose by the time that it should take, where no --duration is given."""
_ANGLE = re.compile(r"([-+0-9.eE]+|[-+]?inf|nan)\s*(deg|°|rad|)")


@contextmanager
def _armed(
    link: str | None,
    timeout_s: float,
    quiet: bool,
    check: Callable[[Robot], object] = lambda _: None,
    *,
    keep: Path | None = None,
    asked: str = "",
) -> Iterator[Robot]:
    """Connect, let ``check`` refuse what the robot cannot follow, then arm; disarm whatever happens.

    ``keep`` is where the drive's folder is made, None for none; ``asked`` says in words what is driven.
    """
    with ExitStack() as stack:
        stack.enter_context(signals_interrupt())
        log = None
        if keep is not None:
            log = stack.enter_context(DriveLog(keep, "drive-" + asked.partition(" ")[0], asked))
        recorder = None if log is None else log.write
        robot = stack.enter_context(open_robot(link, timeout_s=timeout_s, recorder=recorder))
        check(robot)
        if log is not None:
            stack.callback(log.leaving)
            log.connected(robot)
            stack.callback(note, f"[bold]{log.folder}[/]: report.png, drive.json, telemetry.tlog", quiet=quiet)
        try:
            robot.arm()
            note("armed; Ctrl-C stops and disarms", quiet=quiet)
            yield robot
        finally:
            if robot.armed_here:
                robot.disarm()
                note("disarmed", quiet=quiet)


def _check_still_armed(robot: Robot) -> None:
    if robot.status.state in ("failsafe", "estop"):
        safety = robot.status.safety
        faults = ", ".join(safety.fault_history or safety.faults) if safety is not None else ""
        hint = "`omni monitor` shows the faults; disarming clears the failsafe"
        raise StoppedError(f"the robot stopped itself ({robot.status.state}): {faults or 'no fault named'}", hint=hint)


def _drive_in_slices(robot: Robot, duration_s: float, step: Any, quiet: bool) -> None:
    """Call ``step(seconds)`` until ``duration_s`` has passed, checking in between that the robot still drives."""
    start = robot.connection.clock()
    with Waiting("driving", duration_s, quiet=quiet) as waiting:
        while (left := start + duration_s - robot.connection.clock()) > 0.0:
            step(min(_SLICE_S, left))
            _check_still_armed(robot)
            waiting.at(robot.connection.clock() - start)


def _result(robot: Robot, as_json: bool, **more: Any) -> None:
    pose = robot.wait_for(Tracking).pose
    if as_json:
        print_json({"pose": pose._asdict(), **more})
    else:
        degrees = math.degrees(pose.theta)
        console.print(f"at x = {pose.x:.3f} m, y = {pose.y:.3f} m, theta = {pose.theta:.3f} rad ({degrees:.1f}°)")


@app.command(
    "velocity",
    cls=NumberCommand,
    epilog=examples("omni drive velocity 0.1 0 0 --duration 2", "omni drive velocity 0 -0.05 0.3"),
)
def velocity(
    vx: Annotated[float, typer.Argument(help="Forward \\[m/s].")],
    vy: Annotated[float, typer.Argument(help="To the left \\[m/s].")],
    wz: Annotated[float, typer.Argument(help="Counter-clockwise \\[rad/s].")],
    duration: DurationOption = 1.0,
    world: Annotated[
        bool, typer.Option("--world", help="Velocities in the world frame instead of the body's.")
    ] = False,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    out: OutOption = DEFAULT_OUT,
    log: LogOption = True,
    as_json: JsonOption = False,
) -> None:
    """Drive with a constant velocity for a while.

    A velocity that the robot cannot follow is refused before it arms; exit code 2.
    """
    frame = "world" if world else "body"
    for name, value in (("vx", vx), ("vy", vy), ("wz", wz)):
        finite(name, value)
    keep, asked = (out if log else None), f"velocity {vx:g} {vy:g} {wz:g}{' world' if world else ''} for {duration:g} s"
    check = partial(_require_velocity, vx=vx, vy=vy, wz=wz, frame=frame)
    with _armed(link, timeout, as_json, check, keep=keep, asked=asked) as robot:
        action = partial(robot.drive_velocity, vx, vy, wz, frame=frame, stop=False)
        _drive_in_slices(robot, duration, action, as_json)
        robot.drive_velocity(0.0, 0.0, 0.0, _SLICE_S)
        _result(robot, as_json)


def _require_velocity(robot: Robot, vx: float, vy: float, wz: float, frame: str) -> None:
    if frame == "world":
        robot.wait_for(Tracking)  # the heading decides which wheels have to be fast
    robot.require_velocity(vx, vy, wz, frame=frame)


def _angle(text: str) -> float:
    """Read an angle: radians, or degrees with their unit."""
    match = _ANGLE.fullmatch(text.strip())
    try:
        value = finite("theta", float(match.group(1))) if match else None
    except ValueError:
        value = None
    if match is None or value is None:
        raise SetpointError(f"theta is {text!r}; an angle is needed", hint="radians, or degrees like 90deg")
    return math.radians(value) if match.group(2) in ("deg", "°") else value


@app.command("pose", cls=NumberCommand, epilog=examples("omni drive pose 0.5 0 1.57", "omni drive pose -0.5 0 -90deg"))
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
            help="Give up after this time. Default: half as long again as the way should take.",
        ),
    ] = None,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    out: OutOption = DEFAULT_OUT,
    log: LogOption = True,
    as_json: JsonOption = False,
) -> None:
    """Drive to a world pose; ends early once the robot is there.

    Exit code 1: not there in time. Exit code 2: a pose that the robot cannot reach, or not in this time.
    """
    goal = Pose(finite("x", x), finite("y", y), _angle(theta))
    allowed_s = duration

    def plan(robot: Robot) -> None:
        nonlocal allowed_s
        allowed_s = _allowed_time(robot, goal, duration, as_json)

    keep = out if log else None
    with _armed(link, timeout, as_json, plan, keep=keep, asked=f"pose {x:g} {y:g} {theta}") as robot:
        start = robot.connection.clock()
        with Waiting("driving", allowed_s or 0.0, quiet=as_json) as waiting:
            while (passed := robot.connection.clock() - start) < (allowed_s or 0.0) and not _is_at(robot, goal):
                robot.drive_pose(*goal, _SLICE_S)
                _check_still_armed(robot)
                waiting.at(passed)
        arrived = _is_at(robot, goal)
        _result(robot, as_json, arrived=arrived)
        way, turn = _distance(robot, goal)
    if not arrived:
        note(f"still {way * 1e3:.0f} mm and {turn:.3f} rad away after {allowed_s:.3g} s; a longer --duration may help")
        raise typer.Exit(1)


def _allowed_time(robot: Robot, goal: Pose, duration_s: float | None, quiet: bool) -> float:
    """Return how long the robot may take; refuse a pose out of reach, or a time in which no way leads there."""
    robot.require_pose(*goal)
    here = robot.wait_for(Tracking).pose
    needed_s = travel_time_s(robot.drive_model(), here, goal, robot.parameters["TRJ_MARGIN"])
    if duration_s is None:
        note(f"about {needed_s:.0f} s away", quiet=quiet)
        return _PATIENCE * needed_s
    if duration_s < needed_s - SETTLING_S:
        way = math.hypot(here.x - goal.x, here.y - goal.y)
        raise LimitError(
            f"{way:.2f} m take this robot about {needed_s:.0f} s, --duration is {duration_s:g} s",
            hint="leave --duration out, or see what limits the robot: omni robots check",
        )
    return duration_s


def _distance(robot: Robot, goal: Pose) -> tuple[float, float]:
    """Return metres and radians from the robot's estimated pose to ``goal``, infinite before the first estimate."""
    tracking = robot.status.tracking
    if tracking is None:
        return math.inf, math.inf
    here = tracking.pose
    return math.hypot(here.x - goal.x, here.y - goal.y), abs(math.remainder(here.theta - goal.theta, math.tau))


def _is_at(robot: Robot, goal: Pose) -> bool:
    way, turn = _distance(robot, goal)
    return way < _SETTLED_M and turn < _SETTLED_RAD


@app.command("trajectory", epilog=examples("omni drive trajectory rose", "omni drive trajectory circle --laps 2"))
def trajectory(
    type_name: Annotated[
        str,
        typer.Argument(
            metavar="TYPE", help="hold, line, circle, rose, report, random, ...", autocompletion=completion.trajectories
        ),
    ],
    laps: Annotated[float | None, typer.Option("--laps", min=0.0, help="Instead of TRJ_LAPS; 0: endless.")] = None,
    duration: Annotated[
        float, typer.Option("--duration", "-d", "--for", min=0.0, metavar="S", help="Stop then at the latest.")
    ] = math.inf,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    out: OutOption = DEFAULT_OUT,
    log: LogOption = True,
    as_json: JsonOption = False,
) -> None:
    """Follow the on-board trajectory that the TRJ_* parameters describe, until it is done."""
    checked_value(parameter_table(), "TRJ_TYPE", type_name)
    keep = out if log else None
    with _armed(link, timeout, as_json, keep=keep, asked=f"trajectory {type_name}") as robot:
        robot.start_trajectory(type_name, laps)
        tracking = _until_done(robot, duration, as_json)
        robot.stop_trajectory()
        _result(robot, as_json, phase=tracking.phase)


def _until_done(robot: Robot, duration_s: float, quiet: bool) -> Tracking:
    """Return the robot's last words of a path: it is done, or its time is over."""
    start = robot.connection.clock()
    started = False
    with Waiting("on the path", math.inf, quiet=quiet) as waiting:
        for tracking in robot.telemetry(Tracking):
            _check_still_armed(robot)
            passed = robot.connection.clock() - start
            waiting.at(passed)
            started = started or tracking.phase in ("lead-in", "path")
            if (started and tracking.phase == "done") or passed > duration_s:
                return tracking
    raise AssertionError("telemetry() ends only by an exception")


@app.command(
    "duty", cls=NumberCommand, epilog=examples("omni drive duty 0.2 0.2 0.2 --duration 2", "omni drive duty -0.3 0 0")
)
def duty(
    duties: Annotated[list[float], typer.Argument(metavar="DUTY...", help="-1..1 per wheel, + counter-clockwise.")],
    duration: DurationOption = 1.0,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    out: OutOption = DEFAULT_OUT,
    log: LogOption = True,
    as_json: JsonOption = False,
) -> None:
    """Put constant duties on the motors, open loop, for a while: bring-up and identification. Lift the wheels first."""
    check_duty(duties)
    keep, asked = (out if log else None), f"duty {' '.join(f'{value:g}' for value in duties)} for {duration:g} s"
    with _armed(link, timeout, as_json, lambda r: r.require_duty(duties), keep=keep, asked=asked) as robot:
        _drive_in_slices(robot, duration, partial(robot.drive_duty, duties, stop=False), as_json)
        robot.drive_duty([0.0] * len(duties), _SLICE_S)
        _result(robot, as_json)


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
    keep, check = (out if log else None), partial(_require_keys, speed=speed, turn=turn)
    with raw_keys() as read_key, _armed(link, timeout, False, check, keep=keep, asked="keys") as robot:
        note(KEYS_HELP)
        driver = KeyDriver(speed, turn)
        while driver.take(read_key(), robot.connection.clock()):
            twist = driver.twist(robot.connection.clock())
            robot.drive_velocity(*twist, duration_s=0.05, stop=False)
            _check_still_armed(robot)


def _require_keys(robot: Robot, speed: float, turn: float) -> None:
    for twist in ((speed, 0.0, 0.0), (0.0, speed, 0.0), (0.0, 0.0, turn)):
        robot.require_velocity(*twist)
