# SPDX-License-Identifier: MIT
"""``omni drive``: move a connected robot. Whatever happens, it is disarmed at the end."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

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
from omniwheel.errors import OmniError
from omniwheel.robot import DEFAULT_TIMEOUT_S, Robot
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
SpeedOption = Annotated[float, typer.Option("--speed", min=0.01, help="Speed of the arrow keys \\[m/s].")]
TurnOption = Annotated[float, typer.Option("--turn", min=0.01, help="Turn rate of the keys q and e \\[rad/s].")]


class StoppedError(OmniError):
    """The robot stopped by itself while it was to drive."""


@contextmanager
def _armed(link: str | None, timeout_s: float, quiet: bool) -> Iterator[Robot]:
    with signals_interrupt(), open_robot(link, timeout_s=timeout_s) as robot:
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


def _drive_in_slices(robot: Robot, duration_s: float, step: Any) -> None:
    """Call ``step(seconds)`` until ``duration_s`` has passed, checking in between that the robot still drives."""
    end = robot.connection.clock() + duration_s
    while (left := end - robot.connection.clock()) > 0.0:
        step(min(_SLICE_S, left))
        _check_still_armed(robot)


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
    epilog=examples("omni drive velocity 0.1 0 0 --duration 2", "omni drive velocity 0 -0.1 0.5"),
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
    as_json: JsonOption = False,
) -> None:
    """Drive with a constant velocity for a while."""
    frame = "world" if world else "body"
    for name, value in (("vx", vx), ("vy", vy), ("wz", wz)):
        finite(name, value)
    with _armed(link, timeout, as_json) as robot:
        _drive_in_slices(robot, duration, lambda s: robot.drive_velocity(vx, vy, wz, s, frame=frame, stop=False))
        robot.drive_velocity(0.0, 0.0, 0.0, _SLICE_S)
        _result(robot, as_json)


@app.command(
    "pose", cls=NumberCommand, epilog=examples("omni drive pose 0.5 0 1.57", "omni drive pose -0.5 0 0 --duration 10")
)
def pose(
    x: Annotated[float, typer.Argument(help="World x \\[m].")],
    y: Annotated[float, typer.Argument(help="World y \\[m].")],
    theta: Annotated[float, typer.Argument(help="World theta \\[rad], counter-clockwise.")],
    duration: DurationOption = 5.0,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Drive to a world pose; ends early once the robot is there. Exit code 1: not there in time."""
    for name, value in (("x", x), ("y", y), ("theta", theta)):
        finite(name, value)
    with _armed(link, timeout, as_json) as robot:
        end = robot.connection.clock() + duration
        while (arrived := _is_at(robot, x, y, theta)) is False and robot.connection.clock() < end:
            robot.drive_pose(x, y, theta, _SLICE_S)
            _check_still_armed(robot)
        _result(robot, as_json, arrived=arrived)
    if not arrived:
        note(f"not within {_SETTLED_M * 1e3:.0f} mm and {_SETTLED_RAD} rad after {duration:g} s")
        raise typer.Exit(1)


def _is_at(robot: Robot, x: float, y: float, theta: float) -> bool:
    tracking = robot.status.tracking
    if tracking is None:
        return False
    here = tracking.pose
    turn = math.remainder(here.theta - theta, math.tau)
    return math.hypot(here.x - x, here.y - y) < _SETTLED_M and abs(turn) < _SETTLED_RAD


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
    as_json: JsonOption = False,
) -> None:
    """Follow the on-board trajectory that the TRJ_* parameters describe, until it is done."""
    with _armed(link, timeout, as_json) as robot:
        robot.start_trajectory(type_name, laps)
        end = robot.connection.clock() + duration
        started = False
        for tracking in robot.telemetry(Tracking):
            _check_still_armed(robot)
            started = started or tracking.phase in ("lead-in", "path")
            if (started and tracking.phase == "done") or robot.connection.clock() > end:
                break
        robot.stop_trajectory()
        _result(robot, as_json, phase=tracking.phase)


@app.command(
    "duty", cls=NumberCommand, epilog=examples("omni drive duty 0.2 0.2 0.2 --duration 2", "omni drive duty -0.3 0 0")
)
def duty(
    duties: Annotated[list[float], typer.Argument(metavar="DUTY...", help="-1..1 per wheel, + counter-clockwise.")],
    duration: DurationOption = 1.0,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Put constant duties on the motors, open loop, for a while: bring-up and identification. Lift the wheels first."""
    check_duty(duties)
    with _armed(link, timeout, as_json) as robot:
        _drive_in_slices(robot, duration, lambda s: robot.drive_duty(duties, s, stop=False))
        robot.drive_duty([0.0] * len(duties), _SLICE_S)
        _result(robot, as_json)


@app.command("keys", epilog=examples("omni drive keys", "omni drive keys --speed 0.2 --turn 1"))
def keys(
    speed: SpeedOption = 0.1,
    turn: TurnOption = 0.5,
    link: LinkOption = None,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
) -> None:
    """Drive with the keyboard."""
    with raw_keys() as read_key, _armed(link, timeout, False) as robot:
        note(KEYS_HELP)
        driver = KeyDriver(speed, turn)
        while driver.take(read_key(), robot.connection.clock()):
            twist = driver.twist(robot.connection.clock())
            robot.drive_velocity(*twist, duration_s=0.05, stop=False)
            _check_still_armed(robot)
