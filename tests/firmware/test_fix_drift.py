# SPDX-License-Identifier: MIT
"""Fixes that creep away from the wheels are told; those that only jump, or of a robot that is carried, are not."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator

import pytest

from tests.firmware.fake_robot import HEARTBEAT, USB, FakeRobot, velocity
from tests.firmware.test_pose_fixes import compact, now_us

TOLD = "fixes and wheels disagree"
PERIOD_MS = 20


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().ready()
    yield one
    one.close()


def still(_: float) -> float:
    return 0.0


def told_after_s(
    robot: FakeRobot, x_at: Callable[[float], float], duration_s: float, theta_at: Callable[[float], float] = still
) -> float | None:
    """Send fixes at these places for a while, the wheels being still. Return when it was told."""
    robot.look()
    robot.said[USB].clear()
    for elapsed_ms in range(0, int(1000 * duration_s), PERIOD_MS):
        shaken = 1e-4 * (elapsed_ms // PERIOD_MS % 2)
        place = (x_at(elapsed_ms / 1000), shaken, theta_at(elapsed_ms / 1000))
        robot.send(USB, HEARTBEAT, velocity(0.0), compact(place, now_us(robot)))
        robot.tick(PERIOD_MS)
        if any(TOLD in text for text in robot.texts()):
            return elapsed_ms / 1000
    return None


def test_a_tracker_that_creeps_is_told_within_two_windows(robot: FakeRobot) -> None:
    robot.armed()
    told_s = told_after_s(robot, lambda t: 0.2 * t, 6.0)
    assert told_s == pytest.approx(4.0, abs=0.2)


@pytest.mark.parametrize("begin", [0.0, 3.1])
def test_a_heading_that_creeps_is_told_across_the_half_turn_too(robot: FakeRobot, begin: float) -> None:
    robot.armed()
    told_s = told_after_s(robot, still, 9.0, lambda t: math.remainder(begin + 0.05 * t, 2 * math.pi))
    assert told_s is not None
    told = re.fullmatch(f"{TOLD} by ([0-9]+) mrad/s", robot.texts()[-1])
    assert told is not None
    assert int(told[1]) == pytest.approx(50, abs=2)


@pytest.mark.parametrize("theta_at", [lambda t: 0.01 * t, lambda t: 0.3 * (t > 3.0)])
def test_a_heading_that_drifts_slowly_or_jumps_is_not(robot: FakeRobot, theta_at: Callable[[float], float]) -> None:
    robot.armed()
    assert told_after_s(robot, still, 9.0, theta_at) is None


@pytest.mark.parametrize("x_at", [lambda t: 0.0, lambda t: 0.02 * t, lambda t: 0.3 * (t > 3.0)])
def test_noise_a_slow_drift_and_one_jump_are_not(robot: FakeRobot, x_at: Callable[[float], float]) -> None:
    robot.armed()
    assert told_after_s(robot, x_at, 9.0) is None


def test_a_robot_that_is_carried_is_not(robot: FakeRobot) -> None:
    assert told_after_s(robot, lambda t: 0.5 * t, 6.0) is None


def test_fixes_that_come_too_rarely_are_not_compared(robot: FakeRobot) -> None:
    robot.armed()
    for second in range(8):
        robot.send(USB, HEARTBEAT, compact((0.3 * second, 0.0, 0.0), now_us(robot)))
        for _ in range(10):
            robot.send(USB, HEARTBEAT, velocity(0.0))
            robot.tick(100)
    assert not any(TOLD in text for text in robot.texts())


def test_a_restart_of_the_estimate_is_told_once(robot: FakeRobot) -> None:
    """The tracker has been set anew by half a metre: refused fixes that agree restart the estimate."""
    robot.armed()
    said: list[str] = []
    for step in range(200):
        x, shaken = 0.5 * (step >= 100), 1e-4 * (step % 2)
        robot.send(USB, HEARTBEAT, velocity(0.0), compact((x, shaken, 0.0), now_us(robot)))
        robot.tick(PERIOD_MS)
        said += robot.texts()  # the next question forgets them
    assert sum(text.startswith("pose restarted") for text in said) == 1
