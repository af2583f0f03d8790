# SPDX-License-Identifier: MIT
"""Pose fixes of every kind mean the same pose, at the time they say and as exact as they say."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from omniwheel.frames import Pose
from omniwheel.setpoints import compact_fix_message
from tests.firmware.client import mav
from tests.firmware.fake_robot import HEARTBEAT, HIL_ON, USB, FakeRobot, command, frame, velocity

NONE = [math.nan] * 21
"""A covariance that the sender does not know."""
Place = tuple[float, float, float]
"""North, east, yaw (clockwise)."""


def covariance(x: float, y: float, yaw: float) -> list[float]:
    """Row-major upper triangle of 6 x 6 with these standard deviations: places counted by going through the rows."""
    matrix = np.diag([x**2, y**2, 9.0, 9.0, 9.0, yaw**2])
    return [float(matrix[row, column]) for row in range(6) for column in range(row, 6)]


def vicon(place: Place, time_us: int = 0, spread: list[float] = NONE) -> bytes:
    return frame("vicon_position_estimate", time_us, place[0], place[1], 0.0, 0.3, -0.2, place[2], spread)


def quaternion(roll: float, pitch: float, yaw: float) -> list[float]:
    """Turn about z, then about the new y, then about the new x, as w, x, y, z."""
    parts = ((yaw, (0, 0, 1)), (pitch, (0, 1, 0)), (roll, (1, 0, 0)))
    w, v = 1.0, np.zeros(3)
    for angle, axis in parts:
        w2, v2 = math.cos(angle / 2), math.sin(angle / 2) * np.array(axis, dtype=float)
        w, v = w * w2 - float(v @ v2), w * v2 + w2 * v + np.cross(v, v2)
    return [float(w), *map(float, v)]


def mocap(place: Place, time_us: int = 0, spread: list[float] = NONE) -> bytes:
    """Of a robot that is a little tilted."""
    tilted = quaternion(0.1, -0.2, place[2])
    return frame("att_pos_mocap", time_us, tilted, place[0], place[1], 0.0, spread)


def compact(place: Place, time_us: int = 0, spread: list[float] = NONE) -> bytes:
    x_mm, y_mm = round(place[0] * 1000), round(-place[1] * 1000)
    sds = () if spread is NONE else (round(1e4 * math.sqrt(spread[0])), round(1e4 * math.sqrt(spread[20])))
    return frame("omni_pose_fix", time_us // 1000, x_mm, y_mm, round(-place[2] * 10_000), *sds)


KINDS: dict[str, Callable[..., bytes]] = {"vicon": vicon, "mocap": mocap, "compact": compact}


def all_zero(kind: str) -> bytes:
    """What a tracker without its object says; of an attitude, that nothing is turned."""
    if kind == "mocap":
        return frame("att_pos_mocap", 0, [1, 0, 0, 0], 0, 0, 0, NONE)
    return KINDS[kind]((0.0, 0.0, 0.0))


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().ready()
    yield one
    one.close()


def now_us(robot: FakeRobot) -> int:
    return int(robot.asked("ODOMETRY").time_usec)


def estimate(robot: FakeRobot) -> Place:
    local, attitude = robot.asked("LOCAL_POSITION_NED"), robot.asked("ATTITUDE")
    return local.x, local.y, attitude.yaw


def put(robot: FakeRobot, place: Place) -> None:
    """Begin the estimate there."""
    robot.send(USB, command(mav.MAV_CMD_OMNI_SET_POSE, place[0], -place[1], -place[2]))
    robot.tick(3)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", [(1.2, -0.7, 0.6), (-2.0, 3.0, -2.5), (0.4, 0.9, 3.1)])
def test_every_kind_of_fix_brings_the_estimate_to_its_place(robot: FakeRobot, kind: str, place: Place) -> None:
    put(robot, (place[0] + 0.02, place[1] - 0.02, place[2] - 0.03))
    for number in range(200):
        near = (place[0] + 0.001 * (number % 2), *place[1:])
        robot.send(USB, KINDS[kind](near, now_us(robot)))
        robot.tick(10)
    assert robot.asked("OMNI_CONTROL").fixes_accepted > 150
    at = estimate(robot)
    assert at[:2] == pytest.approx(place[:2], abs=4e-3)
    assert math.remainder(at[2] - place[2], math.tau) == pytest.approx(0.0, abs=4e-3)


def spread_after(
    robot: FakeRobot, x: float, y: float, yaw: float, kind: Callable[..., bytes] = vicon
) -> tuple[float, float]:
    start = robot.keep()
    for _ in range(20):
        spread = NONE if math.isnan(x) else covariance(x, y, yaw)
        robot.send(USB, kind((0.0, 0.0, 0.0), now_us(robot), spread))
        robot.tick(5)
    sd = robot.asked("OMNI_TRACKING").pose_sd
    robot.go_back(start)
    return math.hypot(sd[0], sd[1]), sd[2]


def test_what_a_fix_says_of_its_spread_counts_and_of_a_plane_the_worse_axis(robot: FakeRobot) -> None:
    put(robot, (0.0, 0.0, 0.0))
    exact = spread_after(robot, 0.001, 0.001, 0.001)
    for worse in (spread_after(robot, 0.02, 0.001, 0.001), spread_after(robot, 0.001, 0.02, 0.001)):
        assert worse[0] > 1.5 * exact[0]
        assert worse == pytest.approx(spread_after(robot, 0.02, 0.02, 0.001))
    unsure = spread_after(robot, 0.001, 0.001, 0.02)
    assert unsure[1] > 1.5 * exact[1]
    unknown = spread_after(robot, math.nan, math.nan, math.nan)
    assert unknown == pytest.approx(spread_after(robot, 0.0, 0.0, 0.0))


def test_the_time_of_a_compact_fix_wraps_as_the_robots_clock_does() -> None:
    wrap_us = 2**32 * 1000
    for time_us in (0, 5_000, wrap_us - 1_000, wrap_us + 7_000):
        assert compact_fix_message(Pose(0.0, 0.0, 0.0), time_us).time_boot_ms == time_us // 1000 % 2**32
    assert compact_fix_message(Pose(0.0, 0.0, 0.0), wrap_us).time_boot_ms == 1, "0 would be: no time is known"


@pytest.mark.parametrize("sds", [(0.001, 0.001), (0.02, 0.001), (0.001, 0.02), (0.0, 0.0), (math.nan, math.nan)])
def test_a_compact_fix_counts_as_much_as_a_long_one(robot: FakeRobot, sds: tuple[float, float]) -> None:
    put(robot, (0.0, 0.0, 0.0))
    xy, yaw = sds
    assert spread_after(robot, xy, xy, yaw, compact) == pytest.approx(spread_after(robot, xy, xy, yaw), rel=1e-4)


@pytest.mark.parametrize(
    ("kind", "sd"), [*((kind, sd) for kind in KINDS for sd in (1.01, 3.0)), ("vicon", math.inf), ("mocap", math.inf)]
)
def test_a_fix_that_tells_nothing_is_not_used(robot: FakeRobot, kind: str, sd: float) -> None:
    """Else it would hide that no fix comes."""
    put(robot, (0.0, 0.0, 0.0))
    before = robot.asked("OMNI_CONTROL").fixes_accepted
    robot.send(USB, KINDS[kind]((0.0, 0.0, 0.0), now_us(robot), covariance(sd, sd, 0.01)))
    robot.tick(5)
    assert "pose fix refused: it may be off by metres" in robot.texts(USB)
    assert robot.asked("OMNI_CONTROL").fixes_accepted == before
    # A source of places without a heading is of use.
    robot.send(USB, KINDS[kind]((0.001, 0.0, 0.0), now_us(robot), covariance(0.01, 0.01, min(sd, 3.0))))
    robot.tick(5)
    assert robot.asked("OMNI_CONTROL").fixes_accepted == before + 1


def turning(robot: FakeRobot, seconds: float) -> list[Place]:
    """Turn on the spot and return where the robot was in each tick."""
    places = []
    for _ in range(round(seconds * 1000)):
        robot.send(USB, HEARTBEAT, velocity(0.0, 0.0, 0.5))
        robot.tick()
        places.append(estimate(robot))
    return places


@pytest.mark.parametrize(
    ("age_us", "used"),
    [(0, True), (100_000, True), (249_000, True), (250_000, True), (250_001, False), (-5_000, True), (-5_001, False)],
)
def test_a_stamp_counts_if_it_is_at_most_a_quarter_second_old(robot: FakeRobot, age_us: int, used: bool) -> None:
    """The fix is true at the time it says; where it was taken for another time it disagrees with the estimate."""
    robot.armed()
    places = turning(robot, 1.0)
    stamp = now_us(robot) - age_us
    place = places[-1 - max(age_us, 0) // 1000] if used else places[-1]
    if not used and age_us > 0:
        place = places[-251]
    exact = covariance(0.002, 0.002, 0.002)
    robot.send(USB, vicon(place, stamp, exact))
    robot.background()
    robot.tick(2)
    nis = robot.asked("OMNI_CONTROL").nis
    agrees = nis < 1.0
    assert agrees == (used or age_us < 0)


@pytest.mark.parametrize(("age_us", "used"), [(250_000, True), (251_000, False), (500_000, False), (900_000, False)])
def test_a_compact_fix_that_says_that_it_is_late_is_not_taken_for_a_new_one(
    robot: FakeRobot, age_us: int, used: bool
) -> None:
    """Its clock is the robot's: where the robot was then says nothing of now."""
    robot.armed()
    robot.tick(600)
    places = turning(robot, 0.4)
    before = robot.asked("OMNI_CONTROL")
    place = places[-1 - min(age_us // 1000, 299)]
    robot.send(USB, compact(place, now_us(robot) - age_us, covariance(0.002, 0.002, 0.002)))
    robot.background()
    robot.tick(3)
    told = any(text.startswith("pose fix refused") for text in robot.texts())
    after = robot.asked("OMNI_CONTROL")
    looked_at = after.fixes_accepted + after.fixes_refused - before.fixes_accepted - before.fixes_refused
    assert (looked_at, told) == (used, not used)


def test_who_sends_late_fixes_is_told_now_and_then_only(robot: FakeRobot) -> None:
    robot.tick(500)
    texts: list[str] = []
    for _ in range(150):
        robot.send(USB, compact((0.0, 0.0, 0.0), now_us(robot) - 400_000))
        robot.tick(20)
        texts += robot.texts()
    assert 1 <= sum(text.startswith("pose fix refused") for text in texts) <= 4


@pytest.mark.parametrize("ahead_us", [20_000, 10_000_000])
def test_a_compact_fix_of_a_clock_that_is_ahead_counts_as_of_fix_delay_ago(robot: FakeRobot, ahead_us: int) -> None:
    """The robot has restarted and its sender has not noticed."""
    robot.tick(100)
    before = robot.asked("OMNI_CONTROL").fixes_accepted
    robot.send(USB, compact((0.001, 0.0, 0.0), now_us(robot) + ahead_us))
    robot.tick(3)
    assert robot.asked("OMNI_CONTROL").fixes_accepted == before + 1


def test_a_sensor_that_says_one_pose_while_the_robot_drives_is_not_believed(robot: FakeRobot) -> None:
    robot.armed()
    frozen = (0.0, 0.0, 0.0)
    refused = "pose fix refused: it repeats itself"
    for _ in range(30):
        robot.send(USB, HEARTBEAT, velocity(0.0), vicon(frozen))
        robot.tick(10)
    assert refused not in robot.texts()
    for _ in range(100):
        robot.send(USB, HEARTBEAT, velocity(0.0, 0.0, 0.5), vicon(frozen))
        robot.tick(10)
    assert refused in robot.texts()
    before = robot.asked("OMNI_CONTROL")
    robot.send(USB, HEARTBEAT, vicon(frozen))
    robot.tick(2)
    after = robot.asked("OMNI_CONTROL")
    assert after.fixes_accepted + after.fixes_refused == before.fixes_accepted + before.fixes_refused


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("place", [(0.4, 0.0, 0.0), (0.0, -0.03, 0.0), (0.0, 0.0, 0.5)])
def test_a_lost_trackers_zeros_do_not_move_a_robot_that_holds(robot: FakeRobot, kind: str, place: Place) -> None:
    put(robot, place)
    robot.armed()
    before = robot.asked("OMNI_CONTROL")
    for _ in range(60):
        robot.send(USB, HEARTBEAT, all_zero(kind))
        robot.tick(20)
    assert any(text.startswith("pose fix refused: ") for text in robot.texts())
    after = robot.asked("OMNI_CONTROL")
    assert (after.fixes_accepted, after.fixes_refused) == (before.fixes_accepted, before.fixes_refused)
    assert estimate(robot) == pytest.approx(place, abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_zeros_without_noise_are_used_while_the_robot_stands_there(robot: FakeRobot, kind: str) -> None:
    put(robot, (0.01, -0.01, 0.01))
    robot.tick(100)  # a fix without a time is taken for older than it is
    before = robot.asked("OMNI_CONTROL").fixes_accepted
    for _ in range(10):
        robot.send(USB, all_zero(kind))
        robot.tick(5)
    assert robot.asked("OMNI_CONTROL").fixes_accepted == before + 10


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_pose_that_is_zero_in_two_numbers_is_a_measurement(robot: FakeRobot, axis: int) -> None:
    place = [0.0, 0.0, 0.0]
    place[axis] = 0.3
    put(robot, (place[0], place[1], place[2]))
    robot.tick(100)
    before = robot.asked("OMNI_CONTROL").fixes_accepted
    robot.send(USB, vicon((place[0], place[1], place[2])))
    robot.tick(5)
    assert robot.asked("OMNI_CONTROL").fixes_accepted == before + 1


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_pose_that_changes_in_one_number_does_not_repeat_itself(robot: FakeRobot, axis: int) -> None:
    robot.armed()
    for number in range(150):
        place = [0.0, 0.0, 0.0]
        place[axis] = 1e-4 * (number % 2)
        robot.send(USB, HEARTBEAT, velocity(0.0, 0.0, 0.5), vicon((place[0], place[1], place[2]), now_us(robot)))
        robot.tick(10)
    assert "pose fix refused: it repeats itself" not in robot.texts()


def test_a_repeated_pose_is_refused_after_five_millimetres_of_way(robot: FakeRobot) -> None:
    robot.armed()
    for _ in range(100):
        robot.send(USB, HEARTBEAT, velocity(0.05))
        robot.tick(10)
    rate = robot.asked("OMNI_TRACKING").reference_rate
    assert math.hypot(rate[0], rate[1]) == pytest.approx(0.05, abs=1e-3)
    robot.look()
    robot.said[USB].clear()
    told_ms = None
    for elapsed_ms in range(0, 300, 2):
        robot.send(USB, HEARTBEAT, velocity(0.05), vicon((0.3, 0.3, 0.3), 0))
        robot.tick(2)
        if any("it repeats itself" in text for text in robot.texts()):
            told_ms = elapsed_ms
            break
    assert told_ms == pytest.approx(100, abs=30)


def test_fixes_without_a_time_are_taken_from_the_first_moment_on(robot: FakeRobot) -> None:
    before = robot.asked("OMNI_CONTROL").fixes_accepted
    for number in range(10):
        robot.send(USB, compact((0.001 * (number % 2), 0.0, 0.0)))
        robot.tick(10)
    assert now_us(robot) < 250_000
    assert robot.asked("OMNI_CONTROL").fixes_accepted == before + 10


NONE_YET, USED, TOO_FAR, UNUSABLE, IGNORED = range(5)
"""OMNI_FIX_RESULT.result."""


def looked_at(robot: FakeRobot, place: Place, time_us: int = 0) -> tuple[int, int]:
    """Send a fix and return its number and what became of it: the tick after the one that looked at it tells."""
    robot.send(USB, vicon(place, time_us))
    robot.tick(3)
    told = robot.asked("OMNI_FIX_RESULT")
    x, y, theta = told.pose
    assert (x, -y, -theta) == pytest.approx(place, abs=1e-6)
    return int(told.number), int(told.result)


def test_what_became_of_a_fix_is_told() -> None:
    robot = FakeRobot()
    robot.tick(10)
    first = robot.asked("OMNI_FIX_RESULT")
    assert (first.number, first.result) == (0, NONE_YET)
    robot.ready()
    put(robot, (0.0, 0.0, 0.0))
    robot.tick(300)
    before = robot.asked("OMNI_FIX_RESULT").number
    near, far = (0.001, -0.002, 0.003), (0.8, 0.4, 0.0)
    assert looked_at(robot, near, now_us(robot)) == (before + 1, USED)
    robot.tick(10)
    assert looked_at(robot, far, now_us(robot)) == (before + 2, TOO_FAR)
    assert looked_at(robot, near, now_us(robot) - 200_000) == (before + 3, UNUSABLE), "an older one than the last used"
    assert looked_at(robot, far, now_us(robot)) == (before + 4, TOO_FAR)
    told, control = robot.asked("OMNI_FIX_RESULT"), robot.asked("OMNI_CONTROL")
    assert control.fixes_refused >= 3
    assert (told.number, told.result) == (before + 4, TOO_FAR), "the same number: the same fix"
    robot.send(USB, frame("param_set", 1, 1, b"EKF_MODE", 0.0, mav.MAV_PARAM_TYPE_REAL32))
    robot.tick(3)
    assert looked_at(robot, near, now_us(robot)) == (before + 5, IGNORED)
    robot.close()


@pytest.mark.parametrize("age_us", [0, 100_000, -3_000])
def test_how_old_a_fix_was_is_told(robot: FakeRobot, age_us: int) -> None:
    put(robot, (0.0, 0.0, 0.0))
    robot.tick(300)
    robot.send(USB, vicon((0.001, 0.0, 0.0), now_us(robot) - age_us))
    robot.tick(3)
    assert robot.asked("OMNI_FIX_RESULT").age == pytest.approx(1e-6 * age_us, abs=2.1e-3)


def test_fixes_of_the_time_before_are_not_told_in_the_loop(robot: FakeRobot) -> None:
    robot.send(USB, vicon((0.001, 0.0, 0.0), now_us(robot)))
    robot.tick(3)
    assert robot.asked("OMNI_FIX_RESULT").number > 0
    assert robot.ask(USB, HIL_ON) == mav.MAV_RESULT_ACCEPTED
    robot.hil_restart()
    robot.tick(3)
    robot.hil_tick(USB, 10)
    told = robot.asked("OMNI_FIX_RESULT")
    assert (told.number, told.result, list(told.pose)) == (0, NONE_YET, [0.0, 0.0, 0.0])


def test_a_fix_refused_before_the_loop_does_not_silence_the_first_one_in_it(robot: FakeRobot) -> None:
    """The loop's clock begins at zero: what was said by the other one was not said just now."""
    bad = vicon((math.nan, 0.0, 0.0))
    refused = "pose fix refused: not finite"
    robot.tick(50)
    robot.send(USB, bad)
    robot.tick()
    assert refused in robot.texts()
    assert robot.ask(USB, HIL_ON) == mav.MAV_RESULT_ACCEPTED
    robot.hil_restart()
    robot.tick(3)
    robot.hil_tick(USB, 100)
    robot.said[USB].clear()
    robot.send(USB, bad)
    robot.hil_tick(USB, 2)
    assert refused in robot.texts()


LOST = {
    "zero": [0.0] * 4,
    "not finite": [math.nan, 0.0, 0.0, 0.0],
    "infinite": [math.inf, 0.0, 0.0, 0.0],
    "short": [0.5, 0.0, 0.0, 0.0],
    "long": [2.0, 0.0, 0.0, 0.0],
}


@pytest.mark.parametrize("name", LOST)
def test_a_quaternion_that_is_no_rotation_is_no_pose(robot: FakeRobot, name: str) -> None:
    """Receivers of motion capture send zeros while the object is hidden."""
    put(robot, (0.4, 0.2, 0.5))
    before = estimate(robot)
    for _ in range(60):
        robot.send(USB, frame("att_pos_mocap", 0, LOST[name], 0.0, 0.0, 0.0, NONE))
        robot.tick(20)
    texts = [text for text in robot.texts() if text.startswith("pose fix refused: its quaternion")]
    assert 1 <= len(texts) <= 2, "once a second"
    assert estimate(robot) == pytest.approx(before, abs=1e-6)
