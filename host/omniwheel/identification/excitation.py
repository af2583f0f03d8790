# SPDX-License-Identifier: MIT
"""Runs that excite a robot: Appendix D's circles and spins both ways, steps for a stand, and a run to validate with.

Each is a table of duties (rows, wheels), -1..1 in the wheels' own directions, held for PERIOD_S per row.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omniwheel.limits import EXCITATION_S

Array = NDArray[np.float64]

PERIOD_S = 0.02
DURATION_S = EXCITATION_S
CIRCLE_DUTY = 160.0 / 255.0
SPIN_DUTY = 150.0 / 255.0
LAP_S = 10.0
RAMP_S = 1.0
MODULATION = 0.4
MODULATION_S = 4.0
STAND_LEVELS = (0.005, 0.01, 0.015, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.35, 0.5, 0.7)
STAND_HOLD_S = 1.0
STAND_REST_S = 0.6


def _times(duration_s: float) -> Array:
    return np.arange(round(duration_s / PERIOD_S), dtype=np.float64) * PERIOD_S


def _ramp(duration_s: float) -> Array:
    """Return a factor (rows, 1) that rises from 0 to 1 and falls back: steps would shake what the model leaves out."""
    t = _times(duration_s)[:, None]
    ramp: Array = 0.5 - 0.5 * np.cos(np.pi * np.clip(np.minimum(t, duration_s - t) / RAMP_S, 0.0, 1.0))
    return ramp


def circle(angle_rad: Array, direction: int, duration_s: float = DURATION_S, duty: float = CIRCLE_DUTY) -> Array:
    """Push in a direction that turns once per LAP_S: circles, counter-clockwise for direction +1, clockwise for -1."""
    heading = direction * 2.0 * np.pi * _times(duration_s)[:, None] / LAP_S
    return duty * _ramp(duration_s) * np.sin(heading - angle_rad)


def spin(
    angle_rad: Array,
    direction: int,
    duration_s: float = DURATION_S,
    duty: float = SPIN_DUTY,
    modulation: float = MODULATION,
) -> Array:
    """Turn in place; ``modulation`` is the share of the duty that swings, 0 is a constant duty as in the report."""
    swing = 1.0 - modulation + modulation * np.cos(2.0 * np.pi * _times(duration_s)[:, None] / MODULATION_S)
    return direction * duty * _ramp(duration_s) * swing * np.ones(len(angle_rad))


def appendix_d(angle_rad: Array, duration_s: float = DURATION_S, modulation: float = MODULATION) -> dict[str, Array]:
    """Return the four runs by name."""
    return {
        "circle ccw": circle(angle_rad, 1, duration_s),
        "circle cw": circle(angle_rad, -1, duration_s),
        "spin ccw": spin(angle_rad, 1, duration_s, modulation=modulation),
        "spin cw": spin(angle_rad, -1, duration_s, modulation=modulation),
    }


def stand_steps(wheels: int, levels: Sequence[float] = STAND_LEVELS) -> Array:
    """Step all wheels to each duty and back to rest, forwards and backwards."""
    rest = np.zeros(round(STAND_REST_S / PERIOD_S))
    hold = np.ones(round(STAND_HOLD_S / PERIOD_S))
    steps = [part for level in levels for sign in (1.0, -1.0) for part in (rest, sign * level * hold)]
    return np.outer(np.concatenate([*steps, rest]), np.ones(wheels))


def validation(angle_rad: Array, duration_s: float = 20.0) -> Array:
    """Move along x, y and theta at once with other periods than the identification runs have."""
    t = _times(duration_s)[:, None]
    x, y, turn = np.sin(2.0 * np.pi * t / 3.1), np.sin(2.0 * np.pi * t / 4.3), np.sin(2.0 * np.pi * t / 2.3)
    duty: Array = 0.25 * _ramp(duration_s) * (-np.sin(angle_rad) * x + np.cos(angle_rad) * y + turn)
    return duty
