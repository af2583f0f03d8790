# SPDX-License-Identifier: MIT
"""What the identification of simulated robots answers: the numbers of Table 9's page and of its picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """One simulated robot: estimates and truth by name, which intervals hold the truth, and half their width."""

    found: dict[str, float]
    truth: dict[str, float]
    covered: dict[str, bool]
    half_width: dict[str, float]


@dataclass(frozen=True)
class Validation:
    """A run that was not fitted: times (n,), speeds (n, wheels) [rad/s]; ``fit`` is the share explained."""

    time_s: Array
    measured_rad_s: Array
    predicted_rad_s: Array
    fit: float
