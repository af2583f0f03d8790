# SPDX-License-Identifier: MIT
"""The loops of Tables 1 to 3: references, limits of what a sampled law can do, and that settings are checked."""

import copy
from typing import Any

import numpy as np
import pytest

from omni_reproduce import loops, table2
from omni_reproduce.experiment import read_spec

SPEC = read_spec("table2")


def spec_with(**head: float) -> dict[str, Any]:
    spec = copy.deepcopy(SPEC)
    spec["experiment"].update(head)
    return spec


def path() -> loops.Path:
    return loops.Path(SPEC["path"], loops.make_kinematics(table2.world_of(SPEC, 1, np.zeros(3))))


def rose(time_s: np.ndarray) -> np.ndarray:
    angle = 2.0 * np.pi * time_s / 30.0
    radius = 0.5 * np.cos(4.0 * angle)
    turned = 0.5 * np.sin(2.0 * np.pi * time_s)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), turned], axis=1)


def test_the_path_is_the_reports_rose() -> None:
    times = 0.02 * np.arange(1500)
    poses, _ = path().sampled(0.02, "none")
    np.testing.assert_allclose(poses, rose(times), atol=1e-5)  # path time is a float: 2 us at 30 s


@pytest.mark.parametrize(("feed_forward", "at"), [("backward", 0.0), ("now", 0.0), ("middle", 0.5)])
def test_feed_forward_is_the_derivative_it_says(feed_forward: str, at: float) -> None:
    step_s = 0.02
    _, rates = path().sampled(step_s, feed_forward)
    times = step_s * (np.arange(1, len(rates)) + at)
    if feed_forward == "backward":
        expected = (rose(times) - rose(times - step_s)) / step_s
    else:
        expected = (rose(times + 1e-5) - rose(times - 1e-5)) / 2e-5
    np.testing.assert_allclose(rates[1:], expected, atol=1e-3)


def test_a_path_slowed_to_a_limit_starts_and_ends_at_rest_and_keeps_to_it() -> None:
    kinematics = loops.make_kinematics(table2.world_of(SPEC, 1, np.zeros(3)))
    spec = {**SPEC["path"], "ramp_s": 2.0}
    slowed = loops.Path(spec, kinematics, wheel_limit_rad_s=10.0, margin=0.8)
    assert slowed.scale == pytest.approx(slowed.peak_wheel_rad_s / 8.0, rel=0.02)
    poses, rates = slowed.sampled(0.02, "now")
    np.testing.assert_allclose(poses[0], [0.5, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(poses[-1], [0.5, 0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(rates[[0, -1]], 0.0, atol=1e-3)
    rows = np.array([list(row) for row in kinematics.b])
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    body = np.stack([cos * rates[:, 0] + sin * rates[:, 1], cos * rates[:, 1] - sin * rates[:, 0], rates[:, 2]], axis=1)
    assert np.abs(body @ rows.T / 0.03275).max() == pytest.approx(8.0, rel=0.02)


def test_without_slip_only_the_step_is_left_and_it_vanishes_with_the_cube_of_its_length() -> None:
    errors = []
    for step_s in (0.08, 0.04, 0.02):
        spec = spec_with(slip_m_s=1e-9, step_s=step_s, wheel_limit_rad_s=100.0)
        spec["setting"]["corrected"]["lambda_"] = [1.0 / step_s] * 3
        errors.append(table2.drive(table2.Case(spec, "corrected", 1)).rmse)
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(errors[-1] < [1.5e-5, 1.5e-5, 5e-5])
    assert np.all(ratios > 6.0)


def test_the_limit_is_the_deviation_of_one_step_of_unknown_slip() -> None:
    world = table2.world_of(SPEC, 3, np.zeros(3))
    rng = np.random.default_rng(5)
    slip = rng.uniform(-0.1, 0.1, (20000, 4)) * rng.uniform(-0.1, 0.1, (20000, 4))
    bearing = np.radians([45.0, 135.0, 225.0, 315.0])
    rows = np.stack([-np.sin(bearing), np.cos(bearing), np.full(4, 0.195)], axis=1)
    expected = 0.02 * (slip @ np.linalg.pinv(rows).T).std(axis=0)
    np.testing.assert_allclose(loops.one_step_limit(world, 0.02, 0.1, 0.1), expected, rtol=0.03)


def test_k_of_eq_42_as_printed_is_r_times_ours() -> None:
    law = loops.law_of({"title": "", "lambda_": [1.0] * 3, "k_without_r": [1.0, 2.0, 3.0]}, {"wheel_radius_m": 0.1})
    assert law.k == pytest.approx([0.1, 0.2, 0.3])


def test_a_setting_that_does_not_exist_says_what_does() -> None:
    with pytest.raises(loops.SettingError, match="sideways") as caught:
        path().sampled(0.02, "sideways")
    assert "backward" in caught.value.hint
    with pytest.raises(loops.SettingError, match="cannot be planned"):
        loops.Path({**SPEC["path"], "petals": 0}, loops.make_kinematics(table2.world_of(SPEC, 1, np.zeros(3))))


def test_a_share_of_a_single_seed_has_no_deviation() -> None:
    assert loops.share_row("e", "s", "q", [0.5]).sd is None
    assert loops.share_row("e", "s", "q", [0.5, 0.7]).ours == pytest.approx(60.0)
