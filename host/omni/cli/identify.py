# SPDX-License-Identifier: MIT
"""``omni identify``: from a log, a live robot or a simulated one to a robot file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli import identify_geometry, identify_geometry_live, identify_logs
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
from omni.cli.log_options import PartOption
from omni.cli.options import NameOption, OwnSeedOption, RobotFolderOption
from omni_schema import Robot as RobotFile
from omniwheel.limits import DEFAULT_TIMEOUT_S, EXCITATION_S
from omniwheel.robots import free_robot_path, read_robot
from omniwheel.tlog import TlogWriter

if TYPE_CHECKING:
    from omniwheel.identification.dataset import Dataset
    from omniwheel.identification.motor_steps import MotorSteps
    from omniwheel.identification.physical import Known
    from omniwheel.identification.pipeline import Identification

app = typer.Typer(
    help="Identify a robot's parameters from its motion and write them into a robot file.", no_args_is_help=True
)

app.command("geometry", epilog=identify_geometry.EXAMPLES)(identify_geometry.identify_geometry)
app.command("geometry-live", epilog=identify_geometry_live.EXAMPLES)(identify_geometry_live.identify_geometry_live)
app.command("logs", epilog=identify_logs.EXAMPLES)(identify_logs.identify_logs)

RobotOption = Annotated[
    str,
    typer.Option(
        "--robot",
        "-r",
        metavar="NAME|FILE",
        help="Robot or robot file with this wheel layout, copied into the new file.",
    ),
]
MassOption = Annotated[
    float | None,
    typer.Option("--mass", metavar="KG", help="Measured mass. Default: the robot file's.", show_default=False),
]
ResistanceOption = Annotated[
    float | None,
    typer.Option(
        "--resistance",
        metavar="OHM",
        help="Measured resistance of a winding. Default: the robot file's.",
        show_default=False,
    ),
]
ConstantOption = Annotated[
    float | None,
    typer.Option(
        "--motor-constant",
        metavar="N.M/A",
        help="K of the data sheet, seen at the wheel, in place of --stand. Default: the robot file's.",
        show_default=False,
    ),
]
StandOption = Annotated[
    Path | None,
    typer.Option("--stand", metavar="LOG", help="Log of voltage steps with the wheels lifted.", show_default=False),
]
ValidateOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--validate",
        metavar="LOG",
        help="Validation log, not used in the fit; repeatable.",
        show_default=False,
    ),
]
PartDurationOption = Annotated[
    float,
    typer.Option("--duration", "-d", min=4.0, max=600.0, metavar="S", help="Duration of each of the four segments."),
]


@app.command(
    "telemetry",
    epilog=examples(
        "omni identify telemetry drive.tlog --robot three_wheel --mass 3.52 --stand stand.tlog",
        "omni identify telemetry drive.tlog --validate other.tlog --motor-constant 1.05 --name mine --json",
    ),
)
def telemetry(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help=".tlog files with OMNI_SAMPLE.")],
    robot: RobotOption = "three_wheel",
    stand: StandOption = None,
    validate: ValidateOption = None,
    mass: MassOption = None,
    resistance: ResistanceOption = None,
    motor_constant: ConstantOption = None,
    part: PartOption = None,
    name: NameOption = "identified",
    folder: RobotFolderOption = Path(),
    as_json: JsonOption = False,
) -> None:
    """Identify from telemetry logs: those of `omni identify live --log`, or others with OMNI_SAMPLE at 50 Hz.

    Of a log with restarts the longest part is used; --part chooses another, with a single LOG.
    """
    from omniwheel.identification.pipeline import identify_robot

    if part is not None and len(logs) > 1:
        raise typer.BadParameter("--part chooses a part of one log; give a single LOG")
    base = read_robot(robot)
    found = identify_robot(
        base,
        [_read(path, base, part) for path in logs],
        _known(base, mass, resistance, motor_constant, stand),
        stand=_read(stand, base) if stand is not None else None,
        validation=[_read(path, base) for path in validate or []],
    )
    _finish(found, name, robot, folder, as_json)


@app.command(
    "live",
    epilog=examples(
        "omni identify live --link tcp:127.0.0.1:5760 --robot three_wheel --name mine",
        "omni identify live --on-stand --log stand.tlog",
        "omni identify live --duration 20 --log drive.tlog --stand stand.tlog --mass 3.52 --resistance 2.68",
    ),
)
def live(
    robot: RobotOption = "three_wheel",
    link: LinkOption = None,
    duration: PartDurationOption = EXCITATION_S,
    on_stand: Annotated[
        bool, typer.Option("--on-stand", help="With lifted wheels: step the motors and only write the --log.")
    ] = False,
    log: Annotated[
        Path | None,
        typer.Option("--log", metavar="OUT.tlog", help="Telemetry log to write (.tlog).", show_default=False),
    ] = None,
    stand: StandOption = None,
    mass: MassOption = None,
    resistance: ResistanceOption = None,
    motor_constant: ConstantOption = None,
    name: NameOption = "identified",
    folder: RobotFolderOption = Path(),
    timeout: TimeoutOption = DEFAULT_TIMEOUT_S,
    as_json: JsonOption = False,
) -> None:
    """Drive circles and spins both ways with fixed duties, record, and identify. The robot needs room.

    No controller holds the robot on its path: stand by to stop it.
    """
    from omniwheel.identification import excitation
    from omniwheel.identification.live import excite
    from omniwheel.identification.model import layout_of
    from omniwheel.identification.motor_steps import identify_motors
    from omniwheel.identification.pipeline import identify_robot

    base = read_robot(robot)
    if on_stand and log is None:
        raise typer.BadParameter("--on-stand needs --log OUT.tlog")
    if log is not None and log.exists():
        raise typer.BadParameter(f"{log} exists already; choose another name")
    if not on_stand:
        free_robot_path(name, folder)
    known = _known(base, mass, resistance, motor_constant, stand)
    free = _read(stand, base) if stand is not None else None
    angles = layout_of(base).angle_rad
    steps = {"steps on the stand": excitation.stand_steps(base.wheels)}
    profiles = steps if on_stand else excitation.appendix_d(angles, duration)
    writer = TlogWriter(writable_path(log, "the log")) if log is not None else None
    try:
        recorder = writer.write if writer is not None else None
        with signals_interrupt(), open_robot(link, timeout_s=timeout, recorder=recorder) as connected:
            run = excite(connected, profiles, lambda text: note(f"{text} …", quiet=as_json))
    finally:
        if writer is not None:
            writer.close()
    if on_stand:
        _finish_stand(identify_motors(run), as_json)
    else:
        _finish(identify_robot(base, [run], known, stand=free), name, robot, folder, as_json)


@app.command(
    "simulate",
    epilog=examples("omni identify simulate --seed 3 --name found", "omni identify simulate four_wheel --json"),
)
def simulate(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="Robot or robot file whose parameters are varied.")
    ] = "three_wheel",
    seed: OwnSeedOption = 1,
    duration: PartDurationOption = EXCITATION_S,
    name: NameOption = "identified",
    folder: RobotFolderOption = Path(),
    as_json: JsonOption = False,
) -> None:
    """Identify a simulated robot with random parameters and compare with their true values."""
    from hil_sim.known_robot import SimulatedRobot
    from omniwheel.identification import excitation
    from omniwheel.identification.model import layout_of
    from omniwheel.identification.pipeline import identify_robot

    base = read_robot(robot)
    free_robot_path(name, folder)
    simulated = SimulatedRobot.random(base, seed)
    angles = layout_of(base).angle_rad
    profiles = excitation.appendix_d(angles, duration)
    runs = [simulated.run(part, duty, run=i) for i, (part, duty) in enumerate(profiles.items())]
    stand = simulated.run("stand", excitation.stand_steps(base.wheels), run=len(runs), on_stand=True)
    other = simulated.run("validation", excitation.validation(angles), run=len(runs) + 1)
    truth = simulated.true_values()
    known = _known(base, truth["mass_kg"], truth["motor_resistance_ohm"], None, Path())
    found = identify_robot(base, runs, known, stand=stand, validation=[other])
    _finish(found, name, robot, folder, as_json, truth)


def _read(path: Path, base: RobotFile, part: int | None = None) -> Dataset:
    from omniwheel.identification.sources import read_dataset

    data = read_dataset(path, base.parameter_values(), part)
    if data.name != str(path):
        note(data.name)
    return data


def _known(
    base: RobotFile, mass: float | None, resistance: float | None, constant: float | None, stand: Path | None
) -> Known:
    """Return what is given, the robot file's numbers for the rest; with a stand, the motor constant is found."""
    from omniwheel.identification.physical import Known

    if constant is None and stand is None:
        constant = float(base.motor["constant_N_m_A"])
    return Known(
        mass if mass is not None else _file_number(base, "simulation", "mass_kg", "--mass"),
        resistance if resistance is not None else float(base.motor["resistance_ohm"]),
        float(base.motor["inductance_H"]),
        constant,
    )


