# SPDX-License-Identifier: MIT
"""Motor curve from logs of duty and coarse counts: deadband, slope and lag per wheel and direction.

The wheel follows  T w' + w = f(u),  f(u) = sgn(u) max(|u| - deadband, 0) / slope,  with deadband and slope by
direction. It is the steady state of (24)-(27) with Coulomb friction. An output-error fit. The counts, which jump by
several from row to row, are only ever compared with a speed that the duty explains. Outliers weigh little (Cauchy
loss).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omniwheel.errors import LogError
from omniwheel.identification.estimate import require_scipy
from omniwheel.logs.calibration import MotorCurve
from omniwheel.logs.log import Array, WheelLog

START = (0.03, 0.03, 0.02, 0.02, 0.1)
LOWER = (0.002, 0.002, 0.0, 0.0, 0.01)
UPPER = (1.0, 1.0, 0.5, 0.5, 2.0)
LEAST_DUTY = 0.02
LEAST_ROWS = 50
_SD_PER_MAD = 1.4826


@dataclass(frozen=True)
class CurveFit:
    """A motor curve; the standard deviation of each of its numbers; noise of the counts about it [rad/s] per wheel.

    A direction that the duty never took has the other's numbers and infinite standard deviations.
    """

    curve: MotorCurve
    sd: MotorCurve
    noise_rad_s: Array


def fit_motor_curve(logs: Sequence[WheelLog]) -> CurveFit:
    """Fit the curves of all wheels to logs with the same load. Raises LogError if they do not drive the wheels."""
    fits = [_fit_wheel(logs, wheel) for wheel in range(logs[0].wheels)]
    values, sds, noises = (np.array(part) for part in zip(*fits, strict=True))
    return CurveFit(MotorCurve(*values.T), MotorCurve(*sds.T), noises)


def lagged(speed: Array, time_constant_s: float, period_s: float) -> Array:
    """First-order lag of a wanted speed (n,), from rest, held over each period."""
    keep = float(np.exp(-period_s / time_constant_s))
    return np.asarray(require_scipy("signal").lfilter([0.0, 1.0 - keep], [1.0, -keep], speed), dtype=np.float64)


def _steady(parameters: Array, duty: Array) -> Array:
    forward, reverse, dead_forward, dead_reverse, _ = parameters
    back = np.maximum(-duty - dead_reverse, 0.0) / reverse
    return np.asarray(np.maximum(duty - dead_forward, 0.0) / forward - back)


def _fit_wheel(logs: Sequence[WheelLog], wheel: int) -> tuple[Array, Array, float]:
    duties = [log.duty[:, wheel] for log in logs]
    speeds = [log.wheel_rad_s[:, wheel] for log in logs]
    goods = [log.good[:, wheel] for log in logs]
    every = np.concatenate(duties)
    driven = [np.sum(every > LEAST_DUTY) >= LEAST_ROWS, np.sum(every < -LEAST_DUTY) >= LEAST_ROWS]
    if not any(driven):
        problem = f"{', '.join(log.name for log in logs)}: wheel {wheel + 1} is never driven"
        raise LogError(problem, hint="map the duty columns, or give logs in which every wheel is driven")
    scales = [_SD_PER_MAD * np.median(np.abs(w[g] - np.median(w[g]))) for w, g in zip(speeds, goods, strict=True)]

    def residuals(parameters: Array, weighted: bool = True) -> Array:
        parts = []
        for log, duty, speed, good, scale in zip(logs, duties, speeds, goods, scales, strict=True):
            model = lagged(_steady(parameters, duty), parameters[4], log.period_s)
            parts.append((speed - model)[good] / (max(scale, log.quantum_rad_s) if weighted else 1.0))
        return np.concatenate(parts)

    found = require_scipy("optimize").least_squares(
        residuals, START, bounds=(LOWER, UPPER), loss="cauchy", x_scale=START
    )
    free = np.array([driven[0], driven[1], driven[0], driven[1], True])
    values = found.x.copy()
    for direction in (0, 1):
        if not driven[direction]:
            values[[direction, 2 + direction]] = values[[1 - direction, 3 - direction]]
    return values, _deviations(found.jac, residuals(found.x), free), float(np.std(residuals(found.x, weighted=False)))


def _deviations(jacobian: Array, residuals: Array, free: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Array:
    """Standard deviations from the robust curvature; infinite where nothing was excited."""
    sd = np.full(len(free), np.inf)
    columns = jacobian[:, free]
    weight = 1.0 / (1.0 + residuals**2)
    spread = float(np.sum(weight * residuals**2) / np.sum(weight))
    sd[free] = np.sqrt(np.maximum(spread * np.diag(np.linalg.pinv(columns.T @ columns)), 0.0))
    return sd
