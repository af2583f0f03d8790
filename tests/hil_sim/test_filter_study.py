# SPDX-License-Identifier: MIT
"""The filter study: its truth against its own noise figures, its filters step for step against FilterPy."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter

from omni_reproduce import filters
from omni_reproduce.experiment import read_spec
from omni_reproduce.filter_limits import per_axis, to_body
from omni_reproduce.filters import (
    RESULT,
    SAMPLE,
    Setting,
    Study,
    believed_pose_noise,
    motor_model,
    run_seeds,
    shortened,
)
from omniwheel._core import ffi, lib

Array = npt.NDArray[np.float64]
SPEC = read_spec("table7")
WHEELS = 4


def setting(name: str = "honest_b", duration_s: float = 20.0, **changes: Any) -> Setting:
    return replace(shortened(filters.read_setting(SPEC, name), duration_s), **changes)


def moves(case: Setting, samples: npt.NDArray[np.void], speeds: str) -> Array:
    """Return the displacement (n, 3) in the world frame of each step but the first, rolling at the sampled speeds."""
    body = samples[speeds][1:] @ to_body(case).T * case.step_s
    heading = samples["truth"][:-1, 2] + 0.5 * body[:, 2]
    c, s = np.cos(heading), np.sin(heading)
    return np.stack([c * body[:, 0] - s * body[:, 1], s * body[:, 0] + c * body[:, 1], body[:, 2]], axis=1)


def assert_variance(values: Array, expected: float) -> None:
    """Zero mean and the variance expected, within 4.5 standard errors of the sample."""
    assert abs(values.mean()) < 4.5 * np.sqrt(expected / values.size)
    assert values.var() == pytest.approx(expected, rel=4.5 * np.sqrt(2.0 / values.size))


@pytest.mark.parametrize(("drive", "speeds"), [("true", "wheel_true"), ("estimate", "wheel_filtered")])
def test_truth_moves_by_its_wheels_and_its_noise(drive: str, speeds: str) -> None:
    case = setting(drive=drive, pose_q=(8e-7, 3e-6), duration_s=120.0)
    samples = Study(case).samples(3)
    noise = np.diff(samples["truth"], axis=0) - moves(case, samples, speeds)
    assert_variance(noise[:, :2], case.pose_q[0])
    assert_variance(noise[:, 2], case.pose_q[1])


def test_wheel_speeds_and_fixes_are_measured_with_their_noise() -> None:
    case = setting(duration_s=120.0, fix_r=(2.5e-3, 1e-3))
    samples = Study(case).samples(3)
    assert_variance(samples["wheel_measured"] - samples["wheel_true"], case.motor_r)
    off = samples["fix"] - samples["truth"]
    assert_variance(off[:, :2], case.fix_r[0])
    assert_variance(off[:, 2], case.fix_r[1])
    assert np.array_equal(samples["wheel_raw"], samples["wheel_measured"])


@pytest.mark.parametrize("fix", ["stale", "late"])
def test_an_old_fix_is_of_the_step_before(fix: str) -> None:
    case = setting(fix=fix, duration_s=60.0, fix_r=(1e-8, 1e-8))
    samples = Study(case).samples(3)
    assert np.abs(samples["fix"][1:] - samples["truth"][:-1]).max() < 6e-4
    assert np.abs(samples["fix"][1:] - samples["truth"][1:]).max() > 1e-2


def test_the_open_loop_model_knows_the_voltage_only() -> None:
    case = setting("published")
    samples = Study(case).samples(3)
    a, b = motor_model(case)
    x = np.zeros((2, WHEELS))
    for row in samples:
        x = a @ x + np.outer(b, row["voltage_V"])
        np.testing.assert_allclose(row["wheel_raw"], x[0], rtol=1e-9, atol=1e-9)


def joint_filter(case: Setting) -> Any:
    """Return the report's joint filter of all motors (eq. 45 to 51, corrected) as FilterPy's, at rest."""
    a, b = motor_model(case)
    every = np.eye(WHEELS)
    kf = KalmanFilter(dim_x=2 * WHEELS, dim_z=WHEELS, dim_u=WHEELS)
    kf.x = np.zeros((2 * WHEELS, 1))
    kf.P = np.eye(2 * WHEELS)
    kf.F = np.kron(every, a)
    kf.B = np.kron(every, b[:, None])
    kf.H = np.kron(every, [[1.0, 0.0]])
    kf.Q = np.diag(np.tile(case.kf_step_q, WHEELS))
    kf.R = case.motor_r * every
    return kf


@pytest.mark.parametrize("name", ["published", "honest_a", "honest_b"])
def test_four_motor_filters_are_the_joint_filter(name: str) -> None:
    case = setting(name)
    samples = Study(case).samples(5)
    kf = joint_filter(case)
    expected = []
    for row in samples:
        kf.predict(u=row["voltage_V"][:, None])
        kf.update(row["wheel_measured"][:, None])
        expected.append(kf.x[::2, 0])
    scale = np.abs(expected).max()
    assert np.abs(samples["wheel_filtered"] - expected).max() < 2e-5 * scale


@pytest.mark.parametrize("fix", ["fresh", "stale"])
@pytest.mark.parametrize(("name", "number", "speeds"), [("ekf", 0, "wheel_raw"), ("kf_ekf", 1, "wheel_filtered")])
def test_pose_filter_agrees_with_filterpy(fix: str, name: str, number: int, speeds: str) -> None:
    case = setting(fix=fix)
    study = Study(case)
    samples = study.samples(7)
    ekf = ExtendedKalmanFilter(dim_x=3, dim_z=3)
    ekf.x = study.poses[0].copy()
    ekf.P = np.zeros((3, 3))
    ekf.Q = np.diag(per_axis(believed_pose_noise(case)[number]))
    ekf.R = np.diag(per_axis(case.fix_r))
    expected = []
    for row in samples:
        vx, vy, turned = to_body(case) @ row[speeds] * case.step_s
        heading = ekf.x[2] + 0.5 * turned
        dx, dy = np.cos(heading) * vx - np.sin(heading) * vy, np.sin(heading) * vx + np.cos(heading) * vy
        ekf.F = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
        ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
        ekf.x = ekf.x + np.array([dx, dy, turned])
        ekf.update(row["fix"], HJacobian=lambda _: np.eye(3), Hx=lambda x: x)
        expected.append(ekf.x.copy())
    estimate = samples["estimate"][:, filters.FILTERS.index(name)]
    assert np.abs(estimate - expected).max() < 5e-6
    result = study.results([7])
    np.testing.assert_allclose(result["final_p"][0, number], ekf.P, rtol=2e-4, atol=1e-9)


def test_result_sums_up_the_samples() -> None:
    study = Study(setting())
    samples, result = study.samples(2), study.results([2])[0]
    error = samples["estimate"] - samples["truth"][:, None]
    error[..., 2] = np.angle(np.exp(1j * error[..., 2]))
    np.testing.assert_allclose(result["rmse"], np.sqrt((error**2).mean(axis=0)), rtol=1e-9)
    np.testing.assert_allclose(result["final_error"], error[-1], rtol=1e-9, atol=1e-12)
    distance = np.hypot(samples["estimate"][..., 0], samples["estimate"][..., 1])
    truth = np.hypot(samples["truth"][:, 0], samples["truth"][:, 1])
    np.testing.assert_allclose(result["closer"], (distance < truth[:, None]).mean(axis=0))
    off = samples["truth"] - study.poses[1:]
    np.testing.assert_allclose(result["tracking"], np.sqrt((off**2).mean(axis=0)), rtol=1e-9)


def usable_paths() -> list[str]:
    study = Study(setting(duration_s=0.1))
    usable = []
    for path in filters.PATHS:
        try:
            study.results([1], path)
        except filters.SettingError:
            continue
        usable.append(path)
    return usable


@pytest.mark.parametrize("name", ["published", "honest_a", "honest_b", "own"])
def test_results_are_the_same_bits_whatever_computes_them(name: str) -> None:
    study = Study(setting(name))
    seeds = range(11, 32)
    alone = study.results(seeds, "single")
    paths = usable_paths()
    assert {"best", "single", "baseline"} <= set(paths)
    for path in paths:
        assert study.results(seeds, path).tobytes() == alone.tobytes()
    assert not np.array_equal(alone[0]["rmse"], alone[1]["rmse"])


@pytest.mark.parametrize("fix", ["fresh", "stale", "late", "own"])
@pytest.mark.parametrize("wheels", [3, 4])
@pytest.mark.parametrize("controlled", ["none", "ekf"])
def test_every_kind_of_setting_goes_in_lanes_too(fix: str, wheels: int, controlled: str) -> None:
    study = Study(setting(fix=fix, wheels=wheels, controlled=controlled, duration_s=4.0))
    seeds = [2**63 + 5, 3, 2**32, 7, 8, 9, 1, 0]
    assert study.results(seeds).tobytes() == study.results(seeds, "single").tobytes()


def test_results_do_not_depend_on_threads_or_company() -> None:
    case = setting("published")
    seeds = list(range(11, 38))
    alone = run_seeds(case, seeds, 1)
    together = run_seeds(case, seeds[::-1], 4)
    assert alone.tobytes() == together[::-1].tobytes()
    assert run_seeds(case, [13], 1).tobytes() == alone[2:3].tobytes()
    assert len(Study(case).results([])) == 0


def test_lanes_that_part_are_run_one_by_one() -> None:
    # so much noise that some runs leave the range of the core's sine, each at another step
    study = Study(setting(motor_q=(1e17, 16.0), duration_s=4.0))
    alone = study.results(range(8), "single")
    assert study.results(range(8)).tobytes() == alone.tobytes()


def test_the_robot_follows_its_path_with_three_wheels_too() -> None:
    case = setting(wheels=3, duration_s=60.0)
    result = Study(case).results([1])[0]
    assert np.all(result["tracking"] < 0.35)
    assert np.all(result["rmse"][3] < 0.01)


def test_a_fix_made_of_the_estimate_doubles_the_walk() -> None:
    case = setting(fix="own", duration_s=120.0)
    square = (run_seeds(case, range(60), 2, lambda _: None)["rmse"] ** 2).mean(axis=0)
    # the steady gain K adds K^2 R = Q per step (P = P - K S K + Q with S close to R)
    assert np.all((square[3] > 1.4 * square[1]) & (square[3] < 2.9 * square[1]))


@pytest.mark.parametrize(
    ("field", "value"), [("steps", 0), ("step_s", 0.0), ("step_s", 1.5), ("wheels", 5), ("controlled", 4), ("fix", 9)]
)
def test_refuses_what_it_cannot_run(field: str, value: float) -> None:
    case = setting(duration_s=1.0)
    config = filters.c_config(case)
    setattr(config, field, value)
    poses = ffi.new("double[]", 3 * (case.steps + 1))
    result = ffi.new("hil_filter_result_t *")
    assert lib.hil_filter_study(config, poses, poses, 1, result, ffi.NULL) == -1
    assert lib.hil_filter_study_many(config, poses, poses, [1, 2], 2, lib.HIL_FILTER_PATH_BEST, result) == -1


def test_refuses_wheels_without_size() -> None:
    for seeds in ([1], [1, 2]):
        with pytest.raises(filters.SettingError, match="outside the ranges"):
            Study(setting(radius_m=0.0)).results(seeds)


def test_refuses_a_path_that_the_processor_cannot_go() -> None:
    config = filters.c_config(setting(duration_s=0.1))
    study = Study(setting(duration_s=0.1))
    poses = ffi.cast("double *", ffi.from_buffer(study.poses))
    assert lib.hil_filter_study_many(config, poses, poses, [1], 1, 9, ffi.new("hil_filter_result_t *")) == -2


def test_layouts_are_those_of_the_c_structs() -> None:
    assert ffi.sizeof("hil_filter_result_t") == RESULT.itemsize
    assert ffi.sizeof("hil_filter_sample_t") == SAMPLE.itemsize
