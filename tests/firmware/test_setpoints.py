# SPDX-License-Identifier: MIT
"""What a set-point asks for is what the reference comes to; what must not be asked for is refused with the reason."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from omniwheel.robots import parameter_table, read_robot
from tests.firmware.client import mav
from tests.firmware.fake_robot import DISARM, HEARTBEAT, RADIO, USB, FakeRobot, command, duty, frame

WORLD, BODY_NED, BODY_FRD = mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_BODY_NED, mav.MAV_FRAME_BODY_FRD
NO_POSITION, NO_VELOCITY, NO_YAW, NO_YAW_RATE = 0x003, 0x018, 0x400, 0x800
NO_X, NO_VY = 0x001, 0x010
ALWAYS = 0x1E4
"""z, vz and accelerations mean nothing to a robot on a floor."""
FLOAT_NEXT = 1.0001


def target(
    mask: int,
    position: tuple[float, float] = (0.0, 0.0),
    velocity: tuple[float, float] = (0.0, 0.0),
    yaw: float = 0.0,
    yaw_rate: float = 0.0,
    axes: int = WORLD,
) -> bytes:
    numbers = (*position, 0.0, *velocity, 0.0, 0.0, 0.0, 0.0, yaw, yaw_rate)
    return frame("set_position_target_local_ned", 0, 1, 1, axes, mask | ALWAYS, *numbers)


def reference(robot: FakeRobot) -> Any:
    return robot.asked("POSITION_TARGET_LOCAL_NED")


def follow(robot: FakeRobot, request: bytes, seconds: float) -> Any:
    """Stream a set-point and return the reference that the robot has come to, north, east, down."""
    for _ in range(round(seconds * 50)):
        robot.send(USB, HEARTBEAT, request)
        robot.tick(20)
    return reference(robot)


def change(robot: FakeRobot, name: str, value: float) -> None:
    robot.send(USB, frame("param_set", 1, 1, name.encode(), value, mav.MAV_PARAM_TYPE_REAL32))
    robot.tick(5)


def refusals(robot: FakeRobot, request: bytes) -> list[str]:
    robot.look()
    robot.said[USB].clear()
    robot.tick(1100)  # a stream's refusals are said once a second
    robot.send(USB, request)
    robot.tick()
    return [text for text in robot.texts() if text.startswith("setpoint refused")]


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().armed()
    yield one
    one.close()


@pytest.mark.parametrize(("north", "east", "yaw"), [(0.1, 0.05, 0.4), (-0.08, 0.02, -0.7), (0.02, -0.1, 3.0)])
def test_the_reference_comes_to_the_pose(robot: FakeRobot, north: float, east: float, yaw: float) -> None:
    at = follow(robot, target(NO_VELOCITY | NO_YAW_RATE, (north, east), yaw=yaw), 25.0)
    assert (at.x, at.y) == pytest.approx((north, east), abs=1e-3)
    assert math.remainder(at.yaw - yaw, math.tau) == pytest.approx(0.0, abs=1e-3)
    assert (at.coordinate_frame, at.type_mask) == (WORLD, 0)


def test_without_a_yaw_the_heading_is_kept(robot: FakeRobot) -> None:
    follow(robot, target(NO_VELOCITY | NO_YAW_RATE, yaw=0.5), 12.0)
    at = follow(robot, target(NO_VELOCITY | NO_YAW_RATE | NO_YAW, (0.05, 0.05), yaw=-2.0), 12.0)
    assert (at.x, at.y, at.yaw) == pytest.approx((0.05, 0.05, 0.5), abs=2e-3)


def test_a_pose_moves_on_with_its_velocity_between_the_messages_and_only_with_what_the_mask_leaves(
    robot: FakeRobot,
) -> None:
    """One message is taken on by its own velocity: after 0.3 s it asks for 0.3 s more of way."""
    still = target(NO_VELOCITY | NO_YAW_RATE, (0.02, 0.02), yaw=0.2)
    moving = {"velocity": (0.04, -0.03), "yaw_rate": -0.25}
    for mask, way in ((0, (0.04, -0.03, -0.25)), (NO_VELOCITY, (0, 0, -0.25)), (NO_YAW_RATE, (0.04, -0.03, 0))):
        follow(robot, still, 12.0)
        robot.send(USB, HEARTBEAT, target(mask, (0.02, 0.02), yaw=0.2, **moving))  # type: ignore[arg-type]
        robot.tick(450)
        at = reference(robot)
        assert (at.vx, at.vy, at.yaw_rate) == pytest.approx(way, abs=4e-3)
        assert (math.copysign(1, at.x - 0.02) if way[0] else 0) == (1 if way[0] else 0)


@pytest.mark.parametrize("axes", [WORLD, BODY_NED, BODY_FRD])
@pytest.mark.parametrize(("forward", "right"), [(0.03, 0.04), (-0.05, 0.01), (0.0, -0.04)])
def test_a_velocity_is_in_its_own_axes(robot: FakeRobot, axes: int, forward: float, right: float) -> None:
    follow(robot, target(NO_VELOCITY | NO_YAW_RATE, yaw=1.0), 25.0)
    at = follow(
        robot, target(NO_POSITION | NO_YAW | NO_YAW_RATE, velocity=(forward, right), yaw_rate=0.3, axes=axes), 4.0
    )
    turn = complex(math.cos(at.yaw), math.sin(at.yaw)) if axes != WORLD else complex(1.0, 0.0)
    wanted = complex(forward, right) * turn
    assert (at.vx, at.vy, at.yaw_rate) == pytest.approx((wanted.real, wanted.imag, 0.0), abs=2e-3)


def test_a_turn_rate_alone_and_one_axis_alone(robot: FakeRobot) -> None:
    at = follow(robot, target(NO_POSITION | NO_YAW | NO_VELOCITY, velocity=(0.05, 0.05), yaw_rate=-0.4), 3.0)
    assert (at.vx, at.vy, at.yaw_rate) == pytest.approx((0.0, 0.0, -0.4), abs=1e-3)
    follow(robot, target(NO_VELOCITY | NO_YAW_RATE), 12.0)
    at = follow(robot, target(NO_POSITION | NO_YAW | NO_VY | NO_YAW_RATE, velocity=(0.05, 0.05)), 3.0)
    assert (at.vx, at.vy) == pytest.approx((0.05, 0.0), abs=1e-3)
    at = follow(robot, target(NO_POSITION | NO_YAW | 0x008 | NO_YAW_RATE, velocity=(0.05, 0.05)), 3.0)
    assert (at.vx, at.vy) == pytest.approx((0.0, 0.05), abs=1e-3)


@pytest.mark.parametrize(
    ("stick", "share"),
    [
        ((0, 0, 0), (0.0, 0.0, 0.0)),
        ((500, 0, 0), (0.5, 0.0, 0.0)),
        ((300, -400, 0), (0.3, -0.4, 0.0)),
        ((0, 1000, 0), (0.0, 1.0, 0.0)),
        ((1000, -1000, 0), (math.sqrt(0.5), -math.sqrt(0.5), 0.0)),
        ((0, 0, 500), (0.0, 0.0, 0.5)),
        ((0, 0, -1000), (0.0, 0.0, -1.0)),
        ((1500, 0, 0), (1.0, 0.0, 0.0)),
        ((0, 0, 32767), (0.0, 0.0, 0.0)),
        ((32767, 250, 0), (0.0, 0.25, 0.0)),
    ],
)
def test_sticks_are_shares_of_the_limits(
    robot: FakeRobot, stick: tuple[int, int, int], share: tuple[float, float, float]
) -> None:
    """A direction keeps its angle at the limit: no square of sticks is faster along its diagonal."""
    change(robot, "LIM_V", 0.05)
    change(robot, "LIM_W", 0.4)
    at = follow(robot, frame("manual_control", 1, stick[0], stick[1], 0, stick[2], 0), 3.0)
    wanted = complex(share[0], share[1]) * 0.05 * complex(math.cos(at.yaw), math.sin(at.yaw))
    assert (at.vx, at.vy) == pytest.approx((wanted.real, wanted.imag), abs=1e-3)
    assert at.yaw_rate == pytest.approx(0.4 * share[2], abs=1e-3)


def own_values(name: str) -> dict[str, float]:
    """Return the limits, motors, encoders and wheels of a robot, as far as they differ from the simulated one's."""
    values, base = read_robot(name).parameter_values(), read_robot("three_wheel").parameter_values()
    kinds = ("LIM_", "MOT_", "BAT_V_NOM", "WHEEL_", "ENC_CPR")
    return {key: value for key, value in values.items() if key.startswith(kinds) and value != base[key]}


