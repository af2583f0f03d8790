# SPDX-License-Identifier: MIT
"""The matrix against the core's kinematics, the slopes against differences, and which poses and counts are used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from omniwheel.errors import LogError
from omniwheel.identification.odometry_calibration import body_from_wheels
from omniwheel.identification.pose_fit.scores import score
from omniwheel.identification.pose_fit.wheel_model import WheelModel, wheel_model
from omniwheel.identification.pose_fit.windows import cut, integrate, linearised, run_of
from omniwheel.logs.log import Truth
from omniwheel.robots import read_robot
from tests.host.pose_fit.robots import FOUR, THREE, Motion, drive, true_values


@pytest.mark.parametrize("name", ["three_wheel", "four_wheel"])
def test_the_nominal_matrix_is_the_cores(name: str) -> None:
    robot = read_robot(name)
    layout = wheel_model(robot)
    core = body_from_wheels(robot) * layout.radius_m
    core[2] /= layout.distance_m
    np.testing.assert_allclose(layout.matrix(layout.nominal), np.hstack((core, core, 0.0 * core)), atol=1e-7)


def test_the_tracked_point_moves_on_a_circle_when_the_robot_turns_on_the_spot() -> None:
    values = THREE.nominal
    values[4:6] = 0.1, 0.0
    turns = np.full((1000, 3), 2.0 * np.pi * THREE.distance_m / THREE.radius_m / 1000)
    increments = np.hstack((turns, np.zeros_like(turns), np.zeros_like(turns)))
    path, _, _ = integrate(increments, THREE.matrix(values), np.zeros(3))
    np.testing.assert_allclose(path[-1], [0.0, 0.0, 2.0 * np.pi], atol=1e-9)
    np.testing.assert_allclose(path[499, :2], [-0.2, 0.0], atol=1e-9)


@pytest.mark.parametrize("layout", [THREE, FOUR])
def test_slopes_are_those_of_finite_differences(layout: object) -> None:
    assert layout in (THREE, FOUR)
    model = THREE if layout is THREE else FOUR
    values = true_values(model, 1, 0.01, -0.02)
    run = run_of(drive(model, values, 1, duration_s=15.0), "", model)
    window = cut(run, 0, run.truth_s)[0]
    matrix = model.matrix(values)
    residual, slope, start = linearised(window, matrix)
    for index in range(matrix.size):
        moved = matrix.copy().ravel()
        moved[index] += 1e-6
        difference = (residual - linearised(window, moved.reshape(matrix.shape))[0]) / 1e-6
        np.testing.assert_allclose(slope[:, :, index], difference, atol=2e-3 * (1.0 + np.abs(difference).max()))
    for index in range(3):
        other = replace(window, start=window.start + 1e-6 * np.eye(3)[index])
        difference = (residual - linearised(other, matrix)[0]) / 1e-6
        np.testing.assert_allclose(start[:, :, index], difference, atol=1e-4)


def test_the_share_of_translation_is_none_on_the_spot_and_all_of_a_straight_path() -> None:
    time = np.linspace(0.0, 2.0, 201)
    for twist, share in (((0.0, 0.0, 0.5), 0.0), ((0.2, -0.1, 0.0), 1.0), ((0.1, 0.0, 0.1 / THREE.distance_m), 0.5)):
        rate = np.linalg.pinv(THREE.matrix(THREE.nominal)[:, :3]) @ np.array(twist)
        np.testing.assert_allclose(THREE.translating(time, time[:, None] * rate), share, atol=1e-9)


def test_a_count_marked_as_a_spike_still_adds_up() -> None:
    values = true_values(THREE, 2)
    log = drive(THREE, values, 2)
    marked = replace(log, good=np.zeros_like(log.good))
    matrix = THREE.matrix(values)
    assert score(run_of(marked, "", THREE), matrix) == score(run_of(log, "", THREE), matrix)
    assert score(run_of(log, "", THREE), matrix).largest_m < 0.02


def test_logs_that_cannot_be_used_are_refused_with_the_reason() -> None:
    log = drive(THREE, true_values(THREE, 3), 3)
    truth = log.require_truth()
    with pytest.raises(LogError, match="add up"):
        run_of(replace(log, sample_s=0.001), "", THREE)
    with pytest.raises(LogError, match="complete"):
        run_of(replace(log, truth=replace(truth, xy=np.full((len(truth.time_s), 2), np.nan))), "", THREE)
    with pytest.raises(LogError, match="truth"):
        run_of(replace(log, truth=None), "", THREE)


@pytest.mark.parametrize("layout", [THREE, FOUR])
def test_two_poses_with_several_turns_between_them_have_the_turns_of_the_wheels(layout: WheelModel) -> None:
    values = true_values(layout, 1)
    log = drive(layout, values, 1, Motion((0.0, 0.0), 2.0, one_way=True), duration_s=20.0)
    truth = log.require_truth()
    ends = [0, -1]
    wrapped = np.angle(np.exp(1j * truth.theta[ends]))
    sparse = replace(log, truth=Truth(truth.time_s[ends], truth.xy[ends], wrapped, same_clock=True))
    turned = truth.theta[-1] - truth.theta[0]
    assert turned > 6.0 * np.pi
    assert np.diff(run_of(sparse, "", layout).pose[:, 2])[0] == pytest.approx(turned, abs=1e-6)


def test_the_documented_radii_are_those_of_an_earlier_calibration() -> None:
    robot = read_robot("three_wheel")
    scale = [1.01, 1.0, 0.97]
    scales = {f"W{wheel + 1}_RSCALE": value for wheel, value in enumerate(scale)}
    layout = wheel_model(replace(robot, overrides={**robot.overrides, **scales}))
    assert layout.nominal[:3] == pytest.approx(layout.radius_m * np.array(scale))
