# SPDX-License-Identifier: MIT
"""The robot tells how long ago it used a fix, and a ground station makes words of it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from omniwheel.pose_quality import PoseQuality, QualityWatch, Verdict
from omniwheel.telemetry import Control, Status, Tracking
from tests.firmware.client import mav
from tests.firmware.fake_robot import USB, FakeRobot, command, frame

PERIOD_TICKS = 20


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().ready()
    yield one
    one.close()


def give_fixes(robot: FakeRobot, count: int) -> None:
    for _ in range(count):
        robot.send(USB, frame("omni_pose_fix", 0, 0, 0, 0))
        robot.tick(PERIOD_TICKS)


def age_s(robot: FakeRobot) -> float:
    return float(robot.asked("OMNI_CONTROL").fix_age)


def look(watch: QualityWatch, robot: FakeRobot) -> PoseQuality:
    watch.take(Tracking.decoded(robot.asked("OMNI_TRACKING")))
    watch.take(Control.decoded(robot.asked("OMNI_CONTROL")))
    watch.take(Status.decoded(robot.asked("OMNI_STATUS")))
    quality = watch.quality()
    assert quality is not None
    return quality


def test_the_age_grows_from_the_last_fix_on_and_a_set_pose_ends_it(robot: FakeRobot) -> None:
    assert age_s(robot) == -1.0
    give_fixes(robot, 10)
    begun = age_s(robot)
    assert 0.0 < begun <= 1e-3 * (PERIOD_TICKS + 2)
    robot.tick(500)
    assert age_s(robot) == pytest.approx(begun + 0.5, abs=3e-3)
    give_fixes(robot, 1)
    assert age_s(robot) == pytest.approx(begun, abs=3e-3)
    robot.send(USB, command(mav.MAV_CMD_OMNI_SET_POSE, 1.0, 2.0, 0.0))
    robot.tick(3)
    assert age_s(robot) == -1.0


def test_a_refused_fix_does_not_make_it_young(robot: FakeRobot) -> None:
    give_fixes(robot, 20)
    before = age_s(robot)
    robot.send(USB, frame("omni_pose_fix", 0, 3000, 0, 0))
    robot.tick(100)
    assert robot.asked("OMNI_CONTROL").fixes_refused == 1
    assert age_s(robot) == pytest.approx(before + 0.1, abs=3e-3)


def test_noise_that_the_filter_has_found_is_told(robot: FakeRobot) -> None:
    """At rest nothing is found: both are as configured."""
    give_fixes(robot, 50)
    told = Control.decoded(robot.asked("OMNI_CONTROL"))
    assert (told.wheel_noise, told.fix_noise) == (1.0, 1.0)


def test_the_words_follow_from_fixes_to_none(robot: FakeRobot) -> None:
    """The size is the robot's own covariance, as the standard message ODOMETRY has it."""
    watch = QualityWatch()
    assert look(watch, robot).verdict is Verdict.NO_FIXES
    give_fixes(robot, 100)
    good = look(watch, robot)
    assert (good.verdict, good.advice) == (Verdict.GOOD, "")
    robot.tick(20_000)
    late = look(watch, robot)
    assert late.verdict is Verdict.DRIFTING
    assert late.text.startswith("pose drifting: no fix for 20 s, ±")
    assert late.drift is not None
    covariance = robot.asked("ODOMETRY").pose_covariance
    assert late.heading_rad == pytest.approx(1.96 * covariance[20] ** 0.5, rel=1e-3)
    assert late.heading_rad - good.heading_rad == pytest.approx(20.0 * late.drift[1], rel=0.01)
    assert late.position_m > 1.5 * good.position_m
    give_fixes(robot, 50)
    assert look(watch, robot).verdict is Verdict.GOOD
