# SPDX-License-Identifier: MIT
"""``omni experiment``: show how a loop of a connected robot answers, beside what the model predicts."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from enum import Enum
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
from omni.cli.options import DEFAULT_OUT, Axis, AxisOption, LiftedOption, OutOption, RoomOption, refuse_unused, takes
from omniwheel.errors import OutputFileError
from omniwheel.limits import DEFAULT_TIMEOUT_S

if TYPE_CHECKING:
    from omniwheel.experiments import Outcome
    from omniwheel.robot import Robot

    Run = Callable[[Robot, Callable[[str], None]], Outcome]

EXAMPLES = examples(
    "omni experiment wheel-step --link tcp:127.0.0.1:5760",
    "omni experiment wheel-chirp --link tcp:127.0.0.1:5760",
    "omni experiment wheel-chirp --wheel 1 --wheels-up --json",
    "omni experiment position-step --axis theta --link tcp:127.0.0.1:5760",
    "omni experiment position-sweep --link tcp:127.0.0.1:5760",
    "omni experiment disturbance --wheel 2 --link tcp:127.0.0.1:5760",
)


class Name(str, Enum):
    """The experiments."""

    WHEEL_STEP = "wheel-step"
    WHEEL_CHIRP = "wheel-chirp"
    POSITION_STEP = "position-step"
    POSITION_SWEEP = "position-sweep"
    DISTURBANCE = "disturbance"


OPTIONS: Mapping[Name, frozenset[str]] = {
    Name.WHEEL_STEP: frozenset({"wheel", "speed"}),
    Name.WHEEL_CHIRP: frozenset({"wheel", "speed", "highest_hz"}),
    Name.POSITION_STEP: frozenset({"axis"}),
    Name.POSITION_SWEEP: frozenset({"axis", "highest_hz"}),
    Name.DISTURBANCE: frozenset({"wheel"}),
}
"""The options that each experiment has besides those of all."""
TIMES_S = {
    Name.WHEEL_STEP: 0.5,
    Name.WHEEL_CHIRP: 2.5,
    Name.POSITION_STEP: 1.0,
    Name.POSITION_SWEEP: 12.0,
    Name.DISTURBANCE: 0.1,
}
"""Default duration of each experiment's signal [s]."""


@dataclass(frozen=True)
class _Wanted:
    """What all experiments are told."""

    link: LinkOption = None
    room_m: RoomOption = 1.0
    lifted: LiftedOption = False
    out: OutOption = DEFAULT_OUT
    timeout_s: TimeoutOption = DEFAULT_TIMEOUT_S
    json_wanted: JsonOption = False


WheelOption = Annotated[
    int | None,
    typer.Option(
        "--wheel",
        min=0,
        max=4,
        help="Wheel number, from 1; 0: all wheels. \\[default: 1 for disturbance, otherwise all]",
        show_default=False,
    ),
]
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
TimeOption = Annotated[
    float | None,
    typer.Option(
        "--time",
        min=0.05,
        max=120.0,
        metavar="S",
        help="Duration of the signal. \\[default: by experiment]",
        show_default=False,
    ),
]
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


@takes(_Wanted)
def experiment(
    ctx: typer.Context,
    name: Annotated[Name, typer.Argument(metavar="EXPERIMENT", help="What to measure.", show_default=False)],
    wheel: WheelOption = None,
    speed: SpeedOption = None,
    axis: AxisOption = Axis.X,
    amplitude: AmplitudeOption = None,
    time_s: TimeOption = None,
    highest_hz: HighestOption = None,
    *,
    wanted: _Wanted,
) -> None:
    """Measure a control loop's step or frequency response and compare it with the model from the robot's parameters.

    The robot moves: leave it room, and stand by to stop it. It is disarmed at the end, on Ctrl-C and on any error.
    Default sizes follow from the robot's limits.

    wheel-step: step the speed setpoint of the wheels while they turn. Rise time, overshoot, settling, noise. The step
    is made on the robot, so nothing ramps it.

    wheel-chirp: sweep the speed setpoint of the wheels. Bandwidth, margins, delay and coherence of their loops.

    position-step: step the pose setpoint while the robot holds its pose, without velocity limits. Rise time,
    overshoot, settling. The default amplitude keeps the sliding mode in its linear range.

    position-sweep: sweep the pose setpoint. Bandwidth, margins and coherence of the position loop.

    disturbance: add a voltage to one wheel while the robot holds its pose. Largest deviation, and recovery.
    """
    refuse_unused(ctx, name.value, OPTIONS[name], frozenset().union(*OPTIONS.values()))
    size, time_s = _number(amplitude), time_s or TIMES_S[name]
    run = _planned(name, wheel, _number(speed), axis, size, time_s, highest_hz or 0.0, wanted)
    _experiment(name.value, wanted, run)


def _planned(
    name: Name,
    wheel: int | None,
    speed: float,
    axis: Axis,
    size: float,
    time_s: float,
    top_hz: float,
    wanted: _Wanted,
) -> Run:
    """Return the experiment with its plan, to be called with a robot and with what takes its messages."""
    from omniwheel import experiments as library
    from omniwheel.experiments.position import LOWEST_SWEPT_HZ

    if name in (Name.WHEEL_STEP, Name.WHEEL_CHIRP):
        low_hz = library.LOWEST_HZ if top_hz else 0.0
        wheels = library.WheelPlan(wheel or 0, speed, size, time_s, low_hz, top_hz, on_stand=wanted.lifted)
        on_wheels = library.wheel_step if name is Name.WHEEL_STEP else library.wheel_chirp
        return lambda robot, tell: on_wheels(robot, wheels, wanted.room_m, tell)
    if name is Name.DISTURBANCE:
        push = library.PushPlan(1 if wheel is None else wheel, size, time_s)
        return lambda robot, tell: library.disturbance(robot, push, wanted.room_m, tell)
    plan = library.PositionPlan(axis.value, size, time_s, LOWEST_SWEPT_HZ if top_hz else 0.0, top_hz)
    on_pose = library.position_step if name is Name.POSITION_STEP else library.position_sweep
    return lambda robot, tell: on_pose(robot, plan, wanted.room_m, tell)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _experiment(name: str, wanted: _Wanted, run: Run) -> None:
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