LIMITS = {name: own_values(name) for name in ("three_wheel", "fast_three_wheel")}


@pytest.mark.parametrize("limits", LIMITS.values(), ids=LIMITS)
@pytest.mark.parametrize("axes", [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, 0, 1)])
def test_full_stick_is_what_the_robot_reaches_and_half_stick_is_half(
    robot: FakeRobot, limits: dict[str, float], axes: tuple[int, int, int]
) -> None:
    robot.send(USB, DISARM)
    robot.tick(5)
    for name, value in limits.items():
        change(robot, name, value)
    robot.armed()
    speeds = []
    for stick in (500, 1000):
        x, y, r = (axis * stick for axis in axes)
        at = follow(robot, frame("manual_control", 1, x, y, 0, r, 0), 3.0)
        wheels = max(map(abs, robot.asked("OMNI_WHEELS").reference))
        speeds.append((math.hypot(at.vx, at.vy), abs(at.yaw_rate), wheels))
        assert not any("scaled" in text for text in robot.texts())
    half, full = speeds
    most = {"LIM_V": 1.0, "LIM_W": 3.0, "LIM_WHEEL": 3.0, **limits}
    of_limits = full[0] / most["LIM_V"], full[1] / most["LIM_W"], full[2] / most["LIM_WHEEL"]
    assert 0.9 <= max(of_limits) <= 1.0001
    assert half == pytest.approx([0.5 * each for each in full], rel=0.02, abs=2e-3)


