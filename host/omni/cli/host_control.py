# SPDX-License-Identifier: MIT
"""``omni host-control`` (and ``omni drive --host-control``): the controller on the host, PWM lines to the robot."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli import completion
from omni.cli.common import (
    JsonOption,
    console,
    examples,
    note,
    parse_assignments,
    print_json,
    redrawn_path,
    signals_interrupt,
)
from omni.cli.negative_numbers import NumberCommand
from omni.cli.options import ASSIGNMENTS, PLOT, XBEE, BaudOption, OwnSeedOption, stop_after_option, takes
from omni_schema import Robot
from omniwheel.errors import LinkUrlError, MocapSourceError, SetpointError
from omniwheel.frames import Pose
from omniwheel.limits import HOST_CONTROL_DELAY_S, HOST_CONTROL_FULL_PWM, HOST_CONTROL_MOTORS, RADIO_BAUD
from omniwheel.robots import read_robot

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from omniwheel.host_control.controller import HostControlSettings
    from omniwheel.host_control.loop import Goal, HostControlRun
    from omniwheel.host_control.pwm_line import PwmRadio
    from omniwheel.link import Link
    from omniwheel.mocap.source import MocapSource

app = typer.Typer(
    help="Drive the original four-wheel robot: the controller runs here, the robot gets pwm1,pwm2,pwm3,pwm4*.",
    no_args_is_help=True,
)
_SETTLED_FROM = 0.25

RobotOption = Annotated[
    str,
    typer.Option(
        "--robot", "-r", metavar="NAME|FILE", help="Geometry, motors and gains.", autocompletion=completion.robots
    ),
]
SimulateOption = Annotated[bool, typer.Option("--simulate", help="Simulate robot and cameras; no hardware.")]
PortOption = Annotated[str | None, XBEE]
SourceOption = Annotated[str | None, typer.Option("--source", metavar="STREAM", help="vicon: or natnet:HOST/OBJECT.")]
ParamOption = Annotated[list[str] | None, ASSIGNMENTS]
PwmMinOption = Annotated[
    int,
    typer.Option("--pwm-min", help="PWM below which the wheels do not turn, 0 to 255; the controller compensates it."),
]
FullSpeedOption = Annotated[
    float | None, typer.Option("--full-speed", help="Wheel speed at PWM 255 \\[rad/s]. \\[default: the robot file's]")
]
DelayOption = Annotated[
    float, typer.Option("--delay", help="Delay from sending a PWM value to the wheels' response \\[s].")
]
DurationOption = Annotated[float, stop_after_option(0.1)]
PlotOption = Annotated[Path | None, PLOT]
StartOption = Annotated[
    tuple[float, float, float],
    typer.Option("--start", help="Start pose of the simulated robot: x, y \\[m], theta \\[rad]."),
]
DeadbandOption = Annotated[
    float,
    typer.Option(
        "--deadband",
        min=0.0,
        max=250.0,
        help="Deadband of the simulated motors: PWM up to which they do not turn, 0 to 250.",
    ),
]


@dataclass(frozen=True)
class _Wanted:
    """The options of a run."""

    duration: DurationOption
    start: StartOption
    robot: RobotOption = "four_wheel"
    simulate: SimulateOption = False
    port: PortOption = None
    baud: BaudOption = RADIO_BAUD
    source: SourceOption = None
    param: ParamOption = None
    pwm_min: PwmMinOption = 0
    full_speed: FullSpeedOption = None
    delay: DelayOption = HOST_CONTROL_DELAY_S
    plot: PlotOption = None
    deadband: DeadbandOption = 0.0
    seed: OwnSeedOption = 1
    as_json: JsonOption = False

    @property
    def settings(self) -> HostControlSettings:
        """What the controller is told of the robot."""
        from omniwheel.host_control.controller import HostControlSettings

        return HostControlSettings(self.full_speed, self.pwm_min, self.delay)


@app.command(
    "pose",
    cls=NumberCommand,
    epilog=examples(
        "omni host-control pose 0 0 0 --simulate --start 1.2 -0.8 1",
        "omni host-control pose 0 0 0 --link /dev/ttyUSB0 --source vicon:192.168.1.10/robot --pwm-min 60",
    ),
)
@takes(_Wanted, duration=60.0, start=(1.2, -0.8, 1.0))
def pose(
    x: Annotated[float, typer.Argument(help="World x \\[m].")],
    y: Annotated[float, typer.Argument(help="World y \\[m].")],
    theta: Annotated[float, typer.Argument(help="World theta \\[rad], counter-clockwise.")],
    tolerance: Annotated[
        float,
        typer.Option("--tolerance", min=0.0, help="End when within this distance for 1 s \\[m]; 0: hold the pose."),
    ] = 0.01,
    *,
    wanted: _Wanted,
) -> None:
    """Drive to a world pose and hold it. Exit code 1: not reached in time."""
    from omniwheel.host_control.loop import Goal

    run = _run(wanted, Goal(Pose(x, y, theta), tolerance), {})
    if not run.done and tolerance > 0.0:
        note(f"not within {tolerance * 1e3:g} mm after {wanted.duration:g} s")
        raise typer.Exit(1)


@app.command(
    "trajectory",
    epilog=examples(
        "omni host-control trajectory rose --simulate",
        "omni host-control trajectory circle --set TRJ_SIZE=0.3 --link /dev/ttyUSB0 --source vicon:192.168.1.10/robot",
    ),
)
@takes(_Wanted, duration=600.0, start=(0.5, 0.0, 0.0))
def trajectory(
    type_name: Annotated[str, typer.Argument(metavar="TYPE", help="A value of TRJ_TYPE: rose, circle, ...")] = "rose",
    *,
    wanted: _Wanted,
) -> None:
    """Follow the path that the TRJ_* parameters describe. Exit code 1: not driven to its end."""
    from omniwheel.host_control.loop import Goal

    run = _run(wanted, Goal(), {"TRJ_TYPE": type_name})
    if not run.done:
        note(f"the path is not finished after {wanted.duration:g} s")
        raise typer.Exit(1)


@app.command(
    "motor",
    cls=NumberCommand,
    epilog=examples(
        "omni host-control motor 1 120 --link /dev/ttyUSB0", "omni host-control motor 3 -80 --link COM3 --duration 2"
    ),
)
def motor(
    number: Annotated[
        int, typer.Argument(min=1, max=HOST_CONTROL_MOTORS, help="Motor number: its position in pwm1,pwm2,pwm3,pwm4*.")
    ],
    pwm: Annotated[int, typer.Argument(min=-HOST_CONTROL_FULL_PWM, max=HOST_CONTROL_FULL_PWM, help="PWM.")],
    port: Annotated[str, XBEE],
    baud: BaudOption = RADIO_BAUD,
    duration: Annotated[
        float, typer.Option("--duration", "-d", "--for", min=0.1, max=60.0, metavar="S", help="Duration of the run.")
    ] = 1.0,
) -> None:
    """Turn one motor, to check its wiring, direction and smallest PWM. Put the robot on blocks first."""
    from omniwheel.host_control.controller import PERIOD_S
    from omniwheel.host_control.pwm_line import MOTORS, PwmRadio

    line = tuple(pwm if place == number else 0 for place in range(1, MOTORS + 1))
    with signals_interrupt(), _radio_link(port, baud) as link:
        radio = PwmRadio(link, time.monotonic, baud=baud)
        end_s = time.monotonic() + duration
        try:
            while time.monotonic() < end_s:
                radio.offer(line)
                time.sleep(PERIOD_S)
        finally:
            radio.stop_for_good(lambda: time.sleep(PERIOD_S))
    note(
        f"motor {number} had PWM {pwm}. Positive must turn the robot counter-clockwise; if not: W{number}_MOT_DIR = -1"
    )


def _run(wanted: _Wanted, goal: Goal, changes: dict[str, float | str]) -> HostControlRun:
    import numpy as np

    from omniwheel.host_control.controller import HostController, host_control_values
    from omniwheel.host_control.loop import HostControlLoop
    from omniwheel.host_control.pwm_line import PwmRadio

    if wanted.plot is not None:
        redrawn_path(wanted.plot, "--plot")
    for name, place in (("--start", wanted.start), ("the pose", goal.pose or ())):
        if not all(map(math.isfinite, place)):
            raise SetpointError(f"{name} is {', '.join(map(str, place))}; all numbers must be finite")
    robot = read_robot(wanted.robot)
    values = host_control_values(robot, {**changes, **parse_assignments(wanted.param or [])})
    controller = HostController(robot, values, wanted.settings)
    truth: list[NDArray[np.float64]] = []
    with _hardware(wanted, robot, truth) as (source, link, watch):
        radio = PwmRadio(link, source.clock, baud=wanted.baud)
        loop = HostControlLoop(controller, source, radio, goal)
        note("driving; Ctrl-C stops the robot", quiet=wanted.as_json)
        run = loop.run(wanted.duration, watch)
        seconds = source.clock() - run.started_s
    record, true_poses = run.record(), np.array(truth) if truth else None
    _show(run, radio, seconds, record, true_poses, wanted, goal.pose is None)
    if wanted.plot is not None and len(record):
        from omniwheel.host_control.picture import draw_host_control_run

        draw_host_control_run(record, true_poses, f"{robot.name}, controller on the host at 50 Hz", wanted.plot)
        note(f"{wanted.plot}", quiet=wanted.as_json)
    return run


@contextmanager
def _hardware(wanted: _Wanted, robot: Robot, truth: list[Any]) -> Iterator[tuple[MocapSource, Link, Any]]:
    """Open poses and radio, real or simulated, and what is called at each step."""
    from omniwheel.mocap.streams import open_source

    if wanted.simulate:
        yield _simulation(wanted, robot, truth)
        return
    if not wanted.port:
        raise LinkUrlError(
            "--link is missing: it names the radio's serial port",
            hint="e.g. --link /dev/ttyUSB0; --simulate needs none",
        )
    kind = (wanted.source or "").partition(":")[0]
    if kind != "vicon":
        what = f"--source {wanted.source} gives no poses of the robot" if wanted.source else "--source is missing"
        hint = "--source vicon:HOST/OBJECT or natnet:HOST/OBJECT, or --simulate"
        raise MocapSourceError(f"{what}: a real robot needs a motion-capture source", hint=hint)
    with signals_interrupt():
        source = open_source(str(wanted.source))
        try:
            with _radio_link(wanted.port, wanted.baud) as link:
                yield source, link, None
        finally:
            source.close()


@contextmanager
def _radio_link(port: str, baud: int) -> Iterator[Link]:
    """Open the radio; ``baud`` is for serial ports that do not name theirs."""
    from omniwheel.link import open_link, parse_url

    plain_serial = parse_url(port).kind == "serial" and "," not in port
    link = open_link(f"{port},{baud}" if plain_serial else port)
    try:
        yield link
    finally:
        link.close()


def _simulation(wanted: _Wanted, robot: Robot, truth: list[Any]) -> tuple[MocapSource, Link, Any]:
    from hil_sim.pwm_robot import SimulatedLink, SimulatedRobot

    simulated = SimulatedRobot(
        robot,
        start_pose=Pose(*wanted.start),
        seed=wanted.seed,
        baud=wanted.baud,
        deadband_pwm=wanted.deadband,
    )

    def watch(_time_s: float, run: HostControlRun) -> None:
        if len(run.samples) > len(truth):
            truth.append(simulated.world.truth)

    return simulated, SimulatedLink(simulated), watch


def _rms(error: NDArray[np.float64], moving: bool) -> dict[str, float]:
    """RMS of a pose error: of a path after its first quarter, of a pose over the last second. m, m, rad."""
    import numpy as np

    from omniwheel.host_control.controller import PERIOD_S
    from omniwheel.host_control.loop import SETTLE_S

    first = int(_SETTLED_FROM * len(error)) if moving else max(0, len(error) - round(SETTLE_S / PERIOD_S))
    turn = np.arctan2(np.sin(error[:, 2]), np.cos(error[:, 2]))
    x, y, theta = np.sqrt(np.mean(np.square(np.column_stack([error[:, :2], turn])[first:]), axis=0))
    return {"x_m": float(x), "y_m": float(y), "theta_rad": float(theta)}


def _show(
    run: HostControlRun,
    radio: PwmRadio,
    seconds: float,
    record: NDArray[np.float64],
    truth: NDArray[np.float64] | None,
    wanted: _Wanted,
    moving: bool,
) -> None:
    figures: dict[str, dict[str, float]] = {}
    if len(record):
        figures["estimate"] = _rms(record[:, 7:10], moving)
        if truth is not None:
            figures["truth"] = _rms(truth[: len(record)] - record[: len(truth), 4:7], moving)
    radio_numbers = {
        "lines": radio.lines,
        "lines_per_s": radio.lines / seconds,
        "bytes_per_s": radio.bytes / seconds,
        "unchanged": radio.unchanged,
        "held_back": radio.held_back,
    }
    counts = {"fixes": run.fixes, "refused": run.refused, "pauses": run.pauses, "late_steps": run.late}
    if wanted.as_json:
        print_json({"done": run.done, "duration_s": seconds, "error": figures, "radio": radio_numbers, **counts})
        return
    table = Table(title=f"{seconds:.1f} s, {'done' if run.done else 'not done'}", title_justify="left")
    window = "after the first quarter" if moving else "last second"
    table.add_column(f"RMS error, {window}")
    for heading in ("x [mm]", "y [mm]", "theta [mrad]"):
        table.add_column(escape(heading), justify="right")
    for name, numbers in figures.items():
        table.add_row(name, *(f"{1e3 * value:.1f}" for value in numbers.values()))
    console.print(table)
    console.print(
        f"radio: {radio.lines} lines, {radio.lines / seconds:.1f} per s, {radio.bytes / seconds:.0f} B/s; "
        f"{radio.unchanged} unchanged ones skipped, {radio.held_back} held back: the radio's buffer was full"
    )
    console.print(f"poses: {run.fixes} used, {run.refused} refused, {run.pauses} pauses; {run.late} late steps")
