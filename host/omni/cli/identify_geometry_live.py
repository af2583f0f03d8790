# SPDX-License-Identifier: MIT
"""``omni identify geometry-live``: drive the runs that geometry needs, fit them, and check on another run."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

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
    writable_path,
)
from omni.cli.identify_geometry import print_study
from omni.cli.log_options import RobotFileOption, RobotOption
from omni.cli.options import SOURCE, OwnSeedOption, RoomOption
from omniwheel.errors import LogError, OutputFileError
from omniwheel.frames import Pose, relative_pose
from omniwheel.limits import DEFAULT_TIMEOUT_S
from omniwheel.robots import read_robot

if TYPE_CHECKING:
    from omni_schema import Robot as RobotFile
    from omniwheel.identification.geometry_drive import DrivenGeometry, Stream, Tape
    from omniwheel.logs.log import WheelLog
    from omniwheel.robot import Robot
    from omniwheel.simulation import SimulatedRobot

EXAMPLES = examples(
    "omni identify geometry-live --simulated fast_three_wheel --robot fast_three_wheel",
    "omni identify geometry-live --robot mine.toml --source natnet:192.168.1.10/robot --room 4 --out found.toml",
    "omni identify geometry-live --robot mine.toml --tape --logs runs --out found.toml",
)
StreamOption = Annotated[str | None, SOURCE]
TapeOption = Annotated[
    bool, typer.Option("--tape", help="No motion capture: ask for the pose after each run, by tape measure.")
]
SimulatedOption = Annotated[
    str | None,
    typer.Option(
        "--simulated",
        metavar="NAME|FILE",
        help="No hardware: this robot in a simulated world, with firmware set up as --robot.",
        show_default=False,
    ),
]
LogsOption = Annotated[
    Path | None,
    typer.Option("--logs", metavar="DIR", help="Folder for the runs as LOG.npz, for omni identify geometry."),
]


def identify_geometry_live(
    robot: RobotOption,
    link: LinkOption = None,
    room: RoomOption = 3.0,
    source: StreamOption = None,
    tape: TapeOption = False,
    simulated: SimulatedOption = None,
    logs: LogsOption = None,
    out: RobotFileOption = None,
    seed: OwnSeedOption = 1,
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Drive eight runs and a check run within the room, measure poses, and identify odometry geometry.

    The robot stands in the middle of a free square of --room. It drives by dead reckoning, which is what is to be
    calibrated: leave it room, and stand by to stop it. The check run is not used in the fit.
    """
    from omniwheel.identification.geometry_drive import drive_geometry, fit_driven, reach_m
    from omniwheel.identification.pose_fit.wheel_model import wheel_model
    from omniwheel.logs.log import save_log

    _require_choices(link, source, simulated, tape=tape)
    if out is not None:
        writable_path(out, "the robot file")
        if out.exists():
            raise typer.BadParameter(f"{out} exists already; choose another name")
    if logs is not None and logs.exists() and not logs.is_dir():
        raise typer.BadParameter(f"{logs} is not a folder")
    nominal = read_robot(robot)
    layout = wheel_model(nominal)
    reach_m(room, layout)

    def tell(name: str) -> None:
        note(f"{name} …", quiet=as_json)

    def save(log: WheelLog) -> None:
        if logs is not None:
            save_log(log, logs / f"{log.name.replace(' ', '_')}.npz")

    if logs is not None:
        _make_folder(logs)
    with (
        signals_interrupt(),
        _robot(link, nominal, simulated, seed, timeout) as connected,
        _truth(connected, source, room, tape=tape, seed=seed) as truth,
    ):
        driven = drive_geometry(connected, layout, room, truth, tell, save=save)
    _finish(fit_driven(driven, layout), robot, out, as_json)


def _require_choices(link: str | None, source: str | None, simulated: str | None, *, tape: bool) -> None:
    """Refuse options that exclude each other; nothing is connected yet."""
    if simulated is not None:
        if link is not None or source is not None:
            raise typer.BadParameter("--simulated has a robot and cameras of its own; leave --link and --source out")
    elif (source is None) != tape:
        raise typer.BadParameter("give --source STREAM or --tape: the runs need measured poses")
    elif source is not None and source.partition(":")[0] in ("recorded", "simulated"):
        raise typer.BadParameter(f"--source {source} gives no poses of this robot; use vicon:, natnet: or camera:")


