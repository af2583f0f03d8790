# SPDX-License-Identifier: MIT
"""``omni robots new`` and ``omni robots --motors``: a robot file of one's own, copied or from data-sheet numbers."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer
from rich.markup import escape
from rich.table import Table

from omni.cli import completion
from omni.cli.common import JsonOption, console, examples, note, print_json
from omni.cli.options import RobotFolderOption
from omni_schema import Robot
from omniwheel.errors import DataSheetError
from omniwheel.number_text import parse_number
from omniwheel.robots import find_robot_file, new_robot_file, read_robot
from omniwheel.wiring import plan_wiring

if TYPE_CHECKING:
    from omniwheel.capability import DriveModel
    from omniwheel.datasheet import GearMotor

EXAMPLES = examples(
    "omni robots new mine --from three_wheel",
    "omni robots new mine --motor pololu_37d_30 --wheel-diameter 96mm --wheel-distance 160mm --mass 4",
    "omni robots new mine --no-load-rpm 330 --stall-torque 14kg.cm --stall-current 5.5 --voltage 12 --gear 30 "
    "--encoder 64CPR --wheel-diameter 96mm --wheel-distance 160mm --mass 4",
    "omni robots new mine --ask",
)
T = TypeVar("T")
_SHEET, _BODY = "From a data sheet", "The body"


def _option(name: str, text: str, panel: str, metavar: str) -> Any:
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=panel, show_default=False)


def new(
    name: Annotated[str, typer.Argument(help="Name of the new robot: a-z 0-9 _.")],
    template: Annotated[
        str | None, typer.Option("--from", help="Robot to copy.", autocompletion=completion.robots, show_default=False)
    ] = None,
    folder: RobotFolderOption = Path(),
    ask: Annotated[bool, typer.Option("--ask", help="Prompt for every number that is not given.")] = False,
    motor: Annotated[str | None, _option("--motor", "A motor of `omni robots --motors`.", _SHEET, "NAME")] = None,
    voltage: Annotated[float | None, _option("--voltage", "Rated voltage \\[V].", _SHEET, "V")] = None,
    no_load_rpm: Annotated[
        float | None, _option("--no-load-rpm", "Speed without load, output shaft \\[rpm].", _SHEET, "RPM")
    ] = None,
    stall_torque: Annotated[
        str | None, _option("--stall-torque", "Output shaft, with unit: 14kg.cm, 1.4N.m, 190oz.in.", _SHEET, "TORQUE")
    ] = None,
    stall_current: Annotated[float | None, _option("--stall-current", "\\[A]; may be left out.", _SHEET, "A")] = None,
    no_load_current: Annotated[
        float | None, _option("--no-load-current", "\\[A]; may be left out.", _SHEET, "A")
    ] = None,
    gear: Annotated[
        float | None, _option("--gear", "Encoder turns per wheel turn; 1: encoder at the wheel.", _SHEET, "N")
    ] = None,
    encoder: Annotated[
        str | None,
        _option("--encoder", "Per turn of its own shaft, as the sheet says: 64CPR, 16PPR, 16lines.", _SHEET, "N"),
    ] = None,
    wheels: Annotated[int, typer.Option("--wheels", min=3, max=4, rich_help_panel=_BODY, help="3 or 4.")] = 3,
    wheel_diameter: Annotated[
        str | None, _option("--wheel-diameter", "With unit: 96mm, 3.8in.", _BODY, "LENGTH")
    ] = None,
    wheel_distance: Annotated[
        str | None,
        _option("--wheel-distance", "From the centre to a wheel's contact point, with unit.", _BODY, "LENGTH"),
    ] = None,
    mass: Annotated[float | None, _option("--mass", "Mass of the whole robot \\[kg].", _BODY, "KG")] = None,
    supply: Annotated[
        float | None, _option("--supply", "Battery voltage \\[V]. Default: the motor's rated voltage.", _BODY, "V")
    ] = None,
    bridge_current: Annotated[
        float | None, _option("--bridge-current", "Current limit of the bridge \\[A]. Default: none.", _BODY, "A")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Start a robot file of your own: a copy of another, or from the numbers of a motor's data sheet.

    From data-sheet numbers, motor constants and limits are derived, and every line says where its number came from.
    """
    from omniwheel.datasheet import RobotAnswers, find_motor, sheet_warnings, write_designed_robot
    from omniwheel.datasheet.units import length_m

    sheet = (motor, voltage, no_load_rpm, stall_torque, stall_current, no_load_current, gear, encoder)
    body = (wheel_diameter, wheel_distance, mass, supply, bridge_current)
    designed = ask or any(value is not None for value in (*sheet, *body))
    if designed and template is not None:
        raise typer.BadParameter("--from and data-sheet numbers exclude each other")
    if not designed and template is None and sys.stdin.isatty():
        designed = ask = True
    if not designed:
        target = new_robot_file(name, template or "three_wheel", folder)
        _say(target, f"a copy of {find_robot_file(template or 'three_wheel').stem}: change its numbers", as_json)
        return
    form = _Form(ask)
    answers = RobotAnswers(
        motor=find_motor(motor) if motor else form.motor(*sheet[1:]),
        wheels=wheels,
        wheel_diameter_m=form.quantity(wheel_diameter, "--wheel-diameter", "Wheel diameter, like 96mm", length_m),
        wheel_distance_m=form.quantity(
            wheel_distance, "--wheel-distance", "Centre to a wheel's contact, like 160mm", length_m
        ),
        mass_kg=form.number(mass, "--mass", "Mass of the whole robot [kg]"),
        supply_V=supply,
        bridge_A=bridge_current,
    )
    _say(
        write_designed_robot(name, answers, folder),
        "from data-sheet numbers: read the assumptions in its comments",
        as_json,
        sheet_warnings(answers),
    )


