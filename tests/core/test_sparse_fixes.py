# SPDX-License-Identifier: MIT
"""Few fixes, and wheels that are not as told: every correct fix helps, however rare, and none is refused.

The wheels of the robot are off by some percent, one way more than the other, as real ones are. The filter is the
shipped one.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from omniwheel._core import ffi, lib
from omniwheel.core_config import robot_config
from omniwheel.robots import read_robot

Array = NDArray[np.float64]
TICK_US = 5000
SECONDS = 60
FORWARD = np.array([1.06, 0.95, 1.04])
BACKWARD = np.array([0.96, 1.03, 0.93])
LATE_TICKS = 10


class Drive:
    """A minute of free driving: what each tick turns the wheels by, and where the robot is afterwards."""

    def __init__(self) -> None:
        robot = read_robot("three_wheel")
        self.config = robot_config(robot.parameter_values(), robot.table, 0)
        ekf = self.config.pose_ekf
        ratio = TICK_US * 1e-6 / ekf.step_s
        for name in ("q_xy", "q_theta", "q_slip"):
            setattr(ekf, name, getattr(ekf, name) * ratio)
        ekf.step_s = TICK_US * 1e-6
        k = self.config.kinematics
        ticks = SECONDS * 1_000_000 // TICK_US
        t = np.arange(ticks)[:, None] * TICK_US * 1e-6
        body = np.array([0.6, 0.5, 1.5]) * np.sin(2.0 * np.pi * np.array([0.23, 0.17, 0.13]) * t + [0.0, 1.0, 0.5])
        matrix = np.array([[k.b[i][axis] for axis in range(3)] for i in range(3)])
        inverse = np.array([[k.b_pinv[axis][i] for i in range(3)] for axis in range(3)])
        rolled = body @ matrix.T * TICK_US * 1e-6
        self.turned = rolled / np.array(list(k.radius_m)[:3])
        moved = rolled * np.where(rolled > 0.0, FORWARD, BACKWARD) @ inverse.T
        theta = np.cumsum(moved[:, 2])
        middle = theta - 0.5 * moved[:, 2]
        x = np.cumsum(np.cos(middle) * moved[:, 0] - np.sin(middle) * moved[:, 1])
        y = np.cumsum(np.sin(middle) * moved[:, 0] + np.cos(middle) * moved[:, 1])
        self.pose = np.column_stack((x, y, theta))


@pytest.fixture(scope="module")
def drive() -> Drive:
    return Drive()


def estimated(drive: Drive, fixes: Array, every: int, sd_theta: float = 0.0) -> tuple[Array, list[int]]:
    """Estimate (n, 3) with every ``every``-th row of ``fixes`` as a fix, 50 ms late; the results of the fixes."""
    config, k = ffi.addressof(drive.config, "pose_ekf"), ffi.addressof(drive.config, "kinematics")
    state, fix = ffi.new("omni_pose_ekf_state_t *"), ffi.new("omni_pose_fix_t *")
    lib.omni_pose_ekf_reset(state, config, ffi.new("omni_pose_t *"), 1e-3, 1e-3)
    turned = ffi.new("omni_real_t[]", lib.OMNI_MAX_WHEELS)
    found, results = np.empty_like(drive.pose), []
    for tick, row in enumerate(drive.turned):
        turned[0:3] = list(row)
        lib.omni_pose_ekf_predict(state, config, k, turned, (tick + 1) * TICK_US)
        taken = tick - LATE_TICKS
        if every and taken > 0 and taken % every == 0:
            fix.time_us = (taken + 1) * TICK_US
            fix.pose.x, fix.pose.y = fixes[taken, :2]
            fix.pose.theta = np.arctan2(np.sin(fixes[taken, 2]), np.cos(fixes[taken, 2]))
            fix.sd_theta = sd_theta
            results.append(lib.omni_pose_ekf_correct(state, config, k, fix))
        found[tick] = state.pose.x, state.pose.y, state.pose.theta
    return found, results


def rms_m(drive: Drive, found: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((found - drive.pose)[:, :2] ** 2, axis=1))))


def test_every_correct_fix_helps_however_rare(drive: Drive) -> None:
    noise = np.random.default_rng(5).normal(0.0, 0.003, drive.pose.shape)
    errors = [rms_m(drive, estimated(drive, drive.pose, 0)[0])]
    for every_s in (5.0, 2.0, 1.0, 0.2):
        found, results = estimated(drive, drive.pose + noise, round(every_s * 1e6 / TICK_US))
        assert results.count(lib.OMNI_OK) == len(results)
        errors.append(rms_m(drive, found))
    assert errors == sorted(errors, reverse=True)
    assert errors[1] < 0.5 * errors[0]
    assert errors[3] < 0.03


@pytest.mark.parametrize(
    ("every", "first", "last", "jump_m"), [(4, 4000, 4080, 0.5), (200, 4000, 4001, 0.5), (400, 4000, 4001, 1.0)]
)
def test_fixes_that_jump_are_still_refused(drive: Drive, every: int, first: int, last: int, jump_m: float) -> None:
    """By more than wheels may have slipped since the last used fix."""
    fixes = drive.pose.copy()
    fixes[first:last, 0] += jump_m
    found, results = estimated(drive, fixes, every)
    wrong = [result for index, result in enumerate(results, 1) if first <= index * every < last]
    assert wrong
    assert all(result == lib.OMNI_ERR_RANGE for result in wrong)
    assert np.abs(found - drive.pose)[first - 100 : last + 200, 0].max() < 0.1


@pytest.mark.parametrize("every", [4, 40, 200])
def test_a_tracker_that_is_frozen_does_not_hold_the_estimate(drive: Drive, every: int) -> None:
    fixes = drive.pose.copy()
    fixes[4000:4800] = fixes[4000]
    found, _ = estimated(drive, fixes, every)
    off = np.abs(found - drive.pose)[4000:4800, :2].max()
    assert off < 0.3 * np.abs(fixes - drive.pose)[4000:4800, :2].max()


def test_fixes_with_swapped_axes_are_refused(drive: Drive) -> None:
    fixes = drive.pose.copy()
    fixes[4000:4600, :2] = fixes[4000:4600, 1::-1]
    apart = np.abs(fixes - drive.pose)[:, 0]
    _, results = estimated(drive, fixes, 200)
    far = [result for index, result in enumerate(results, 1) if apart[index * 200] > 0.5]
    assert far
    assert lib.OMNI_OK not in far


@pytest.mark.parametrize(("every", "most_s"), [(4, 0.6), (40, 2.3), (200, 8.0)])
@pytest.mark.parametrize("sd_theta", [0.0, 1e3], ids=["with heading", "position only"])
def test_refused_fixes_that_agree_with_each_other_restart_the_estimate(
    drive: Drive, every: int, most_s: float, sd_theta: float
) -> None:
    """Somebody has carried the robot by 3 m, and turned it if the fixes tell. Fewer suffice the rarer they are."""
    carried = 4000
    turned = 1.0 if sd_theta == 0.0 else 0.0
    sine, cosine = np.sin(turned), np.cos(turned)
    x, y = (drive.pose - drive.pose[carried])[:, :2].T
    there = drive.pose + np.array([3.0, 1.0, turned])
    there[:, :2] = np.column_stack((cosine * x - sine * y, sine * x + cosine * y)) + there[carried, :2]
    truth = np.where((np.arange(len(there)) < carried)[:, None], drive.pose, there)
    found, results = estimated(drive, truth, every, sd_theta)
    after = [(index * every, result) for index, result in enumerate(results, 1) if index * every >= carried]
    ticks = next(tick for tick, result in after if result == lib.OMNI_OK)
    assert (ticks - carried) * TICK_US * 1e-6 <= most_s
    off = np.hypot(*(found - truth)[:, :2].T)
    assert off[ticks - 1] > 2.0
    assert off[ticks + 2000 :].max() < 0.25
