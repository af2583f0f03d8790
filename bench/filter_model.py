# SPDX-License-Identifier: MIT
"""The filter study of the report's Tables 5 and 7 as plain matrices, so that every peer computes the same model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.filter_limits import per_axis, to_body
from omni_reproduce.filters import Setting, believed_pose_noise, motor_model, reference
from omniwheel._core import ffi, lib

Array = NDArray[np.float64]

NORMALS = 20
"""Standard normals per step: (w, i) per wheel [0:8], measured speeds [8:12], pose [12:15], fix [15:18], two unused."""
MOTOR, MEASURED, POSE, FIX = slice(0, 8), slice(8, 12), slice(12, 15), slice(15, 18)
_STREAM = 0x46494C54
_BLOCK = 4


@dataclass(frozen=True)
class FilterModel:
    """One setting; units and meaning as ``hil_filter_config_t``. Matrices are per step of ``step_s``."""

    step_s: float
    motor_a: Array
    """(2, 2): (w [rad/s], i [A])."""
    motor_b: Array
    """(2,): from the voltage."""
    motor_sd: Array
    """(2,)"""
    measured_sd: float
    pose_sd: Array
    """(3,)"""
    fix_sd: Array
    """(3,)"""
    kf_q: Array
    """(2,): variances."""
    ekf_q: Array
    """(2, 3): variances; rows without and with motor filters."""
    to_body: Array
    """(3, wheels): wheel speeds [rad/s] to the body's twist."""
    to_wheels: Array
    """(wheels, 3): the body's twist to wheel speeds."""
    ismc_lambda: Array
    ismc_k: Array
    drive_true: bool
    raw_measured: bool
    stale: bool
    poses: Array
    """(steps + 1, 3)"""
    rates: Array
    """(steps, 3)"""

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.rates)


@dataclass(frozen=True)
class FilterRun:
    """What a peer's run leaves: RMS errors (4, 3); truth (steps, 3) and estimates (steps, 4, 3) if it keeps them."""

    rmse: Array
    truth: Array | None = None
    estimates: Array | None = None


def filter_model(setting: Setting) -> FilterModel:
    """Return a setting for the peers: four wheels, the controller on KF + EKF, fixes of now or one step old."""
    if setting.wheels != 4 or setting.controlled != "kf_ekf" or setting.fix not in ("fresh", "stale"):
        raise ValueError(f"the peers do not know the setting {setting.title!r}")
    a, b = motor_model(setting)
    poses, rates = reference(setting)
    body = to_body(setting)
    return FilterModel(
        step_s=setting.step_s,
        motor_a=a,
        motor_b=b,
        motor_sd=np.sqrt(setting.motor_step_q),
        measured_sd=float(np.sqrt(setting.motor_r)),
        pose_sd=np.sqrt(per_axis(setting.pose_q)),
        fix_sd=np.sqrt(per_axis(setting.fix_r)),
        kf_q=np.asarray(setting.kf_step_q, dtype=float),
        ekf_q=np.stack([per_axis(row) for row in believed_pose_noise(setting)]),
        to_body=body,
        to_wheels=np.asarray(np.linalg.pinv(body), dtype=np.float64),
        ismc_lambda=np.asarray(setting.ismc_lambda),
        ismc_k=np.asarray(setting.ismc_k),
        drive_true=setting.drive == "true",
        raw_measured=setting.raw == "measured",
        stale=setting.fix == "stale",
        poses=poses,
        rates=rates,
    )


def study_normals(seed: int, steps: int) -> Array:
    """Return the standard normals (steps, NORMALS) that ``hil_filter_study`` draws for a seed."""
    blocks = steps * NORMALS // _BLOCK
    normals = np.empty(blocks * _BLOCK, dtype=np.float32)
    lib.hil_normals(seed, _STREAM, 0, blocks, ffi.cast("float *", ffi.from_buffer(normals)))
    return normals.astype(np.float64).reshape(steps, NORMALS)


def draw_normals(seed: int, steps: int) -> Array:
    """Return standard normals (steps, NORMALS) from NumPy's own generator, as a script would draw them."""
    return np.random.default_rng(seed).standard_normal((steps, NORMALS))


def rms(truth: Array, estimates: Array) -> Array:
    """Return the RMS error (4, 3) of estimates (steps, 4, 3)."""
    return np.asarray(np.sqrt(((estimates - truth[:, None]) ** 2).mean(axis=0)))
