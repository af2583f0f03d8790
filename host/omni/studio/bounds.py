# SPDX-License-Identifier: MIT
"""Which limits of the robot a plot of a signal shows."""

from __future__ import annotations

from collections.abc import Mapping

SIGNAL_LIMITS: Mapping[str, str] = {
    "wheels.speed": "LIM_WHEEL",
    "wheels.reference": "LIM_WHEEL",
    "wheels.duty": "LIM_DUTY",
    "tracking.reference_rate.wz": "LIM_W",
    "control.error.x": "SAFE_ERR_XY",
    "control.error.y": "SAFE_ERR_XY",
    "control.error.theta": "SAFE_ERR_TH",
}
"""By a signal's key, or its beginning: the parameter that bounds it in both directions, in the signal's unit."""


def limit_of(key: str) -> str | None:
    """Return the parameter that limits a signal, None if there is none."""
    return SIGNAL_LIMITS.get(key) or SIGNAL_LIMITS.get(key.rpartition(".")[0])