@contextmanager
def _robot(link: str | None, nominal: RobotFile, simulated: str | None, seed: int, timeout_s: float) -> Iterator[Robot]:
    """Connect to the robot, or start a simulated one."""
    if simulated is None:
        with open_robot(link, timeout_s=timeout_s) as robot:
            yield robot
        return
    from hil_sim.scenario import load_scenario
    from omniwheel.simulation import MAX
    from omniwheel.simulation import simulate as start

    scenario = load_scenario("sitl")
    world = {**scenario.world, "fix_rate_Hz": 0.0}
    scenario = replace(scenario, robot=nominal, world_robot=read_robot(simulated), world=world)
    with start(nominal, scenario=scenario, seed=seed, speed=MAX) as robot:
        yield robot


@contextmanager
def _truth(robot: Robot, source: str | None, room_m: float, *, tape: bool, seed: int) -> Iterator[Stream | Tape]:
    """Open what measures the robot's pose."""
    from omniwheel.identification.geometry_drive import Stream, Tape
    from omniwheel.mocap.simulated import Cameras, SimulatedSource
    from omniwheel.mocap.streams import open_source
    from omniwheel.simulation import SimulatedRobot

    if tape:
        yield Tape(_simulated_tape(robot) if isinstance(robot, SimulatedRobot) else _typed_pose(room_m))
        return
    tracked = Pose(*(robot.parameters[name] for name in ("FIX_X", "FIX_Y", "FIX_TH")))
    if isinstance(robot, SimulatedRobot):
        world, cameras = robot.simulation, Cameras(latency_s=0.0)
        seen = SimulatedSource(
            lambda _: world.true_pose, cameras=cameras, seed=seed, clock=robot.connection.clock, sleep=robot.pump
        )
        yield Stream(seen, tracked, robot.pump)
        return
    opened = open_source(str(source))
    try:
        yield Stream(opened, tracked, robot.pump)
    finally:
        opened.close()


def _simulated_tape(robot: SimulatedRobot) -> Callable[[str], Pose]:
    home = robot.simulation.true_pose
    return lambda _: relative_pose(home, robot.simulation.true_pose)


def _typed_pose(room_m: float) -> Callable[[str], Pose]:
    """Return what asks for the pose after a run; the pose at the start is the origin."""

    def ask(where: str) -> Pose:
        if where == "start":
            note("mark the robot's centre and its heading on the floor: x ahead, y to its left, from here")
            return Pose(0.0, 0.0, 0.0)
        while True:
            typed = typer.prompt(f"after {where!r}: x [m], y [m], heading [deg]", err=True)
            try:
                x, y, degrees = (float(word) for word in re.split(r"[,;]?\s+", typed.strip()))
            except ValueError:
                note("three numbers with decimal points are needed, like: 1.032 -0.011 27.5")
                continue
            if all(map(math.isfinite, (x, y, degrees))) and max(abs(x), abs(y)) <= 0.5 * room_m:
                return Pose(x, y, math.radians(degrees))
            note(f"x and y must be within the room: {-0.5 * room_m:g} to {0.5 * room_m:g} m")

    return ask


def _finish(found: DrivenGeometry, robot: str, out: Path | None, as_json: bool) -> None:
    """Print the study and the check run; write the robot file if it predicts the check run better."""
    from omniwheel.identification.pose_fit.result_data import score_data, study_data
    from omniwheel.identification.pose_fit.robot_file import write_geometry

    if as_json:
        check = {"before": score_data(found.before), "after": score_data(found.after), "is_better": found.is_better}
        result = {**study_data(found.study), "check": check, "file": None}
        try:
            written = write_geometry(found.study, robot, out) if out is not None and found.is_better else None
        except OutputFileError as error:
            error.found = result
            raise
        print_json({**result, "file": None if written is None else str(written)})
    else:
        print_study(found.study)
        before, after = found.before, found.after
        console.print(
            "check run, not used in the fit: position error "
            f"RMS {1e3 * before.rms_m:.0f} → {1e3 * after.rms_m:.0f} mm, at the end "
            f"{1e3 * before.final_m:.0f} → {1e3 * after.final_m:.0f} mm; largest heading error "
            f"{math.degrees(before.heading_rad):.1f} → {math.degrees(after.heading_rad):.1f} deg"
        )
    if not found.is_better:
        raise LogError(
            "the geometry found predicts the check run no better than the robot file's: no file was written",
            hint="drive again with a larger --room, or measure more exactly",
        )
    if out is not None and not as_json:  # after the result: on a full disk it has been printed
        console.print(f"\n[bold]{escape(str(write_geometry(found.study, robot, out)))}[/]", soft_wrap=True)


def _make_folder(folder: Path) -> None:
    """Make the folder of the runs. Raises OutputFileError."""
    from omniwheel import files

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise files.write_error(folder, error) from error
