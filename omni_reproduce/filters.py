# SPDX-License-Identifier: MIT
"""The filter study of the report's appendices B and C: settings, paths, and runs of ``hil_filter_study`` over seeds.

Filters are numbered like ``hil_filter_t``: none, KF, EKF, KF + EKF. Axes are x [m], y [m], theta [rad].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omni_reproduce.riccati import long_run_wheel_variance
from omniwheel._core import ffi, lib
from omniwheel.errors import OmniError

Array = NDArray[np.float64]

FILTERS = ("none", "kf", "ekf", "kf_ekf")
FILTER_TITLES = ("no filter", "KF", "EKF", "KF and EKF")
AXES = ("x", "y", "θ")
AXIS_UNITS = ("m", "m", "rad")

_DRIVES = {"true": lib.HIL_FILTER_DRIVE_TRUE, "estimate": lib.HIL_FILTER_DRIVE_ESTIMATE}
_RAWS = {"measured": lib.HIL_FILTER_RAW_MEASURED, "open loop": lib.HIL_FILTER_RAW_OPEN_LOOP}
_FIXES = {
    "fresh": lib.HIL_FILTER_FIX_FRESH,
    "stale": lib.HIL_FILTER_FIX_STALE,
    "late": lib.HIL_FILTER_FIX_LATE,
    "own": lib.HIL_FILTER_FIX_OWN,
}

PATHS = {
    "best": lib.HIL_FILTER_PATH_BEST,
    "single": lib.HIL_FILTER_PATH_SINGLE,
    "baseline": lib.HIL_FILTER_PATH_BASELINE,
    "avx2": lib.HIL_FILTER_PATH_AVX2,
    "avx512": lib.HIL_FILTER_PATH_AVX512,
}
"""How runs can be computed: the fastest, one by one, or eight or sixteen at a time with the named instructions."""

# Seeds that go to a thread at once: as many as are computed at a time.
_GROUP = 16


class SettingError(OmniError):
    """A setting of the filter study cannot be used; the message says which and why."""


def _double_fields(name: str) -> np.dtype[np.void]:
    """Return the layout of a C struct whose members are doubles or arrays of them."""
    ctype = ffi.typeof(name)

    def shape(member: Any) -> tuple[int, ...]:
        return (member.length, *shape(member.item)) if member.kind == "array" else ()

    return np.dtype([(field, np.float64, shape(member.type)) for field, member in ctype.fields])


RESULT = _double_fields("hil_filter_result_t")
SAMPLE = _double_fields("hil_filter_sample_t")


@dataclass(frozen=True)
class Setting:
    """One setting of the study; units and meaning as in the experiment's file and ``hil_filter_config_t``.

    ``kf_q`` is "Q" (eq. 53 as printed) or "Q T^2" (what eq. 45 makes of it). ``ekf_q`` is "pose" (the noise of the pose
    alone) or "pose and wheels" (and what the error of the wheel speeds adds).
    """

    title: str
    path: str
    wheels: int
    radius_m: float
    distance_m: float
    motor: Mapping[str, float]
    discretisation: str
    motor_q: tuple[float, float]
    motor_r: float
    pose_q: tuple[float, float]
    fix_r: tuple[float, float]
    kf_q: str
    ekf_q: str
    ismc_lambda: tuple[float, float, float]
    ismc_k: tuple[float, float, float]
    controlled: str
    drive: str
    raw: str
    fix: str
    duration_s: float
    step_s: float

    @property
    def steps(self) -> int:
        """Number of steps."""
        return round(self.duration_s / self.step_s)

    @property
    def motor_step_q(self) -> Array:
        """True variances per step of wheel speed and current (eq. 45: w enters times T)."""
        return np.asarray(self.motor_q) * self.step_s**2

    @property
    def kf_step_q(self) -> Array:
        """Variances per step that the motor filters believe."""
        return {"Q": np.asarray(self.motor_q, dtype=float), "Q T^2": self.motor_step_q}[self.kf_q]


def read_setting(spec: Mapping[str, Any], name: str) -> Setting:
    """Return the setting ``name`` of an experiment's file."""
    head = spec["experiment"]
    values = {**spec["common"], **spec["setting"][name]}
    for key in ("seeds", "quick_seeds"):
        values.pop(key, None)
    try:
        return Setting(duration_s=head["duration_s"], step_s=head["step_s"], **values)
    except TypeError as error:
        raise SettingError(f"setting {name}: {error}", hint="compare with the other settings of the file") from None


def reference(setting: Setting) -> tuple[Array, Array]:
    """Return the path (steps + 1 rows x, y, theta) and its rate as the controller gets it (steps rows).

    The rate is the backward difference, which is what the report's controllers use.
    """
    t = np.arange(-1, setting.steps + 1) * setting.step_s
    turn = 2.0 * np.pi * t
    if setting.path == "rose":
        angle = turn / 30.0
        radius = np.cos(2.0 * angle)
        poses = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sin(turn)], axis=1)
    elif setting.path == "report":  # eq. 81
        sines = np.stack([np.sin(turn / 12.0), np.sin(turn / 5.0), np.sin(turn / 16.0)], axis=1)
        cosines = np.stack([np.cos(turn / 14.0), np.cos(turn / 4.0), np.cos(turn / 8.0)], axis=1)
        poses = 0.5 * (sines + cosines)
    else:
        raise SettingError(f"path is {setting.path!r}", hint="use rose or report")
    rates = np.diff(poses, axis=0)[: setting.steps] / setting.step_s
    return np.ascontiguousarray(poses[1:]), np.ascontiguousarray(rates)