POSE = NO_VELOCITY | NO_YAW_RATE
RATE = NO_POSITION | NO_YAW
NAN = math.nan
REFUSED = {
    "a pose in the body's axes": (target(POSE, axes=BODY_FRD), "a pose needs frame LOCAL_NED"),
    "x without y": (target(POSE | NO_X), "x and y belong together"),
    "beyond in x": (target(POSE, (20.01, 0.0)), "position beyond LIM_POS"),
    "beyond in -x": (target(POSE, (-20.01, 0.0)), "position beyond LIM_POS"),
    "beyond in y": (target(POSE, (0.0, 20.01)), "position beyond LIM_POS"),
    "beyond in -y": (target(POSE, (0.0, -20.01)), "position beyond LIM_POS"),
    "no pose": (target(POSE, (NAN, 0.0)), "pose is not finite"),
    "a pose too fast": (target(0, velocity=(FLOAT_NEXT, 0.0)), "speed beyond LIM_V"),
    "nothing": (target(RATE | NO_VELOCITY | NO_YAW_RATE), "the mask ignores everything"),
    "foreign axes": (target(RATE, axes=mav.MAV_FRAME_GLOBAL), "frame must be 1, 8 or 12"),
    "too fast": (target(RATE, velocity=(0.8, 0.601)), "speed beyond LIM_V"),
    "too fast backwards": (target(RATE, velocity=(-FLOAT_NEXT, 0.0)), "speed beyond LIM_V"),
    "turning too fast": (target(RATE, yaw_rate=3.0 * FLOAT_NEXT), "turn rate beyond LIM_W"),
    "turning too fast the other way": (target(RATE, yaw_rate=-3.0 * FLOAT_NEXT), "turn rate beyond LIM_W"),
    "no velocity": (target(RATE, velocity=(NAN, 0.0)), "velocity is not finite"),
    "a duty": (duty(1.001), "duty beyond -1..1"),
    "a duty backwards": (duty(-1.001), "duty beyond -1..1"),
    "no duty": (duty(NAN), "duty beyond -1..1"),
}
TAKEN = {
    "at the limit in x and y": target(POSE, (20.0, -20.0)),
    "as fast as may be": target(RATE, velocity=(1.0, 0.0)),
    "as fast as may be askew": target(RATE, velocity=(0.8, -0.6)),
    "turning as fast as may be": target(RATE, yaw_rate=-3.0),
    "a pose as fast as may be": target(0, velocity=(0.0, 1.0), yaw_rate=3.0),
    "only a turn": target(RATE | NO_VELOCITY, yaw_rate=0.1),
    "only a velocity": target(RATE | NO_YAW_RATE, velocity=(0.1, 0.0)),
    "all the duty": duty(1.0),
    "all the duty backwards": duty(-1.0),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_and_moves_nothing(robot: FakeRobot, name: str) -> None:
    request, why = REFUSED[name]
    assert refusals(robot, request) == [f"setpoint refused: {why}"]
    robot.tick(20)
    assert not robot.driven()


@pytest.mark.parametrize("name", TAKEN)
def test_what_is_at_the_limit_is_taken(robot: FakeRobot, name: str) -> None:
    assert refusals(robot, TAKEN[name]) == []
    driven = []
    for _ in range(20):
        driven.append(robot.driven())
        robot.tick()
    assert any(driven)


def waypoint(number: int, x: float, y: float, theta: float) -> bytes:
    return command(mav.MAV_CMD_OMNI_WAYPOINT, float(number), x, y, theta)


def test_waypoints_are_passed_in_their_order_with_their_headings(robot: FakeRobot) -> None:
    points = [(0.03, 0.01, 0.2), (0.05, -0.04, -0.3), (-0.02, 0.02, 0.5)]
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 1.0, 1.0)) == mav.MAV_RESULT_DENIED
    for number, point in enumerate(points):
        assert robot.ask(USB, waypoint(number, *point)) == mav.MAV_RESULT_ACCEPTED
    change(robot, "TRJ_PERIOD", 3.0)
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 1.0, 1.0)) == mav.MAV_RESULT_ACCEPTED
    nearest = [math.inf] * len(points)
    reached = [0] * len(points)
    for step in range(1500):
        robot.send(USB, HEARTBEAT)
        robot.tick(20)
        tracking = robot.asked("OMNI_TRACKING")
        for number, point in enumerate(points):
            distance = math.dist(tracking.reference, point)
            if distance < nearest[number] - 1e-4:
                nearest[number], reached[number] = distance, step
        if tracking.phase == 3:
            break
    assert nearest == pytest.approx([0.0] * len(points), abs=0.02)
    assert reached == sorted(reached)