class _Form:
    """Takes what the options gave; asks for the rest, or says which option is missing."""

    def __init__(self, ask: bool) -> None:
        self.ask = ask

    def quantity(self, given: str | None, option: str, question: str, read: Callable[[str], float]) -> float:
        """Return what ``read`` makes of an answer; a question is asked again until the answer is one."""
        if given is not None:
            return read(given)
        if not self.ask:
            raise DataSheetError(f"{option} is missing", hint="give it, or --ask to be prompted for it")
        return self._asked(question, read)

    def number(self, given: float | None, option: str, question: str) -> float:
        """Return an answer as a number above 0."""
        return given if given is not None else self.quantity(None, option, question, _above_zero)

    def optional(self, given: float | None, question: str) -> float | None:
        """Return an answer, 0 or more, that may be left out."""
        if given is not None or not self.ask:
            return given
        return self._asked(
            f"{question}, Enter if unknown", lambda text: _not_negative(text) if text.strip() else None, default=""
        )

    @staticmethod
    def _asked(question: str, read: Callable[[str], T], default: str | None = None) -> T:
        while True:
            text = str(typer.prompt(question, default=default, show_default=False, err=True))
            try:
                return read(text)
            except DataSheetError as error:
                note(f"{error}; {error.hint}" if error.hint else str(error))

    def motor(
        self,
        voltage: float | None,
        no_load_rpm: float | None,
        stall_torque: str | None,
        stall_current: float | None,
        no_load_current: float | None,
        gear: float | None,
        encoder: str | None,
    ) -> GearMotor:
        """Return the motor of a data sheet."""
        from omniwheel.datasheet import GearMotor
        from omniwheel.datasheet.units import encoder_lines, torque_N_m

        return GearMotor(
            voltage_V=self.number(voltage, "--voltage", "Rated voltage [V]"),
            no_load_rad_s=self.number(no_load_rpm, "--no-load-rpm", "Speed without load [rpm]") * math.pi / 30.0,
            stall_torque_N_m=self.quantity(stall_torque, "--stall-torque", "Torque at stall, like 14kg.cm", torque_N_m),
            stall_current_A=self.optional(stall_current, "Current at stall [A]"),
            no_load_current_A=self.optional(no_load_current, "Current without load [A]"),
            gear=self.number(gear, "--gear", "Turns of the encoder per turn of the wheel"),
            encoder_lines=self.quantity(
                encoder, "--encoder", "Encoder per turn of its own shaft, like 64CPR, 16PPR or 16lines", encoder_lines
            ),
        )


def _not_negative(text: str) -> float:
    try:
        number = parse_number(text)
    except ValueError:
        raise DataSheetError(f"{text!r} is not a number") from None
    if not 0.0 <= number < math.inf:
        raise DataSheetError(f"{text!r} is below 0")
    return number


def _above_zero(text: str) -> float:
    number = _not_negative(text)
    if number == 0.0:
        raise DataSheetError("0 is not possible: give a number above 0")
    return number


def _say(target: Path, what: str, as_json: bool, doubts: Sequence[str] = ()) -> None:
    from omniwheel.capability import drive_model

    robot = read_robot(target)
    warnings = [*doubts, *warnings_of(robot, drive_model(robot))]
    if as_json:
        print_json({"file": str(target), "is": what, "warnings": warnings})
        return
    console.print(f"{escape(str(target))} written, {what}. Then: omni robots check {escape(str(target))}")
    print_warnings(warnings)


def warnings_of(robot: Robot, model: DriveModel) -> list[str]:
    """Return what is possible but unwise about a robot: its wiring, its sensors, then its numbers."""
    from omniwheel.capability import sensor_warnings
    from omniwheel.capability import warnings as doubts

    return [*plan_wiring(robot).warnings, *sensor_warnings(robot), *doubts(model)]


def print_warnings(warnings: Iterable[str]) -> None:
    """Print warnings about a robot file, a line each."""
    for warning in warnings:
        console.print(f"[bold red]![/] {escape(warning)}")


def print_motors(as_json: bool) -> None:
    """List the gear motors whose data sheets come with omniwheel."""
    from omniwheel.datasheet import catalogue

    known = catalogue().values()
    if as_json:
        print_json(
            {"motors": [vars(motor) | {"counts_per_revolution": motor.counts_per_revolution} for motor in known]}
        )
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("motor", "V", "rpm", "stall N m", "stall A", "counts/turn"):
        table.add_column(
            title, justify="left" if title == "motor" else "right", style="cyan" if title == "motor" else ""
        )
    for motor in known:
        rpm = motor.no_load_rad_s * 30.0 / math.pi
        table.add_row(
            motor.name,
            f"{motor.voltage_V:g}",
            f"{rpm:.0f}",
            f"{motor.stall_torque_N_m:.2f}",
            f"{motor.stall_current_A:g}",
            str(motor.counts_per_revolution),
        )
    console.print(table)
    for source in dict.fromkeys(motor.source.rpartition("(")[2].rstrip(")") for motor in known):
        console.print(f"[dim]{escape(source)}[/]")
