# SPDX-License-Identifier: MIT
"""What the filters of the study can reach: the limits beside each figure, for a setting and one of its true paths."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.filters import FILTERS, Array, Setting, Study, motor_model, pose_noise, wheel_noise
from omni_reproduce.riccati import dead_reckoning_covariance, joint_variances, mean_rms, pose_variances

_BURN_IN_S = 10.0
_WALK_POINTS = 127


def per_axis(pair: Array | tuple[float, float]) -> Array:
    """Return (x, y, theta) of a pair for positions and heading."""
    return np.array([pair[0], pair[0], pair[1]])


def to_body(setting: Setting) -> Array:
    """Return the matrix (3, wheels) from wheel speeds [rad/s] to the body's twist, for evenly spaced wheels."""
    bearing = 2.0 * np.pi * (np.arange(setting.wheels) + 0.5) / setting.wheels
    turn = np.full(setting.wheels, 1.0 / setting.distance_m)
    return setting.radius_m / setting.wheels * np.stack([-2.0 * np.sin(bearing), 2.0 * np.cos(bearing), turn])


class Limits:
    """Limits of one setting along the true path of one seed; the Riccati recursions take ``bound_s`` seconds of it."""

    def __init__(self, setting: Setting, seed: int, bound_s: float) -> None:
        study = Study(setting)
        self._setting = setting
        self._poses = np.vstack([study.poses[:1], study.samples(seed)["truth"]])
        steps = min(setting.steps, round(bound_s / setting.step_s))
        self._moves = np.diff(self._poses[: steps + 1], axis=0)
        self._skip = min(round(_BURN_IN_S / setting.step_s), steps // 2)

    def noise(self, filtered: bool) -> Array:
        """Return the variances per step (3) of what dead reckoning does not see, wheel speeds included."""
        setting = self._setting
        variance = wheel_noise(setting)[int(filtered)]
        if setting.drive == "estimate":
            variance = 0.0  # the truth goes where the filter says, and the open-loop model's error is not noise
        return per_axis(np.asarray(setting.pose_q) + pose_noise(setting, variance))

    def of(self, name: str) -> Array | None:
        """Return the limit (3) of the RMS error of one filter, None where there is none."""
        if name in ("none", "kf"):
            if name == "none" and self._setting.raw == "open loop":
                return None
            return self._walk(self.noise(name == "kf"))
        if self._setting.fix == "own":
            return None
        if name == "kf_ekf" and self._setting.drive == "true":
            return self._rms(self._joint())
        late = self._setting.fix != "fresh"
        r = per_axis(self._setting.fix_r)
        return self._rms(pose_variances(self._moves, self.noise(name == "kf_ekf"), r, late))

    def _rms(self, variances: Array) -> Array:
        return np.asarray(np.sqrt(variances[self._skip :].mean(axis=0)))

    def _joint(self) -> Array:
        setting = self._setting
        return joint_variances(
            self._moves,
            self._poses[: len(self._moves), 2] + 0.5 * self._moves[:, 2],
            to_body(setting),
            (motor_model(setting)[0], setting.motor_step_q, setting.motor_r),
            (per_axis(setting.pose_q), per_axis(setting.fix_r)),
            setting.step_s,
            setting.fix != "fresh",
        )

    def _walk(self, q: Array) -> Array:
        """Expectation of the RMS error of dead reckoning over the whole run."""
        covariances = dead_reckoning_covariance(self._poses[1:], q, _WALK_POINTS)
        return np.array([mean_rms(covariance) for covariance in covariances])


def nees(results: NDArray[np.void]) -> Array:
    """Return the normalised estimation error squared of the EKFs after each run (n, 2): 3 degrees of freedom."""
    error = results["final_error"][:, FILTERS.index("ekf") :]
    solved = np.linalg.solve(results["final_p"], error[..., None])[..., 0]
    return np.asarray((error * solved).sum(axis=2))
