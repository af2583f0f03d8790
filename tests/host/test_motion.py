# SPDX-License-Identifier: MIT
"""Motions that end by themselves: what they return, what they raise, and that the robot holds afterwards."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import omniwheel
from omniwheel import sync
from omniwheel.errors import ArmingRefusedError, DriveError, LimitError, NotArrivedError, SetpointError
from omniwheel.frames import Pose
from omniwheel.motion_profile import profile
from omniwheel.motion_watch import latest_tracking
from omniwheel.simulation import SimulatedRobot

SQUARE = [(0.5, 0.0), (0.5, 0.5), (0.0, 0.5), (0.0, 0.0)]
NEAR_M, NEAR_RAD = 0.01, 0.03
HELD_S = 3.0


@pytest.fixture
def robot() -> Iterator[SimulatedRobot]:
    with sync.simulate("fast_three_wheel") as robot:
        robot.arm()
        yield robot


def is_near(robot: SimulatedRobot, x: float, y: float, theta: float) -> bool:
    pose = robot.simulation.true_pose
    turn = math.remainder(pose.theta - theta, math.tau)
    return math.hypot(pose.x - x, pose.y - y) < NEAR_M and abs(turn) < NEAR_RAD


def rests(robot: SimulatedRobot) -> bool:
    """Whether the robot stays where it is, armed, for longer than any setpoint lasts."""
    before = robot.simulation.true_pose
    robot.sleep(HELD_S)
    after = robot.simulation.true_pose
    return robot.armed and robot.state == "armed" and math.dist(before[:2], after[:2]) < NEAR_M


@pytest.mark.parametrize("speed", [None, 0.4])
def test_a_square_ends_where_it_began_and_the_robot_holds(robot: SimulatedRobot, speed: float | None) -> None:
    for x, y in SQUARE:
        side = robot.drive_to(x, y, speed=speed)
        assert is_near(robot, x, y, 0.0)
        assert side.goal is not None
        assert side.goal[:2] == (x, y)
        assert 0.4 < side.distance_m < 0.6
    assert rests(robot)
    assert robot.status.mode == "hold"


@pytest.mark.full
def test_the_speed_is_the_one_that_was_asked_for(robot: SimulatedRobot) -> None:
    side = robot.drive_to(1.0, 0.0, speed=0.25)
    steps = np.diff(side.references[:, 0]) / np.diff(side.time_s)
    assert np.max(steps) == pytest.approx(0.25, rel=0.15)
    assert side.duration_s > 4.0


@pytest.mark.full
def test_a_goal_in_the_body_frame_is_ahead_of_the_robot(robot: SimulatedRobot) -> None:
    robot.turn_to(math.pi / 2)
    robot.drive_to(0.3, 0.1, math.pi / 2, frame="body")
    assert is_near(robot, -0.1, 0.3, math.pi)
    robot.turn_to(-math.pi / 2, frame="body")
    assert is_near(robot, -0.1, 0.3, math.pi / 2)


@pytest.mark.full
def test_a_drive_lasts_as_long_as_it_should_and_ends_at_rest(robot: SimulatedRobot) -> None:
    drive = robot.drive(0.2, 0.1, 0.0, duration=1.0)
    assert drive.poses[-1] == pytest.approx([0.2, 0.1, 0.0], abs=0.02)
    assert rests(robot)


@pytest.mark.full
def test_a_velocity_goes_on_until_the_next_motion(robot: SimulatedRobot) -> None:
    robot.velocity(0.2, 0.0, 0.0)
    robot.sleep(2.0)
    assert robot.twist.vx == pytest.approx(0.2, abs=0.05)
    robot.velocity(0.0, 0.2, 0.0)
    robot.sleep(2.0)
    assert robot.twist.vy == pytest.approx(0.2, abs=0.05)
    robot.stop()
    assert rests(robot)


@pytest.mark.full
@pytest.mark.parametrize("last", ["hold", "stop"])
def test_hold_and_stop_end_a_motion(robot: SimulatedRobot, last: str) -> None:
    robot.velocity(0.1, 0.0, 0.0)
    robot.sleep(1.0)
    getattr(robot, last)()
    assert rests(robot)


def as_file(folder: Path) -> Path:
    path = folder / "line.csv"
    path.write_text("x,y\n0.3,0\n0.5,0.2\n0.5,0.4\n", encoding="utf-8")
    return path


LINE = [(0.3, 0.0), (0.5, 0.2), (0.5, 0.4)]
FORMS: dict[str, Callable[[Path], object]] = {
    "list": lambda _: LINE,
    "array": lambda _: np.array(LINE),
    "shape": lambda _: SimpleNamespace(coords=LINE),
    "path": as_file,
    "text": lambda folder: str(as_file(folder)),
}


@pytest.mark.full
@pytest.mark.parametrize("form", FORMS)
def test_a_path_in_any_form_is_followed_to_its_end(robot: SimulatedRobot, form: str, tmp_path: Path) -> None:
    drive = robot.follow(FORMS[form](tmp_path), speed=0.3, heading=0.0)
    assert is_near(robot, 0.5, 0.4, 0.0)
    assert drive.largest_error_m < 0.02
    assert rests(robot)


@pytest.mark.full
def test_progress_is_told_while_it_drives(robot: SimulatedRobot) -> None:
    seen: list[float] = []
    robot.drive_to(0.3, 0.0, progress=lambda tracking: seen.append(tracking.pose.x))
    assert len(seen) > 10
    assert seen[-1] == pytest.approx(0.3, abs=NEAR_M)


@pytest.mark.full
def test_what_cannot_be_is_refused_with_limit_and_numbers(robot: SimulatedRobot) -> None:
    with pytest.raises(LimitError) as caught:
        robot.drive(9.0, 0.0, 0.0, duration=1.0)
    assert caught.value.limit in ("LIM_V", "LIM_WHEEL", "motors")
    assert caught.value.asked == 9.0
    assert 0.5 < caught.value.possible < 9.0
    impossible: tuple[Callable[[], object], ...] = (
        lambda: robot.drive_to(0.5, 0.0, speed=9.0),
        lambda: robot.velocity(0.0, 9.0, 0.0),
        lambda: robot.drive_to(1e3, 0.0),
        lambda: robot.drive_to(5.0, 0.0, timeout_s=0.1),
    )
    for refused in impossible:
        with pytest.raises(LimitError) as caught:
            refused()
        assert caught.value.asked != caught.value.possible
    wrong: tuple[Callable[[], object], ...] = (
        lambda: robot.drive_to(math.nan, 0.0),
        lambda: robot.drive_to(0.1, 0.0, speed=-1.0),
        lambda: robot.drive_to(0.1, 0.0, frame="room"),
    )
    for bad in wrong:
        with pytest.raises(SetpointError):
            bad()
    assert rests(robot)


@pytest.mark.full
def test_a_robot_that_is_not_armed_does_not_drive() -> None:
    with sync.simulate() as robot:
        with pytest.raises(DriveError):
            robot.drive_to(1.0, 0.0)
        with pytest.raises(DriveError):
            robot.velocity(0.1, 0.0, 0.0)
        robot.stop()
        assert not robot.armed


WAYS = {
    "fast_three_wheel": ((0.02, 0.0, 0.0), (0.3, 0.0, 0.0), (1.5, 1.0, 0.5), (1.5, 1.0, 3.0), (0.0, 0.0, 0.0)),
    "three_wheel": ((0.05, 0.0, 0.0), (0.4, 0.3, 0.0), (0.4, 0.3, 2.0)),
    "four_wheel": ((0.05, 0.0, 0.0), (0.4, 0.3, 0.0), (0.4, 0.3, 2.0)),
}
SPEEDS = {"fast_three_wheel": (None, 0.1, 0.4), "three_wheel": (None, 0.05), "four_wheel": (None,)}


@pytest.mark.full
@pytest.mark.parametrize(("name", "speed"), [(name, speed) for name in SPEEDS for speed in SPEEDS[name]])
def test_the_travel_time_is_within_a_tenth(name: str, speed: float | None) -> None:
    with sync.simulate(name) as robot:
        robot.arm()
        for goal in WAYS[name]:
            expected_s = robot.travel_time_s(Pose(*goal), speed)
            driven_s = robot.drive_to(*goal, speed=speed).duration_s
            assert expected_s == pytest.approx(driven_s, rel=0.1, abs=0.3)
            assert robot.allowed_time_s(Pose(*goal)) > robot.travel_time_s(Pose(*goal)) + 2.0


@pytest.mark.full
def test_one_that_is_late_says_where_it_is_and_holds(robot: SimulatedRobot) -> None:
    with pytest.raises(NotArrivedError) as caught:
        robot.drive_to(2.0, 0.0, timeout_s=0.9 * robot.travel_time_s(Pose(2.0, 0.0, 0.0)))
    assert caught.value.goal[:2] == (2.0, 0.0)
    assert 0.0 < caught.value.pose.x < 2.0
    assert rests(robot)


@pytest.mark.full
def test_equal_programs_give_equal_bytes() -> None:
    def records(seed: int) -> bytes:
        with omniwheel.simulate(seed=seed, speed="max") as robot:
            robot.arm()
            robot.drive_to(0.2, 0.1, speed=0.4)
            return robot.run.records

    assert records(3) == records(3)
    assert records(3) != records(4)


POSES = st.builds(Pose, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.0, 3.0))
POSITIVE = st.floats(0.01, 10.0)


@given(POSES, POSES, POSITIVE, POSITIVE, POSITIVE, POSITIVE)
def test_a_profile_goes_from_start_to_goal_within_its_limits(
    start: Pose, goal: Pose, speed: float, turn_rate: float, acceleration: float, turn_acceleration: float
) -> None:
    way = profile(start, goal, speed, turn_rate, acceleration, turn_acceleration)
    assert way.at(0.0)[0] == pytest.approx(start)
    assert way.at(way.duration_s)[0] == goal
    times = np.linspace(0.0, way.duration_s, 200)
    twists = np.array([way.at(time_s)[1] for time_s in times])
    assert np.hypot(twists[:, 0], twists[:, 1]).max() <= speed * (1 + 1e-9)
    assert np.abs(twists[:, 2]).max() <= turn_rate * (1 + 1e-9)
    changes = np.diff(twists, axis=0) / (times[1] - times[0])
    assert np.hypot(changes[:, 0], changes[:, 1]).max() <= acceleration * (1 + 1e-6)
    assert np.abs(changes[:, 2]).max() <= turn_acceleration * (1 + 1e-6)
    poses = np.array([way.at(time_s)[0] for time_s in times])
    driven = (0.5 * (twists[1:] + twists[:-1]) * np.diff(times)[:, None]).sum(axis=0)
    turned = math.remainder(goal.theta - start.theta, math.tau)
    wanted = [goal.x - start.x, goal.y - start.y, turned]
    assert driven == pytest.approx(wanted, abs=0.02 * max(1.0, np.abs(wanted).max()))
    assert np.abs(np.diff(poses[:, :2], axis=0)).max() <= speed * (times[1] - times[0]) * (1 + 1e-6) + 1e-9


@pytest.mark.full
def test_a_drive_with_a_velocity_has_no_error_and_one_to_a_pose_has(robot: SimulatedRobot) -> None:
    drive = robot.drive(0.2, 0.0, 0.0, duration=0.5)
    assert drive.largest_error_m is None
    assert drive.errors is None
    way = robot.drive_to(0.0, 0.0)
    assert 0.0 < way.largest_error_m < 0.02
    assert way.references.shape == way.poses.shape


@pytest.mark.full
def test_arming_in_an_emergency_stop_says_how_to_release_it() -> None:
    with sync.simulate() as robot:
        robot.estop()
        with pytest.raises(ArmingRefusedError) as caught:
            robot.arm()
        assert "estop_clear()" in caught.value.hint


@pytest.mark.parametrize("speed", [None, 0.1])
def test_a_drive_to_where_it_is_ends_there(robot: SimulatedRobot, speed: float | None) -> None:
    goal = latest_tracking(robot).reference
    assert robot.drive_to(goal.x, goal.y, goal.theta, speed=speed).distance_m < 0.005
