# SPDX-License-Identifier: MIT
"""Identification on the page: the same as ``omni identify live``, as one of the experiments."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from omni_schema import Robot as RobotFile
from omniwheel.capability.speeds import direction, motor_speed
from omniwheel.errors import LimitError
from omniwheel.experiments.outcome import Figure
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.excitation import CIRCLE_DUTY, DURATION_S, LAP_S, appendix_d
from omniwheel.identification.live import excite
from omniwheel.identification.model import layout_of
from omniwheel.identification.physical import Known
from omniwheel.identification.pipeline import Identification, identify_robot
from omniwheel.identification.robot_file import write_robot_file
from omniwheel.robot import Robot
from omniwheel.robots import read_robot

NAME = "identified"
_DRIFT = 1.3
"""Nothing holds the robot on its circles: they wander, and slip makes them larger or smaller."""


@dataclass
class Identified:
    """A drive from which a robot is identified, as an experiment's outcome. The figures come with :meth:`write`."""

    base: RobotFile
    run: Dataset
    figures: list[Figure] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def write(self, folder: Path) -> None:
        """Compute, and write the robot file. Raises IdentificationError, RobotFileError, OutputFileError."""
        found = identify_robot(self.base, [self.run], _known(self.base))
        self.figures = [
            Figure(name, name.replace("_", " "), "", estimate[name], estimate.half_width(name))
            for estimate in found.estimates()
            for name in estimate.names
        ]
        path = write_robot_file(found, NAME, str(self.base.source), folder)
        self.remarks = [*_remarks(found), f"{path.name} in the folder is the robot file with these numbers."]


def identify(robot: Robot, file: str, room_m: float, tell: Callable[[str], None]) -> Identified:
    """Drive circles and spins with open-loop duty and record them. Raises LimitError before the robot moves."""
    base = read_robot(file)
    layout = layout_of(base)
    wheels = int(robot.parameters["WHEELS"])
    if wheels != base.wheels:
        raise LimitError(f"the robot has {wheels} wheels, {base.name} has {base.wheels}", hint="choose its robot file")
    _known(base)
    side_m = room_of(robot)
    if side_m > room_m:
        raise LimitError(
            f"it needs a free square of {side_m:.1f} m; {room_m:g} m are free",
            hint="`omni identify live` takes shorter segments; autotune needs less room",
        )
    profiles = appendix_d(layout.angle_rad, DURATION_S)
    tell(
        f"drives circles and spins for {len(profiles) * DURATION_S:.0f} s in a square of about {side_m:.1f} m, at"
        f" {100 * CIRCLE_DUTY:.0f} % of the supply. No controller holds it on its path: stand by"
    )
    return Identified(base, excite(robot, profiles, tell))


def room_of(robot: Robot) -> float:
    """Return the side of the square that the circles need, both ways round from where the robot stands [m]."""
    model = robot.drive_model()
    speed = max(motor_speed(model, direction(angle)) for angle in (0.0, math.pi / 2))
    diameter_m = speed * CIRCLE_DUTY / model.duty_limit * LAP_S / math.pi
    return _DRIFT * 2.0 * diameter_m + 2.0 * float(robot.parameters["WHEEL_DIST"])


def _known(base: RobotFile) -> Known:
    """Return what a scale and an ohm-meter say, from the robot file. Raises LimitError if it has no mass."""
    mass_kg = base.simulation.get("mass_kg")
    if not isinstance(mass_kg, int | float):
        raise LimitError(f"{base.name} has no simulation.mass_kg", hint="weigh the robot and add its mass to the file")
    motor = base.motor
    numbers = (motor["resistance_ohm"], motor["inductance_H"], motor["constant_N_m_A"])
    return Known(float(mass_kg), *(float(number) for number in numbers))


def _remarks(found: Identification) -> list[str]:
    shown = found.diagnostics
    return [
        f"{100 * shown.fit:.2f} % of the wheels' speeds are explained; {1e3 * shown.rmse_rad_s:.1f} mrad/s RMS "
        "residual.",
        *found.remarks,
    ]