def _file_number(base: RobotFile, section: str, key: str, option: str) -> float:
    value = getattr(base, section).get(key)
    if not isinstance(value, (int, float)):
        raise typer.BadParameter(f"{base.source} has no {section}.{key}; give {option}")
    return float(value)


def _finish_stand(motors: MotorSteps, as_json: bool) -> None:
    estimate = motors.together.estimate
    if as_json:
        values = {
            name: {"value": estimate[name], "half_width_95": estimate.half_width(name)} for name in estimate.names
        }
        print_json({"parameters": values, "deadbands": [vars(band) for band in motors.deadbands]})
        return
    for name in estimate.names:
        console.print(f"{escape(name)} {estimate[name]:.5g} ± {estimate.half_width(name):.2g}")
    _print_deadbands(motors)


def _print_deadbands(motors: MotorSteps) -> None:
    for band in motors.deadbands:
        way = "forwards" if band.direction > 0 else "backwards"
        console.print(
            f"wheel {band.wheel + 1} {way}: stands still up to {band.still_V:.2f} V, turns from {band.moving_V:.2f} V"
        )


def _finish(
    found: Identification,
    name: str,
    template: str,
    folder: Path,
    as_json: bool,
    truth: dict[str, float] | None = None,
) -> None:
    from omniwheel.identification.robot_file import write_robot_file

    if as_json:
        print_json(_as_dict(found, write_robot_file(found, name, template, folder), truth))
        return
    console.print(_table(found, truth))
    if found.motors is not None:
        _print_deadbands(found.motors)
    shown = found.diagnostics
    console.print(f"{100 * shown.fit:.2f} % of the speeds explained, residual {1e3 * shown.rmse_rad_s:.1f} mrad/s")
    if found.validation == found.validation:
        console.print(f"{100 * found.validation:.2f} % of a run that was not fitted")
    for remark in found.remarks:
        console.print(escape(remark))
    path = write_robot_file(found, name, template, folder)  # last: on a full disk a long drive has been told
    console.print(f"\n[bold]{escape(str(path))}[/]  check it with: omni robots check {escape(str(path))}")