def test_a_waypoint_that_is_sent_again_is_not_added_again(robot: FakeRobot) -> None:
    """A radio lost the acknowledgement, the host sent it once more, and the robot refused it."""
    for number in (0, 0, 1, 1, 1, 2, 2):
        assert robot.ask(USB, waypoint(number, 0.1 * number, 0.0, 0.0)) == mav.MAV_RESULT_ACCEPTED
    assert robot.ask(USB, waypoint(1, 0.1, 0.0, 0.0)) == mav.MAV_RESULT_DENIED, "others stay in their order"
    assert robot.ask(USB, waypoint(4, 0.4, 0.0, 0.0)) == mav.MAV_RESULT_DENIED
    for number in range(3, 32):
        assert robot.ask(USB, waypoint(number, 0.01 * number, 0.0, 0.0)) == mav.MAV_RESULT_ACCEPTED
    assert robot.ask(USB, waypoint(31, 0.3, 0.0, 0.0)) == mav.MAV_RESULT_ACCEPTED
    assert robot.ask(USB, waypoint(32, 0.3, 0.0, 0.0)) == mav.MAV_RESULT_DENIED, "there are 32"


def test_a_spline_passes_its_waypoints_without_a_stop_in_the_time_asked_for(robot: FakeRobot) -> None:
    points = [(0.1 * number, 0.02 * (number % 2), 0.0) for number in range(5)]
    for number, point in enumerate(points):
        assert robot.ask(USB, waypoint(number, *point)) == mav.MAV_RESULT_ACCEPTED
    spline = float(parameter_table()["TRJ_TYPE"].values["spline"])
    for bad in (-1.0, 0.1, 1e9, math.nan, math.inf):
        assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, spline, 1.0, bad)) == mav.MAV_RESULT_DENIED
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, spline, 1.0, 12.0)) == mav.MAV_RESULT_ACCEPTED
    speeds, times = [], []
    for _ in range(1000):
        robot.send(USB, HEARTBEAT)
        robot.tick(20)
        tracking = robot.asked("OMNI_TRACKING")
        speeds.append(math.hypot(*tracking.reference_rate[:2]))
        times.append(tracking.path_time)
        if tracking.phase == 3:
            break
    assert max(times) == pytest.approx(12.0, abs=0.1)
    middle = [speed for speed, time in zip(speeds, times, strict=True) if 3.0 < time < 9.0]
    assert min(middle) > 0.8 * 0.4 / 12.0, "it does not stop at a point"


