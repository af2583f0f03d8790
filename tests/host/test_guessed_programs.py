# SPDX-License-Identifier: MIT
"""What somebody who has read only help(omniwheel) types, and where it misled or failed."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any

import pytest

import omniwheel
from omniwheel import StoppedError, robot_base, sync
from omniwheel.errors import DriveError, LinkTimeoutError, OmniError, SetpointError, UnknownParameterError
from omniwheel.simulation import SimulatedRobot
from omniwheel.telemetry import Tracking


@pytest.fixture
def robot() -> Iterator[SimulatedRobot]:
    with sync.simulate("fast_three_wheel") as robot:
        robot.arm()
        yield robot


@pytest.mark.parametrize("limits", [{}, {"LIM_A": 0.5}])
def test_a_drive_without_a_speed_does_not_pass_its_goal(robot: SimulatedRobot, limits: dict[str, float]) -> None:
    robot.disarm()
    robot.parameters.set_many(limits)
    robot.arm()
    true: list[float] = []
    way = robot.drive_to(1.0, 0.0, progress=lambda _: true.append(robot.simulation.true_pose.x))
    assert max(true) < 1.01
    assert way.overshoot_m < 0.005
    assert repr(way).count("\n") == 0


def test_the_goal_is_held_not_the_place_of_arrival(robot: SimulatedRobot) -> None:
    robot.turn_to(math.pi / 2)
    robot.sleep(3.0)
    assert robot.pose.theta == pytest.approx(math.pi / 2, abs=2e-3)
    tracking = robot.wait_for(Tracking)
    assert tracking.reference.theta == pytest.approx(math.pi / 2, abs=1e-4)
    assert robot.state == "armed"


def test_the_state_agrees_with_what_the_robot_has_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_base, "SEEN_S", 30.0)
    with omniwheel.simulate() as robot:
        for _ in range(5):
            robot.arm()
            assert (robot.armed, robot.status.armed) == (True, True)
            robot.disarm()
            assert not robot.armed
            robot.estop()
            assert robot.state == "estop"
            robot.estop_clear()
            assert robot.state == "disarmed"


def test_after_an_emergency_stop_the_way_back_is_named(robot: SimulatedRobot) -> None:
    robot.estop()
    with pytest.raises(DriveError) as caught:
        robot.drive_to(1.0, 0.0)
    assert "estop_clear" in caught.value.hint


@pytest.mark.parametrize("end", ["estop", "stop", "hold", "disarm", "velocity"])
def test_a_stopped_motion_names_what_stopped_it(end: str) -> None:
    with omniwheel.simulate() as robot:
        robot.arm()
        begun = threading.Event()
        failed: list[BaseException] = []

        def drive() -> None:
            try:
                robot.drive(0.1, 0.0, 0.0, 30.0, progress=lambda _: begun.set())
            except OmniError as error:
                failed.append(error)

        thread = threading.Thread(target=drive)
        thread.start()
        assert begun.wait(20.0)
        getattr(robot, end)(*([0.1, 0.0, 0.0] if end == "velocity" else []))
        thread.join(20.0)
        (error,) = failed
        assert isinstance(error, StoppedError)
        assert ("another motion" if end == "velocity" else f"robot.{end}()") in error.reason


MOTIONS: dict[str, Callable[[SimulatedRobot], object]] = {
    "drive_to": lambda robot: robot.drive_to(1.0, 0.0),
    "drive_to at a speed": lambda robot: robot.drive_to(1.0, 0.0, speed=0.2),
    "turn_to": lambda robot: robot.turn_to(1.0),
    "follow": lambda robot: robot.follow([(0.0, 0.0), (0.5, 0.2), (1.0, 0.0)]),
    "drive": lambda robot: robot.drive(0.2, 0.0, 0.0, 5.0),
    "velocity": lambda robot: robot.velocity(0.2, 0.0, 0.0),
}


@pytest.mark.parametrize("end", ["estop", "disarm", "stop", "hold"])
@pytest.mark.parametrize("motion", list(MOTIONS.values()), ids=list(MOTIONS))
def test_a_stop_between_the_request_and_its_first_setpoint_ends_it(
    robot: SimulatedRobot, motion: Callable[[SimulatedRobot], object], end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As from another thread, whose stop comes when the motion has seen that the robot is armed."""
    required = robot._require_armed

    def stopped_behind_it() -> int:
        stops = required()
        getattr(robot, end)()
        return stops

    monkeypatch.setattr(robot, "_require_armed", stopped_behind_it)
    with pytest.raises(StoppedError) as caught:
        motion(robot)
    assert f"robot.{end}()" in caught.value.reason
    robot.sleep(1.0)  # each of the motions would be 0.1 m or 0.1 rad away by then
    pose = robot.simulation.true_pose
    assert math.hypot(pose.x, pose.y) < 0.02
    assert abs(pose.theta) < 0.02


