# SPDX-License-Identifier: MIT
"""``omni experiment``: show how a loop of a connected robot answers, beside what the model predicts."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from omni.cli.common import (
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
from omni.cli.options import DEFAULT_OUT, Axis, AxisOption, LiftedOption, OutOption, RoomOption, takes
from omniwheel.errors import OutputFileError
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omniwheel.experiments import Outcome
    from omniwheel.robot import Robot

app = typer.Typer(
    help="Measure a control loop's step or frequency response and compare it with the model. The robot moves: leave "
    "it room, and "
    "stand by to stop it. It is disarmed at the end, on Ctrl-C and on any error.",
    no_args_is_help=True,
)


@dataclass(frozen=True)
class _Wanted:
    """What all experiments are told."""

    link: LinkOption = None
    room_m: RoomOption = 1.0
    lifted: LiftedOption = False
    out: OutOption = DEFAULT_OUT
    timeout_s: TimeoutOption = DEFAULT_TIMEOUT_S
    json_wanted: JsonOption = False


WheelOption = Annotated[int, typer.Option("--wheel", min=0, max=4, help="Wheel number, from 1; 0: all wheels.")]
SpeedOption = Annotated[
    float | None,
    typer.Option(
        "--wheel-speed",
        min=0.001,
        metavar="RAD/S",
        help="Mean speed of all wheels, so that none reverses.",
        show_default=False,
    ),
]
AmplitudeOption = Annotated[
    float | None,
    typer.Option(
        "--amplitude",
        metavar="SIZE",
        help="Amplitude of the signal: rad/s for wheel speeds, V for a push, m or rad for a pose.",
        show_default=False,
    ),
]
TimeOption = Annotated[float, typer.Option("--time", min=0.05, max=120.0, metavar="S", help="Duration of the signal.")]
HighestOption = Annotated[
    float | None,
    typer.Option(
        "--highest",
        min=1.0,
        max=400.0,
        metavar="HZ",
        help="Frequency at the end of the sweep. Default: twice the modelled bandwidth.",
        show_default=False,
    ),
]


@app.command("wheel-step", epilog=examples("omni experiment wheel-step --link tcp:127.0.0.1:5760"))
@takes(_Wanted)
def wheel_step(
    wheel: WheelOption = 0,
    speed: SpeedOption = None,
    amplitude: AmplitudeOption = None,
    time_s: TimeOption = 0.5,
    *,
    wanted: _Wanted,
) -> None:
    """Step the speed setpoint of the wheels while they turn: rise time, overshoot, settling, noise.

    The step is made on the robot, so nothing ramps it. Defaults of speed and amplitude follow from the robot's
    limits.
    """
    from omniwheel.experiments import WheelPlan
    from omniwheel.experiments import wheel_step as run

    plan = WheelPlan(wheel, _number(speed), _number(amplitude), time_s, on_stand=wanted.lifted)
    _experiment("wheel-step", wanted, lambda robot, tell: run(robot, plan, wanted.room_m, tell))


@app.command(
    "wheel-chirp",
    epilog=examples(
        "omni experiment wheel-chirp --link tcp:127.0.0.1:5760",
        "omni experiment wheel-chirp --wheel 1 --wheels-up --json",
    ),
)
@takes(_Wanted)
def wheel_chirp(
    wheel: WheelOption = 0,
    speed: SpeedOption = None,
    amplitude: AmplitudeOption = None,
    time_s: TimeOption = 2.5,
    highest_hz: HighestOption = None,
    *,
    wanted: _Wanted,
) -> None:
    """Sweep the speed setpoint of the wheels: bandwidth, margins, delay and coherence of their loops.

    Each number is shown beside the model's prediction from the robot's parameters.
    """
    from omniwheel.experiments import LOWEST_HZ, WheelPlan
    from omniwheel.experiments import wheel_chirp as run

    top_hz = highest_hz or 0.0
    low_hz = LOWEST_HZ if top_hz else 0.0
    plan = WheelPlan(wheel, _number(speed), _number(amplitude), time_s, low_hz, top_hz, wanted.lifted)
    _experiment("wheel-chirp", wanted, lambda robot, tell: run(robot, plan, wanted.room_m, tell))


@app.command("position-step", epilog=examples("omni experiment position-step --axis theta --link tcp:127.0.0.1:5760"))
@takes(_Wanted)
def position_step(
    axis: AxisOption = Axis.X, amplitude: AmplitudeOption = None, time_s: TimeOption = 1.0, *, wanted: _Wanted
) -> None:
    """Step the pose setpoint while the robot holds its pose, without velocity limits: rise time, overshoot, settling.

    The default amplitude keeps the sliding mode in its linear range.
    """
    from omniwheel.experiments import PositionPlan
    from omniwheel.experiments import position_step as run

    plan = PositionPlan(axis.value, _number(amplitude), time_s)
    _experiment("position-step", wanted, lambda robot, tell: run(robot, plan, wanted.room_m, tell))


@app.command("position-sweep", epilog=examples("omni experiment position-sweep --link tcp:127.0.0.1:5760"))
@takes(_Wanted)
def position_sweep(
    axis: AxisOption = Axis.X,
    amplitude: AmplitudeOption = None,
    time_s: TimeOption = 12.0,
    highest_hz: HighestOption = None,
    *,
    wanted: _Wanted,
) -> None:
    """Sweep the pose setpoint: bandwidth, margins and coherence of the position loop.

    Each number is shown beside the model's prediction from the robot's parameters.
    """
    from omniwheel.experiments import PositionPlan
    from omniwheel.experiments import position_sweep as run
    from omniwheel.experiments.position import LOWEST_SWEPT_HZ

    top_hz = highest_hz or 0.0
    plan = PositionPlan(axis.value, _number(amplitude), time_s, LOWEST_SWEPT_HZ if top_hz else 0.0, top_hz)
    _experiment("position-sweep", wanted, lambda robot, tell: run(robot, plan, wanted.room_m, tell))


@app.command("disturbance", epilog=examples("omni experiment disturbance --wheel 2 --link tcp:127.0.0.1:5760"))
@takes(_Wanted)
def disturbance(
    wheel: WheelOption = 1, amplitude: AmplitudeOption = None, time_s: TimeOption = 0.1, *, wanted: _Wanted
) -> None:
    """Add a voltage to one wheel while the robot holds its pose: largest deviation, and recovery."""
    from omniwheel.experiments import PushPlan
    from omniwheel.experiments import disturbance as run

    plan = PushPlan(wheel, _number(amplitude), time_s)
    _experiment("disturbance", wanted, lambda robot, tell: run(robot, plan, wanted.room_m, tell))


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _experiment(name: str, wanted: _Wanted, run: Callable[[Robot, Callable[[str], None]], Outcome]) -> None:
    """Connect, run, and leave a folder with telemetry, parameters, numbers, burst and picture."""
    from omniwheel.drive_log import DriveLog
    from omniwheel.experiments.folder import PICTURE_FILE, write_outcome

    outcome: Outcome | None = None
    try:
        with ExitStack() as stack:
            stack.enter_context(signals_interrupt())
            log = stack.enter_context(DriveLog(wanted.out, name, name))
            robot = stack.enter_context(open_robot(wanted.link, timeout_s=wanted.timeout_s, recorder=log.write))
            stack.callback(log.leaving)
            log.connected(robot)
            outcome = run(robot, partial(note, quiet=wanted.json_wanted))
            write_outcome(outcome, log.folder)
    except OutputFileError as error:
        if outcome is not None:  # what the robot has driven is told before that
            error.found = outcome.document()
            _show(outcome, quiet=wanted.json_wanted)
        raise
    if wanted.json_wanted:
        print_json({**outcome.document(), "folder": str(log.folder)})
        return
    _show(outcome)
    console.print(f"[bold]{log.folder / PICTURE_FILE}[/]", soft_wrap=True)


def _show(outcome: Outcome, *, quiet: bool = False) -> None:
    if quiet:
        return
    console.print(_table(outcome))
    for remark in outcome.remarks:
        console.print(f"[yellow]{remark}[/]")


def _table(outcome: Outcome) -> Table:
    table = Table(title=outcome.experiment, title_style="bold", title_justify="left")
    for heading in ("", "measured", "±", "model"):
        table.add_column(heading, justify="right" if heading else "left")
    for figure in outcome.figures:
        unit = f" [{figure.unit}]" if figure.unit else ""
        numbers = (figure.measured, figure.half_width, figure.model)
        table.add_row((figure.name + unit).replace("[", r"\["), *map(_shown, numbers))
    return table


def _shown(value: float) -> str:
    return f"{value:.4g}" if not math.isnan(value) else "–"
