# SPDX-License-Identifier: MIT
"""Radii and distance: against the core's kinematics, against known truth, and what cannot be told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.known_robot import SimulatedRobot
from omniwheel._core import ffi, lib
from omniwheel.errors import IdentificationError
from omniwheel.identification.dataset import Dataset
from omniwheel.identification.geometry import body_per_wheel, calibrate, odometry
from omniwheel.identification.model import Layout


def test_odometry_moves_as_the_cores_kinematics_say(layout: Layout) -> None:
    config = ffi.new("omni_kinematics_config_t *")
    config.wheels = 3
    radius_m = layout.radius_m * np.array([1.01, 0.98, 1.0])
    for wheel in range(3):
        config.radius_m[wheel], config.distance_m[wheel] = radius_m[wheel], layout.distance_m
        config.angle_rad[wheel] = layout.angle_rad[wheel]
    kinematics = ffi.new("omni_kinematics_t *")
    assert lib.omni_kinematics_init(kinematics, config) == lib.OMNI_OK
    speed = np.array([0.3, -0.2, 0.5])
    twist = ffi.new("omni_twist_t *")
    lib.omni_kinematics_forward(kinematics, ffi.new("omni_real_t[4]", [*speed, 0.0]), ffi.NULL, twist)
    values = np.array([*radius_m, layout.distance_m])
    ours = speed @ body_per_wheel(values, layout.angle_rad)
    np.testing.assert_allclose(ours, [twist.vx, twist.vy, twist.wz], rtol=1e-5)


def test_a_turn_in_place_comes_back(layout: Layout) -> None:
    to_body = body_per_wheel(np.array([layout.radius_m] * 3 + [layout.distance_m]), layout.angle_rad)
    steps = np.full((100, 3), 2.0 * np.pi * layout.distance_m / layout.radius_m / 100)
    np.testing.assert_allclose(odometry(steps, to_body)[-1], [0.0, 0.0, 2.0 * np.pi], atol=1e-12)


def test_radii_and_distance_of_a_simulated_robot(
    simulated: SimulatedRobot, runs: list[Dataset], layout: Layout
) -> None:
    found = calibrate(runs, layout)
    truth = simulated.true_values()
    assert sum(found.covers(name, truth[name]) for name in found.names) >= 3
    for name in found.names:
        assert found[name] == pytest.approx(truth[name], rel=2e-3)
        assert found.half_width(name) < 4e-3 * truth[name]


def test_noise_of_the_poses_does_not_shrink_the_answer(runs: list[Dataset], layout: Layout) -> None:
    """Noise as a regressor would bias the radius down by the square of the noise."""
    clean = calibrate(runs, layout)
    draw = np.random.default_rng(1)
    noisy = [replace(run, pose=run.pose + draw.normal(0.0, [0.02, 0.02, 0.02], run.pose.shape)) for run in runs]
    found = calibrate(noisy, layout)
    for name in found.names:
        assert abs(found[name] - clean[name]) < 2.0 * found.half_width(name)
        assert found.half_width(name) > clean.half_width(name)


def test_a_direction_that_was_not_driven_is_named(runs: list[Dataset], layout: Layout) -> None:
    blind = [replace(run, pose=run.pose * [1.0, 1.0, np.nan]) for run in runs[2:]]
    with pytest.raises(IdentificationError, match="cannot be identified from these runs"):
        calibrate([*blind, *blind], layout)
    with pytest.raises(IdentificationError, match="does not move along x and y"):
        calibrate([*runs[2:], *runs[2:]], layout)


def test_without_poses_there_is_nothing_to_compare(runs: list[Dataset], layout: Layout) -> None:
    with pytest.raises(IdentificationError, match="0 windows"):
        calibrate([replace(run, pose_time_s=np.zeros(0), pose=np.zeros((0, 3))) for run in runs], layout)


def test_the_answer_does_not_depend_on_where_it_starts(runs: list[Dataset], layout: Layout) -> None:
    found = calibrate(runs, layout)
    start = replace(layout, radius_m=1.08 * layout.radius_m, distance_m=0.92 * layout.distance_m)
    np.testing.assert_allclose(calibrate(runs, start).values, found.values, rtol=2e-5)
