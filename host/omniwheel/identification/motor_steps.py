# SPDX-License-Identifier: MIT
"""Motor constants and deadband from voltage steps while the wheels turn freely on a stand."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.model import Model
from omniwheel.identification.output_error import Fit, identify
from omniwheel.identification.segments import measured_speed

Array = NDArray[np.float64]

HOLD_MIN_S = 0.3
TURNING_rad_s = 0.02
SAME_STEP_V = 0.02
"""A voltage that stays within this, or within 2 % of itself, is one step."""


@dataclass(frozen=True)
class Deadband:
    """One wheel and direction: it stands still up to ``still_V`` and turns from ``moving_V`` on [V, not negative]."""

    wheel: int
    direction: int
    still_V: float
    moving_V: float


@dataclass(frozen=True)
class MotorSteps:
    """What a stand shows: all wheels as one motor, each wheel on its own, and where they begin to turn."""

    together: Fit
    each: tuple[Fit, ...]
    deadbands: tuple[Deadband, ...]


def identify_motors(run: Dataset) -> MotorSteps:
    """Identify from a run with steps, wheels off the floor. Raises IdentificationError."""
    wheels = tuple(range(run.wheels))
    return MotorSteps(
        identify([run], Model.stand(wheels)),
        tuple(identify([run], Model.stand((wheel,))) for wheel in wheels),
        tuple(deadband(run, wheel, direction) for wheel in wheels for direction in (1, -1)),
    )


def deadband(run: Dataset, wheel: int, direction: int) -> Deadband:
    """Bracket the voltage from which a wheel turns, from steps that hold at least HOLD_MIN_S."""
    still, moving = [0.0], [np.inf]
    for voltage, speed in _steps(run, wheel):
        if np.sign(voltage) == direction:
            (moving if direction * speed > TURNING_rad_s else still).append(abs(voltage))
    lowest = min(moving)
    if not np.isfinite(lowest):
        raise IdentificationError(
            f"wheel {wheel + 1} never turns {'forwards' if direction > 0 else 'backwards'}",
            hint="step the duty up to at least half, both ways, each step held for a second",
        )
    return Deadband(wheel, direction, max([v for v in still if v < lowest]), lowest)


def _steps(run: Dataset, wheel: int) -> list[tuple[float, float]]:
    """Return voltage and settled speed of each step: the mean speed of its second half."""
    voltage, speed = run.voltage_V[:, wheel], measured_speed(run)[:, wheel]
    jump = np.abs(np.diff(voltage)) > np.maximum(SAME_STEP_V, 0.02 * np.abs(voltage[1:]))
    edges = np.concatenate(([0], np.flatnonzero(jump) + 1, [len(voltage)]))
    steps = []
    for first, last in pairwise(edges.tolist()):
        if run.time_s[last - 1] - run.time_s[first] >= HOLD_MIN_S:
            half = slice((first + last) // 2, last)
            steps.append((float(np.mean(voltage[half])), float(np.nanmean(speed[half]))))
    return steps
