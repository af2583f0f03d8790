# SPDX-License-Identifier: MIT
"""Tables 5 and 7: settings, limits against SciPy and brute force, and the figures that the study must reach."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy import linalg, stats

from omni_reproduce import consistency, filters, table7
from omni_reproduce.experiment import Context, read_spec
from omni_reproduce.filter_limits import Limits, nees, per_axis, to_body
from omni_reproduce.filters import FILTERS, Setting, SettingError, read_setting, run_seeds, shortened
from omni_reproduce.riccati import (
    chi_square_band,
    dead_reckoning_covariance,
    joint_variances,
    long_run_wheel_variance,
    mean_rms,
    pose_variances,
    steady_motor_filter,
)

Array = npt.NDArray[np.float64]
SPEC = read_spec("table7")
RNG_SEED = 20


def setting(name: str, **changes: Any) -> Setting:
    return replace(read_setting(SPEC, name), **changes)


def run(case: Setting, seeds: int) -> npt.NDArray[np.void]:
    return run_seeds(case, range(1, seeds + 1), 2, lambda _: None)


# Settings


def test_every_setting_of_the_file_can_be_read() -> None:
    for name in SPEC["setting"]:
        case = read_setting(SPEC, name)
        assert case.steps == 30000
        assert filters.c_config(case).steps == 30000


def test_unknown_names_in_a_setting_are_refused() -> None:
    spec = {**SPEC, "setting": {"odd": {**SPEC["setting"]["honest_b"], "wheel": 4}}}
    with pytest.raises(SettingError, match="odd"):
        read_setting(spec, "odd")
    with pytest.raises(SettingError, match="spiral"):
        filters.reference(setting("honest_b", path="spiral"))
    with pytest.raises(SettingError, match="tustin"):
        filters.motor_model(setting("honest_b", discretisation="tustin"))


def test_motor_is_discretised_as_the_setting_says() -> None:
    case = setting("honest_b")
    m = case.motor
    speed, current = [-m["b"] / m["J"], m["K"] / m["J"], 0.0], [-m["K"] / m["L"], -m["R"] / m["L"], 1.0 / m["L"]]
    continuous = np.array([speed, current, [0.0, 0.0, 0.0]])
    exact = linalg.expm(continuous * case.step_s)[:2]
    a, b = filters.motor_model(case)
    np.testing.assert_allclose(np.column_stack([a, b]), exact, rtol=1e-6, atol=1e-9)
    a, b = filters.motor_model(replace(case, discretisation="euler"))
    np.testing.assert_allclose(np.column_stack([a, b]), np.eye(2, 3) + continuous[:2] * case.step_s, rtol=1e-12)


def test_reference_rate_is_the_backward_difference() -> None:
    case = shortened(setting("honest_b"), 30.0)
    poses, rates = filters.reference(case)
    assert poses.shape == (case.steps + 1, 3)
    assert rates.shape == (case.steps, 3)
    np.testing.assert_allclose(rates[1:], np.diff(poses, axis=0)[:-1] / case.step_s)
    np.testing.assert_allclose(poses[0], [0.5, 0.5, 0.5])
    np.testing.assert_allclose(np.gradient(poses, case.step_s, axis=0)[1:-1], rates[1:], atol=0.05)


# Limits


def test_motor_filter_settles_where_scipy_says() -> None:
    case = setting("honest_b")
    a, _ = filters.motor_model(case)
    _, predicted = steady_motor_filter(a, case.kf_step_q, case.motor_r)
    c = np.array([[1.0], [0.0]])
    expected = linalg.solve_discrete_are(a.T, c, np.diag(case.kf_step_q), np.array([[case.motor_r]]))
    np.testing.assert_allclose(predicted, expected, rtol=1e-8)


@pytest.mark.parametrize("name", ["published", "honest_a", "honest_b"])
def test_long_run_variance_is_the_sum_of_the_covariances(name: str) -> None:
    case = setting(name)
    a, _ = filters.motor_model(case)
    gain, _ = steady_motor_filter(a, case.kf_step_q, case.motor_r)
    keep = np.eye(2) - np.outer(gain, [1.0, 0.0])
    noise = keep @ np.diag(case.motor_step_q) @ keep.T + np.outer(gain, gain) * case.motor_r
    covariance = linalg.solve_discrete_lyapunov(keep @ a, noise)
    lagged, total = covariance, covariance[0, 0]
    for _ in range(3000):
        lagged = keep @ a @ lagged
        total += 2.0 * lagged[0, 0]
    got = long_run_wheel_variance(a, case.motor_step_q, case.kf_step_q, case.motor_r)
    assert got == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize("late", [False, True])
def test_pose_bound_of_a_robot_at_rest_settles_where_scipy_says(late: bool) -> None:
    q, r = np.array([8e-7, 8e-7, 2e-6]), np.array([2.5e-3, 2.5e-3, 1e-3])
    got = pose_variances(np.zeros((3000, 3)), q, r, late)[-1]
    predicted = np.diag(linalg.solve_discrete_are(np.eye(3), np.eye(3), np.diag(q), np.diag(r)))
    np.testing.assert_allclose(got, predicted if late else predicted * r / (predicted + r), rtol=1e-6)


def driven(steps: int) -> tuple[Setting, Array, Array]:
    """Return a setting, and poses and moves along its path."""
    case = shortened(setting("honest_b"), steps * 0.02)
    poses, _ = filters.reference(case)
    return case, poses, np.diff(poses, axis=0)


@pytest.mark.parametrize("late", [False, True])
def test_joint_bound_without_motor_noise_is_that_of_the_pose(late: bool) -> None:
    case, poses, moves = driven(400)
    q, r = per_axis(case.pose_q), per_axis(case.fix_r)
    headings = poses[:-1, 2] + 0.5 * moves[:, 2]
    motor = (filters.motor_model(case)[0], np.zeros(2), case.motor_r)
    got = joint_variances(moves, headings, to_body(case), motor, (q, r), case.step_s, late)
    np.testing.assert_allclose(got, pose_variances(moves, q, r, late), rtol=1e-9)


def test_joint_bound_with_white_wheel_errors_is_that_of_the_pose_with_their_noise() -> None:
    case, poses, moves = driven(400)
    q, r = per_axis(case.pose_q), per_axis(case.fix_r)
    variance = 0.3
    headings = poses[:-1, 2] + 0.5 * moves[:, 2]
    # motors that forget everything, with a measurement that says next to nothing
    motor = (np.zeros((2, 2)), np.array([variance, 0.0]), 1e9)
    got = joint_variances(moves, headings, to_body(case), motor, (q, r), case.step_s, False)
    expected = pose_variances(moves, q + per_axis(filters.pose_noise(case, variance)), r, False)
    np.testing.assert_allclose(got, expected, rtol=2e-3)


def test_dead_reckoning_covariance_by_brute_force() -> None:
    _, poses, moves = driven(60)
    q = np.array([8e-7, 8e-7, 2e-6])
    steps = len(moves)
    effect = np.zeros((steps, 3, steps, 3))  # error after step k from the noise of step j
    for j in range(steps):
        now = np.eye(3)
        for k in range(j, steps):
            if k > j:
                dx, dy, _ = moves[k]
                now = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]]) @ now
            effect[k, :, j] = now
    expected = np.einsum("kajb,b,lajb->akl", effect, q, effect)
    got = dead_reckoning_covariance(poses[1:], q, steps)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-16)


def test_mean_rms_of_known_distributions() -> None:
    assert mean_rms(np.array([[4.0]])) == pytest.approx(2.0 * np.sqrt(2.0 / np.pi), rel=1e-6)
    assert mean_rms(np.eye(9)) == pytest.approx(stats.chi(9).mean() / 3.0, rel=1e-6)
    walk = np.random.default_rng(RNG_SEED).standard_normal((20000, 64)).cumsum(axis=1)
    brute = np.sqrt((walk**2).mean(axis=1))
    count = np.arange(1, 65)
    got = mean_rms(np.minimum.outer(count, count).astype(float))
    assert got == pytest.approx(brute.mean(), abs=4.0 * brute.std() / np.sqrt(len(brute)))


@pytest.mark.parametrize("degrees", [30, 3000, 90000])
def test_chi_square_band_is_scipys(degrees: int) -> None:
    assert chi_square_band(degrees) == pytest.approx(stats.chi2(degrees).interval(0.95), rel=1e-3)


# Figures


def test_nees_of_known_errors() -> None:
    results = np.zeros(1, dtype=filters.RESULT)
    results["final_p"] = np.diag([4.0, 1.0, 0.25])
    results["final_error"][0, 2] = [2.0, 1.0, 0.5]
    results["final_error"][0, 3] = [4.0, 0.0, 0.0]
    np.testing.assert_allclose(nees(results), [[3.0, 4.0]])


@pytest.mark.parametrize("name", ["ekf", "kf_ekf"])
def test_as_the_code_had_it_comes_close_to_the_published_filters(name: str) -> None:
    ours = run(setting("published"), 12)["rmse"][:, FILTERS.index(name)].mean(axis=0)
    np.testing.assert_allclose(ours, SPEC["published"][name], rtol=0.04)


@pytest.mark.full
def test_honest_b_reaches_its_limits() -> None:
    case = setting("honest_b")
    results = run(case, 12)
    limits = Limits(case, 1, 60.0)
    for name in ("ekf", "kf_ekf"):
        ours = results["rmse"][:, FILTERS.index(name)].mean(axis=0)
        np.testing.assert_allclose(ours, np.asarray(limits.of(name)), rtol=0.05)
    for name in ("none", "kf"):
        values = results["rmse"][:, FILTERS.index(name)]
        error = values.std(axis=0, ddof=1) / np.sqrt(len(values))
        assert np.all(np.abs(values.mean(axis=0) - np.asarray(limits.of(name))) < 3.5 * error)


def test_the_published_headings_do_not_fit_honest_b() -> None:
    """100 published runs and as many of ours as needed: 20 to 40 standard errors, however near they are."""
    case = setting("honest_b")
    scores = table7._scores(SPEC, table7.Outcome("honest_b", case, run(case, 24), {}))
    assert np.all(scores[[FILTERS.index(name) for name in ("ekf", "kf_ekf")], 2] > 10.0)
    assert np.all(np.abs(scores[FILTERS.index("kf")]) < 3.0), "dead reckoning differs as much from run to run"
    assert "fit" not in SPEC["explanation"]["honest_b"]["walk"]


def test_honest_b_is_consistent() -> None:
    case = setting("honest_b")
    results = run(case, 12)
    assert np.all(consistency.inside(results["nis"].mean(axis=0) / 3, 3 * len(results) * case.steps, 0.999))
    low, high = (edge / 12 for edge in chi_square_band(36, 0.999))
    assert np.all((nees(results).mean(axis=0) > low) & (nees(results).mean(axis=0) < high))


def test_telling_the_age_of_a_fix_takes_its_bias_away() -> None:
    stale = run(setting("published"), 2)["rmse"][:, 3].mean(axis=0)
    stamped = run(setting("published", fix="late"), 2)["rmse"][:, 3].mean(axis=0)
    assert np.all(stamped < 0.8 * stale)


def test_literal_noise_gives_what_it_must() -> None:
    results = run(setting("literal"), 4)["rmse"].mean(axis=0)
    assert np.all((results[2:] > 0.035) & (results[2:] < 0.041))
    assert np.all(results[:2] > 0.3)


@pytest.mark.full
def test_table7_quickly(tmp_path: Path) -> None:
    shares: list[float] = []
    result = table7.run(Context(tmp_path, quick=True, seeds=2, workers=2, progress=shares.append))
    names = {path.name for path in result.pictures}
    assert names == {"fig13.png", "fig14.png", "fig15.png", "fig16.png", "table7.png"}
    assert all(path.stat().st_size > 10_000 for path in result.pictures)
    titles = {SPEC["setting"][name]["title"] for name in ("published", "honest_a", "honest_b", "literal", "own")}
    assert titles <= {row.setting for row in result.rows}
    assert all(row.ours is not None and np.isfinite(row.ours) and row.explanation for row in result.rows)
    assert not any("{" in row.explanation for row in result.rows)
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


@pytest.mark.full
def test_consistency_quickly(tmp_path: Path) -> None:
    result = consistency.run(Context(tmp_path, quick=True, seeds=2, workers=2))
    errors = [row for row in result.rows if "RMSE" in row.quantity]
    assert errors
    for row in errors:
        assert row.ours == pytest.approx(row.limit, rel=0.1)