def motor_model(setting: Setting) -> tuple[Array, Array]:
    """Return the motor's A (2 x 2) and b (2) over one step, for (w [rad/s], i [A]) and the voltage."""
    m = setting.motor
    if setting.discretisation == "euler":
        a = np.array([[-m["b"] / m["J"], m["K"] / m["J"]], [-m["K"] / m["L"], -m["R"] / m["L"]]])
        return np.eye(2) + a * setting.step_s, np.array([0.0, setting.step_s / m["L"]])
    motor = ffi.new("omni_motor_config_t *", [m["J"], m["b"], m["K"], m["R"], m["L"]])
    model = ffi.new("omni_motor_discrete_t *")
    if setting.discretisation != "exact" or lib.omni_motor_discretise(motor, setting.step_s, model) != lib.OMNI_OK:
        raise SettingError(
            f"discretisation is {setting.discretisation!r}, motor is {dict(m)}",
            hint="use euler or exact, and positive motor constants",
        )
    return np.array([list(row)[1:] for row in model.a])[1:], np.array(list(model.b))[1:]


def wheel_noise(setting: Setting) -> Array:
    """Return the variance of the wheel speed's error [(rad/s)^2] as white noise: without and with motor filters."""
    a, _ = motor_model(setting)
    filtered = long_run_wheel_variance(a, setting.motor_step_q, setting.kf_step_q, setting.motor_r)
    return np.array([setting.motor_r, filtered])


def pose_noise(setting: Setting, wheel_variance: float) -> Array:
    """Return what an error of the wheel speeds [(rad/s)^2] adds per step to x and y [m^2] and to theta [rad^2]."""
    rolled = (setting.radius_m * setting.step_s) ** 2 * wheel_variance
    return rolled * np.array([2.0 / setting.wheels, 1.0 / (setting.wheels * setting.distance_m**2)])


def believed_pose_noise(setting: Setting) -> Array:
    """Return the variances per step that the EKFs believe (2 x 2): rows without and with motor filters."""
    q = np.tile(np.asarray(setting.pose_q), (2, 1))
    if setting.ekf_q == "pose and wheels":
        q += np.stack([pose_noise(setting, variance) for variance in wheel_noise(setting)])
    return q


def c_config(setting: Setting) -> Any:
    """Return the setting as ``hil_filter_config_t *``."""
    a, b = motor_model(setting)
    return ffi.new(
        "hil_filter_config_t *",
        {
            "steps": setting.steps,
            "step_s": setting.step_s,
            "wheels": setting.wheels,
            "radius_m": setting.radius_m,
            "distance_m": setting.distance_m,
            "motor_a": a.tolist(),
            "motor_b": b.tolist(),
            "motor_q": setting.motor_step_q.tolist(),
            "motor_r": setting.motor_r,
            "pose_q": list(setting.pose_q),
            "fix_r": list(setting.fix_r),
            "kf_q": setting.kf_step_q.tolist(),
            "ekf_q": believed_pose_noise(setting).tolist(),
            "ismc_lambda": list(setting.ismc_lambda),
            "ismc_k": list(setting.ismc_k),
            "controlled": FILTERS.index(setting.controlled),
            "drive": _DRIVES[setting.drive],
            "raw": _RAWS[setting.raw],
            "fix": _FIXES[setting.fix],
        },
    )


def _doubles(array: Array) -> Any:
    return ffi.cast("double *", ffi.from_buffer(array))


class Study:
    """A setting ready to run. Its methods may be called from several threads at once."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.poses, self._rates = reference(setting)
        self._config = c_config(setting)

    def _check(self, code: int) -> None:
        if code == -2:
            raise SettingError("this processor cannot do that", hint="use path best")
        if code != 0:
            raise SettingError(f"setting {self.setting.title!r} is outside the ranges of hil_filter_config_t")

    def results(self, seeds: Sequence[int], path: str = "best") -> NDArray[np.void]:
        """Return the results of the seeds, in their order: records of RESULT.

        ``path`` is how they are computed (PATHS); the results are the same bit for bit.
        """
        results = np.zeros(len(seeds), dtype=RESULT)
        code = lib.hil_filter_study_many(
            self._config,
            _doubles(self.poses),
            _doubles(self._rates),
            ffi.new("uint64_t[]", list(seeds)),
            len(seeds),
            PATHS[path],
            ffi.cast("hil_filter_result_t *", ffi.from_buffer(results)),
        )
        self._check(code)
        return results

    def samples(self, seed: int) -> NDArray[np.void]:
        """Return every step of one seed: steps records of SAMPLE."""
        samples = np.zeros(self.setting.steps, dtype=SAMPLE)
        result = ffi.new("hil_filter_result_t *")
        rows = ffi.cast("hil_filter_sample_t *", ffi.from_buffer(samples))
        poses, rates = _doubles(self.poses), _doubles(self._rates)
        self._check(lib.hil_filter_study(self._config, poses, rates, seed, result, rows))
        return samples


def run_seeds(
    setting: Setting, seeds: Sequence[int], workers: int, progress: Callable[[float], None] = lambda _: None
) -> NDArray[np.void]:
    """Return the results of the seeds, in their order: records of RESULT. Threads share the work."""
    study = Study(setting)
    groups = [seeds[first : first + _GROUP] for first in range(0, len(seeds), _GROUP)]
    results = []
    with ThreadPoolExecutor(workers) as pool:
        for number, group in enumerate(pool.map(study.results, groups)):
            results.append(group)
            progress((number + 1) / len(groups))
    return np.concatenate(results)


def shortened(setting: Setting, duration_s: float) -> Setting:
    """Return the setting over another time."""
    return replace(setting, duration_s=duration_s)
