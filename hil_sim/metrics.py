# SPDX-License-Identifier: MIT
"""What a run's record says in numbers: accuracy against the truth, effort, chatter.

Errors are truth minus reference while the robot drives its path (phase PATH); headings are compared wrapped to -pi..pi.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

PHASE_PATH = 2
PHASE_DONE = 3
STATE_ARMED = 2


@dataclass(frozen=True)
class Rmse:
    """Root mean square errors: x and y [m], theta [rad], position sqrt(x^2 + y^2) [m]. NaN if there was no sample."""

    x_m: float
    y_m: float
    theta_rad: float
    position_m: float


@dataclass(frozen=True)
class Effort:
    """How hard the wheels worked on the path.

    ``peak_wheel_rad_s`` is the fastest true wheel speed, and ``rms_duty`` the root mean square of all duties.
    ``saturated_share`` is the share of samples in which wheel speeds or voltages were cut. ``chatter`` is the mean
    change of a duty from one record to the next over the mean duty, both absolute. 0 is perfectly steady, 2 is full
    reversal every time.
    """

    peak_wheel_rad_s: float
    peak_duty: float
    rms_duty: float
    saturated_share: float
    chatter: float


def wrap(angle: FloatArray) -> FloatArray:
    """Return the angles [rad] wrapped to -pi..pi."""
    wrapped: FloatArray = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped


def pose_error(record: NDArray[Any], first: str = "truth", second: str = "reference") -> FloatArray:
    """Return first minus second, shape (n, 3): m, m, rad; heading wrapped."""
    error: FloatArray = record[first] - record[second]
    error[:, 2] = wrap(error[:, 2])
    return error


def on_path(record: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which samples count for accuracy: armed and in phase PATH, shape (n,)."""
    chosen: NDArray[np.bool_] = (record["phase"] == PHASE_PATH) & (record["state"] == STATE_ARMED)
    return chosen


def rmse(error: FloatArray) -> Rmse:
    """Return the root mean squares of pose errors, shape (n, 3)."""
    if len(error) == 0:
        return Rmse(np.nan, np.nan, np.nan, np.nan)
    x, y, theta = np.sqrt(np.mean(error**2, axis=0))
    return Rmse(float(x), float(y), float(theta), float(np.hypot(x, y)))


def tracking_rmse(record: NDArray[Any], start_s: float = -np.inf, stop_s: float = np.inf) -> Rmse:
    """Return the tracking error on the path between two times (the second exclusive)."""
    chosen = on_path(record) & (record["time_s"] >= start_s) & (record["time_s"] < stop_s)
    return rmse(pose_error(record[chosen]))


def estimator_rmse(record: NDArray[Any]) -> Rmse:
    """Return the error of the pose estimate on the path: estimate minus truth."""
    return rmse(pose_error(record[on_path(record)], "estimate", "truth"))


def effort(record: NDArray[Any], wheels: int) -> Effort:
    """Return peaks, saturation and chatter on the path for the first ``wheels`` wheels."""
    path = record[on_path(record)]
    if len(path) < 2:
        return Effort(np.nan, np.nan, np.nan, np.nan, np.nan)
    duty = path["duty"][:, :wheels]
    cut = (path["wheel_scale"] < 1.0) | (path["duty_scale"] < 1.0)
    mean_duty = float(np.mean(np.abs(duty)))
    mean_change = float(np.mean(np.abs(np.diff(duty, axis=0))))
    return Effort(
        peak_wheel_rad_s=float(np.max(np.abs(path["wheel_rad_s"][:, :wheels]))),
        peak_duty=float(np.max(np.abs(duty))),
        rms_duty=float(np.sqrt(np.mean(duty**2))),
        saturated_share=float(np.mean(cut)),
        chatter=mean_change / mean_duty if mean_duty > 0.0 else 0.0,
    )


def spread(values: list[dict[str, float]]) -> dict[str, dict[str, float]]:
    """Return mean and standard deviation (of the sample) per key of equal dictionaries."""
    result = {}
    for key in values[0]:
        column = np.array([entry[key] for entry in values])
        sd = float(np.std(column, ddof=1)) if len(column) > 1 else 0.0
        result[key] = {"mean": float(np.mean(column)), "sd": sd}
    return result


def as_dict(metric: Rmse | Effort) -> dict[str, float]:
    """Return a metric as a plain dictionary, for JSON."""
    return asdict(metric)