def _each(
    found: Identification, truth: dict[str, float] | None, take: Callable[[str, float, float, float | None], None]
) -> None:
    for estimate in found.estimates():
        for name in estimate.names:
            take(name, estimate[name], estimate.half_width(name), None if truth is None else truth[name])


def _table(found: Identification, truth: dict[str, float] | None) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    titles = ("parameter", "value", "± 95 %", "truth", "") if truth is not None else ("parameter", "value", "± 95 %")
    for title in titles:
        table.add_column(
            title,
            style="cyan" if title == "parameter" else "",
            justify="left" if title in ("parameter", "") else "right",
        )

    def add(name: str, value: float, half_width: float, true: float | None) -> None:
        cells = [name, f"{value:.5g}", f"{half_width:.2g}"]
        if true is not None:
            cells += [f"{true:.5g}", "inside" if abs(value - true) <= half_width else "[yellow]outside[/]"]
        table.add_row(*cells)

    _each(found, truth, add)
    return table


def _as_dict(found: Identification, path: Path, truth: dict[str, float] | None) -> dict[str, Any]:
    parameters: dict[str, Any] = {}

    def add(name: str, value: float, half_width: float, true: float | None) -> None:
        entry: dict[str, Any] = {"value": value, "half_width_95": half_width}
        if true is not None:
            entry |= {"truth": true, "inside": abs(value - true) <= half_width}
        parameters[name] = entry

    _each(found, truth, add)
    return {
        "file": str(path),
        "parameters": parameters,
        "deadbands": [vars(band) for band in (found.motors.deadbands if found.motors is not None else ())],
        "diagnostics": found.diagnostics.as_dict(),
        "validation": found.validation,
        "remarks": list(found.remarks),
    }