@pytest.mark.parametrize("answered", [True, False])
@pytest.mark.parametrize("end", ["estop", "disarm"])
def test_a_motion_that_begins_while_the_stop_is_on_its_way_is_over(
    robot: SimulatedRobot, end: str, answered: bool
) -> None:
    send = robot.commands.send

    def begun_meanwhile(*arguments: Any, **named: Any) -> None:
        robot.commands.send = send  # type: ignore[method-assign]
        robot.velocity(0.2, 0.0, 0.0)
        if not answered:
            raise LinkTimeoutError("no answer")
        send(*arguments, **named)

    robot.commands.send = begun_meanwhile  # type: ignore[method-assign]
    with nullcontext() if answered else pytest.raises(LinkTimeoutError):
        getattr(robot, end)()
    assert not robot.connection.end_repeating(robot._stream)


@pytest.mark.parametrize("kind", ["Battery", None, int])
def test_only_a_class_of_telemetry_can_be_listened_to(robot: SimulatedRobot, kind: Any) -> None:
    with pytest.raises(SetpointError):
        robot.on(kind, print)
    with pytest.raises(SetpointError):
        next(robot.telemetry(kind))
    robot.drive_to(0.05, 0.0)


WRONG: dict[str, Callable[[SimulatedRobot], object]] = {
    "text": lambda robot: robot.drive_to("a", 0.0),  # type: ignore[arg-type]
    "none": lambda robot: robot.turn_to(None),  # type: ignore[arg-type]
    "degrees": lambda robot: robot.turn_to("90deg"),  # type: ignore[arg-type]
    "backwards in time": lambda robot: robot.drive(0.1, 0.0, 0.0, -1.0),
    "no time": lambda robot: robot.drive(0.1, 0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("call", list(WRONG.values()), ids=list(WRONG))
def test_an_argument_that_cannot_be_is_refused_and_nothing_moves(
    robot: SimulatedRobot, call: Callable[[SimulatedRobot], object]
) -> None:
    with pytest.raises(SetpointError):
        call(robot)
    assert math.hypot(*robot.simulation.true_pose[:2]) < 1e-3


def test_parameters_are_changed_for_a_block(robot: SimulatedRobot) -> None:
    before = robot.parameters["ISMC_LAM_XY"]
    seen = []

    def tune() -> None:
        with robot.parameters.changed(ISMC_LAM_XY=before + 1.0):
            seen.append(robot.parameters.read("ISMC_LAM_XY"))
            robot.drive_to("a", 0.0)  # type: ignore[arg-type]

    with pytest.raises(SetpointError):
        tune()
    assert seen == [pytest.approx(before + 1.0)]
    assert robot.parameters.read("ISMC_LAM_XY") == before


def test_a_misspelt_parameter_is_an_error(robot: SimulatedRobot) -> None:
    with pytest.raises(UnknownParameterError):
        robot.parameters.info("LIM_VV")


def test_a_simulation_without_a_with_block_ends_with_close() -> None:
    robot = sync.simulate("fast_three_wheel")
    robot.arm()
    robot.drive_to(0.1, 0.0)
    simulation = robot.simulation
    robot.close()
    with pytest.raises(OmniError):
        robot.sleep(1.0)
    assert simulation.true_pose.x == pytest.approx(0.1, abs=0.01)
