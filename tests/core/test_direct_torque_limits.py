# SPDX-License-Identifier: MIT
"""What direct torque says about its limits, and that a refused input leaves no torque behind."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_direct_torque import Robot


def step(robot: Robot, pose: Any = (0, 0, 0), acceleration: Any = (0, 0, 0)) -> tuple[float, list[float]]:
    """Return the controller's factor and torques; the caller's array holds old torques before."""
    torque = ffi.new("omni_real_t[4]", [9.0] * 4)
    start, rate = ffi.new("omni_pose_t *", tuple(pose)), ffi.new("omni_twist_t *", (0, 0, 0))
    reference = robot.reference((0, 0, 0), (0, 0, 0), acceleration)
    factor = lib.omni_direct_torque_step(robot.config, robot.k, start, rate, reference, torque, robot.terms)
    assert all(torque[i] == 9.0 for i in range(robot.wheels, 4))  # what is no wheel is not written
    return float(factor), [torque[i] for i in range(robot.wheels)]


def protect(robot: Robot, wheel_rad_s: Any, torque_N_m: Any, floor: Any = (0, 0, 0)) -> tuple[float, list[float]]:
    torque = ffi.new("omni_real_t[4]", [*torque_N_m, *[0.0] * (4 - robot.wheels)])
    body = ffi.new("omni_twist_t *", tuple(floor))
    speeds = [*wheel_rad_s, *[0.0] * (4 - robot.wheels)]
    share = lib.omni_direct_torque_protect(robot.config, robot.k, body, speeds, torque)
    return float(share), [torque[i] for i in range(robot.wheels)]


@pytest.mark.parametrize("wheels", [3, 4])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_pose_that_is_no_number_gives_no_torque_on_any_wheel(wheels: int, bad: float) -> None:
    factor, torque = step(Robot(wheels), pose=(0.0, bad, 0.0))
    assert factor == 0.0
    assert torque == [0.0] * wheels


@pytest.mark.parametrize("wheels", [3, 4])
@pytest.mark.parametrize("limits", [{"grip": 0.1}, {"torque_limit_N_m": 0.05}, {"grip": 0.1, "torque_limit_N_m": 0.02}])
def test_the_factor_is_the_share_of_the_torque_that_was_asked_for(wheels: int, limits: dict[str, float]) -> None:
    # Wheels without inertia: all of the torque accelerates the body and is cut alike.
    free, held = Robot(wheels, wheel_inertia_kg_m2=0.0), Robot(wheels, wheel_inertia_kg_m2=0.0, **limits)
    wanted = (3.0, -2.0, 5.0)
    whole, asked = step(free, acceleration=wanted)
    factor, left = step(held, acceleration=wanted)
    assert whole == 1.0
    assert 0.0 < factor < 0.9
    np.testing.assert_allclose(left, factor * np.array(asked), rtol=1e-5, atol=1e-7)


def test_a_wheel_that_asks_for_nothing_loses_nothing() -> None:
    """Half into the band where torque fades, only what pushes further out is cut."""
    robot = Robot(4, wheel_limit_rad_s=20.0)
    for sign in (-1.0, 1.0):
        fast = [sign * 19.9] * 4
        assert protect(robot, fast, [0.0] * 4) == (1.0, [0.0] * 4)
        assert protect(robot, fast, [-0.1 * sign] * 4)[0] == 1.0
        share, torque = protect(robot, fast, [0.1 * sign] * 4)
        assert 0.0 < share < 1.0
        np.testing.assert_allclose(torque, [0.1 * sign * share] * 4, rtol=1e-5)


def test_the_smallest_share_of_all_wheels_is_told() -> None:
    robot = Robot(4, wheel_limit_rad_s=20.0)
    each = [protect(robot, [speed, 0, 0, 0], [0.1, 0, 0, 0])[0] for speed in (19.9, 19.5, 19.2)]
    assert each == sorted(each)
    assert protect(robot, [19.2, 19.9, 19.5, 0.0], [0.1, 0.1, 0.1, 0.1])[0] == pytest.approx(each[0])