@pytest.mark.parametrize(
    ("request_", "result"),
    [
        (command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 4.0, 1.0), mav.MAV_RESULT_ACCEPTED),
        (command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP), mav.MAV_RESULT_ACCEPTED),
        (command(mav.MAV_CMD_DO_SET_MODE, 1.0, 0.0), mav.MAV_RESULT_ACCEPTED),
        (command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 99.0, 1.0), mav.MAV_RESULT_DENIED),
        (command(mav.MAV_CMD_DO_SET_MODE, 0.0, 2.0), mav.MAV_RESULT_DENIED),
    ],
    ids=["start", "stop", "hold", "no such path", "no such mode"],
)
def test_who_says_where_to_go_has_the_command_if_it_was_accepted(
    robot: FakeRobot, request_: bytes, result: int
) -> None:
    for _ in range(20):
        robot.send(USB, HEARTBEAT)
        robot.send(RADIO, HEARTBEAT)
        robot.tick(50)
    assert robot.ask(RADIO, request_) == result
    for _ in range(200):
        robot.send(RADIO, HEARTBEAT)
        robot.tick(50)
    goes_on = robot.asked("OMNI_STATUS").state == 2
    assert goes_on == (result == mav.MAV_RESULT_ACCEPTED)


def arm_again(robot: FakeRobot, ticks: int) -> None:
    """Disarm and arm; return so many ticks after the answer."""
    robot.ready()
    robot.ask(USB, command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0.0))
    robot.tick(5)
    assert robot.ask(USB, command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)) == mav.MAV_RESULT_ACCEPTED
    robot.tick(ticks)


@pytest.mark.parametrize("ticks", range(5))
def test_a_path_asked_for_in_the_very_ticks_of_arming_begins(robot: FakeRobot, ticks: int) -> None:
    arm_again(robot, ticks)
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 3.0, 1.0)) == mav.MAV_RESULT_ACCEPTED
    robot.tick(20)
    assert robot.asked("OMNI_TRACKING").phase in (1, 2)


@pytest.mark.parametrize("ticks", range(5))
def test_an_excitation_asked_for_in_the_very_ticks_of_arming_is_for_later(robot: FakeRobot, ticks: int) -> None:
    """Not "arm first": it was armed."""
    arm_again(robot, ticks)
    step_of_pose = command(mav.MAV_CMD_OMNI_EXCITE, 3.0, 0.0, 1e-5, 0.5)
    first = robot.ask(USB, step_of_pose)
    assert first in (mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_TEMPORARILY_REJECTED)
    robot.tick(5)
    assert robot.ask(USB, step_of_pose) == mav.MAV_RESULT_ACCEPTED
    assert not any("arm first" in text for text in robot.texts())


@pytest.mark.parametrize(("x", "y"), [(21.0, 0.0), (0.0, 21.0), (-21.0, 0.0), (0.0, -21.0)])
def test_a_waypoint_beyond_the_limit_of_either_axis_is_refused(robot: FakeRobot, x: float, y: float) -> None:
    assert robot.ask(USB, waypoint(0, x, y, 0.0)) == mav.MAV_RESULT_DENIED
    assert "waypoint refused: beyond LIM_POS" in robot.texts()


def test_a_path_that_is_a_little_too_fast_is_said_unless_it_is_slowed_down(robot: FakeRobot) -> None:
    change(robot, "TRJ_TYPE", 3.0)
    change(robot, "TRJ_ROT", 0.0)
    change(robot, "TRJ_SIZE", 0.5)
    change(robot, "TRJ_PERIOD", 18.0)
    said = {}
    for scale in (0.0, 1.0):
        change(robot, "TRJ_SCALE", scale)
        robot.look()
        robot.said[USB].clear()
        assert robot.ask(USB, command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1.0, 1.0)) == mav.MAV_RESULT_ACCEPTED
        said[scale] = [text for text in robot.texts() if text.startswith("path too fast for the wheels by ")]
    assert said[1.0] == []
    (text,) = said[0.0]
    assert 1.1 < float(text.rsplit(" ", 1)[1]) < 1.9
