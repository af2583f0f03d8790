# SPDX-License-Identifier: MIT
"""Everything that a set of runs shows of a robot, in one call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from omni_schema import Robot
from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.diagnostics import Diagnostics, diagnose
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.geometry import calibrate
from omniwheel.identification.model import Layout, Model, layout_of
from omniwheel.identification.motor_steps import MotorSteps, identify_motors
from omniwheel.identification.output_error import Fit, evaluate, identify
from omniwheel.identification.physical import Known, physical


@dataclass(frozen=True)
class Identification:
    """What was found; None where data is missing.

    ``validation`` is the share of the speeds' variation explained in runs that were not fitted, nan without such runs.
    ``remarks`` say what could not be found and why, and what was taken from elsewhere.
    """

    floor: Fit
    diagnostics: Diagnostics
    layout: Layout
    known: Known
    motors: MotorSteps | None
    geometry: Estimate | None
    physical: Estimate
    validation: float
    remarks: tuple[str, ...]

    def estimates(self) -> tuple[Estimate, ...]:
        """Return all sets of parameters that were found."""
        return tuple(e for e in (self.floor.estimate, self.physical, self.geometry) if e is not None)


def identify_robot(
    robot: Robot,
    runs: Sequence[Dataset],
    known: Known,
    *,
    stand: Dataset | None = None,
    validation: Sequence[Dataset] = (),
) -> Identification:
    """Identify a robot whose layout is that of ``robot``. Raises IdentificationError if its motion is not shown.

    Missing motion capture is no error: the geometry is then the file's, and a remark says so.
    """
    layout = layout_of(robot)
    for run in [*runs, *validation, *([stand] if stand is not None else [])]:
        if run.wheels != robot.wheels:
            hint = "give the right robot with --robot"
            raise IdentificationError(f"{run.name} has {run.wheels} wheels, {robot.name} has {robot.wheels}", hint=hint)
    remarks = []
    geometry = None
    try:
        geometry = calibrate(runs, layout)
        radius = float(geometry.values[:-1].mean())
        layout = replace(layout, radius_m=radius, distance_m=geometry["wheel_distance_m"])
    except IdentificationError as error:
        remarks.append(f"Wheel radii and distance are the robot file's: {error}.")
    model = Model.floor(layout)
    floor = identify(runs, model)
    motors = identify_motors(stand) if stand is not None else None
    found = physical(floor.estimate, layout, known, None if motors is None else motors.together.estimate)
    diagnostics = diagnose(floor)
    if known.motor_constant_N_m_A is not None:
        remarks.append(f"The motor constant {known.motor_constant_N_m_A:g} N.m/A was given, not identified.")
    return Identification(
        floor,
        diagnostics,
        layout,
        known,
        motors,
        geometry,
        found,
        evaluate(validation, model, floor.estimate).fit if validation else float("nan"),
        (*remarks, *diagnostics.remarks()),
    )
