# SPDX-License-Identifier: MIT
"""Two programs on one robot, in simulated time: who ends whose drive, and what never moves the robot again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from omniwheel import sync
from omniwheel.dialect import mavlink
from omniwheel.errors import StoppedError
from omniwheel.simulation import SimulatedRobot
from omniwheel.telemetry import Tracking

ARM, ESTOP, HOLD = (
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_OMNI_ESTOP,
    mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP,
)
NEAR_M = 0.01
COAST_S = 3.0
PATH = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]
DRIVES: dict[str, Callable[[SimulatedRobot], object]] = {
    "drive": lambda robot: robot.drive(0.1, 0.0, 0.0, duration=6.0),
    "drive_to": lambda robot: robot.drive_to(2.0, 0.0, speed=0.1),
    "turn_to": lambda robot: [robot.turn_to(heading) for heading in (1.5, 3.0, -1.5) * 10],
    "follow": lambda robot: robot.follow(PATH, speed=0.2),
    "follow_trajectory": lambda robot: robot.follow_trajectory("circle"),
    "repeat": lambda robot: robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 6.0),
    "drive_duty": lambda robot: robot.drive_duty([0.0, 0.1, -0.1], 6.0),
    "velocity": lambda robot: drive_on(robot),
}


def drive_on(robot: SimulatedRobot) -> None:
    """Use a motion that nobody waits for; the next one says what became of it."""
    robot.velocity(0.1, 0.0, 0.0)
    robot.sleep(3.0)
    robot.drive(0.1, 0.0, 0.0, 1.0)


class OtherStation:
    """Station 254 on the same line, with a heartbeat each second."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._codec: Any = mavlink.MAVLink(None, 254, 190)
        self._due: list[tuple[float, Callable[[], None]]] = []
        link = robot.connection.link
        read = link.read

        def read_and_act(timeout_s: float) -> bytes:
            while self._due and self._due[0][0] <= robot.simulation.time_s:
                self._due.pop(0)[1]()
            return read(timeout_s)

        link.read = read_and_act  # type: ignore[method-assign]
        self.beat()

    def send(self, message: Any) -> None:
        self._robot.connection.link.write(message.pack(self._codec))

    def beat(self) -> None:
        gcs, invalid = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
        self.send(mavlink.MAVLink_heartbeat_message(gcs, invalid, 0, 0, mavlink.MAV_STATE_ACTIVE, 3))
        self._due.append((self._robot.simulation.time_s + 1.0, self.beat))
        self._due.sort(key=lambda due: due[0])

    def command(self, number: int, first: float = 0.0) -> None:
        system = self._robot.connection.target_system
        self.send(mavlink.MAVLink_command_long_message(system, 1, number, 0, first, *[0.0] * 6))

    def velocity(self, vx: float) -> None:
        system, mask = self._robot.connection.target_system, 0b010111000111
        frame = mavlink.MAV_FRAME_BODY_FRD
        numbers = (0.0, 0.0, 0.0, vx, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        self.send(mavlink.MAVLink_set_position_target_local_ned_message(0, system, 1, frame, mask, *numbers))

    def after(self, seconds: float, action: Callable[[], None]) -> None:
        self._due.append((self._robot.simulation.time_s + seconds, action))
        self._due.sort(key=lambda due: due[0])


@pytest.fixture
def robot() -> Iterator[SimulatedRobot]:
    with sync.simulate() as robot:
        yield robot


@pytest.fixture
def other(robot: SimulatedRobot) -> OtherStation:
    return OtherStation(robot)


def moved_m(robot: SimulatedRobot, seconds: float) -> float:
    before = robot.simulation.true_pose
    robot.sleep(seconds)
    return math.dist(before[:2], robot.simulation.true_pose[:2])


@pytest.mark.full
@pytest.mark.parametrize("stop", [(ARM, 0.0), (ESTOP, 1.0), (HOLD, 0.0)])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_drive_of_a_robot_that_another_station_armed_ends_when_that_one_ends_it(
    robot: SimulatedRobot, other: OtherStation, drive: str, stop: tuple[int, float]
) -> None:
    other.command(ARM, 1.0)
    robot.wait_until(lambda status: status.armed, 2.0, "armed")
    other.after(2.5, lambda: other.command(*stop))
    with pytest.raises(StoppedError):
        DRIVES[drive](robot)
    robot.sleep(COAST_S)
    assert moved_m(robot, 1.0) < NEAR_M
    assert not robot.armed_here


@pytest.mark.full
def test_arming_again_does_not_go_on_with_an_old_velocity(robot: SimulatedRobot, other: OtherStation) -> None:
    robot.arm()
    robot.velocity(0.2, 0.0, 0.0)
    robot.sleep(1.0)
    other.command(ARM, 0.0)
    robot.connection.wait(lambda m: m.get_type() == "HEARTBEAT" and not robot.status.armed, 2.0)
    robot.arm()
    assert moved_m(robot, 2.0) < NEAR_M
    assert robot.state == "armed"
    robot.drive(0.1, 0.0, 0.0, 0.5)


@pytest.mark.full
def test_arming_an_armed_robot_ends_its_velocity_and_holds(robot: SimulatedRobot) -> None:
    robot.arm()
    robot.velocity(0.2, 0.0, 0.0)
    robot.sleep(1.0)
    robot.arm()
    robot.sleep(0.5)
    assert moved_m(robot, 2.0) < NEAR_M
    assert robot.state == "armed"


@pytest.mark.full
@pytest.mark.parametrize("last", ["stop", "hold"])
def test_a_stop_ends_the_drive_of_a_station_that_took_over(
    robot: SimulatedRobot, other: OtherStation, last: str
) -> None:
    robot.arm()
    for _ in range(20):
        other.velocity(0.2)
        robot.sleep(0.1)
    assert moved_m(robot, 0.1) > NEAR_M
    getattr(robot, last)()
    robot.sleep(0.5)
    assert moved_m(robot, 1.0) < NEAR_M


ENDS: dict[str, Callable[[SimulatedRobot], object]] = {
    "stop_trajectory": lambda robot: robot.stop_trajectory(),
    "set_velocity": lambda robot: robot.set_velocity(0.0, 0.0, 0.0),
    "repeat": lambda robot: robot.repeat(lambda: robot.set_velocity(0.0, 0.1, 0.0), 1.0),
    "set_duty": lambda robot: robot.set_duty([0.0, 0.0, 0.0]),
}


@pytest.mark.full
@pytest.mark.parametrize("end", ENDS)
def test_what_a_program_asks_for_ends_what_velocity_repeats(robot: SimulatedRobot, end: str) -> None:
    robot.arm()
    robot.velocity(0.2, 0.0, 0.0)
    robot.sleep(1.0)
    ENDS[end](robot)
    robot.sleep(1.0)
    assert moved_m(robot, 2.0) < NEAR_M


@pytest.mark.full
def test_a_trajectory_takes_the_place_of_a_velocity(robot: SimulatedRobot) -> None:
    robot.arm()
    robot.velocity(0.1, 0.0, 0.0)
    robot.sleep(1.0)
    robot.start_trajectory("circle")
    robot.sleep(2.0)
    assert robot.status.mode == "trajectory"


@pytest.mark.full
@pytest.mark.parametrize("drive", [name for name in DRIVES if name not in ("velocity", "repeat", "drive_duty")])
def test_a_callback_that_always_fails_ends_a_drive_once_with_the_robot_at_rest(
    robot: SimulatedRobot, drive: str
) -> None:
    robot.arm()
    robot.on(Tracking, lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        DRIVES[drive](robot)
    robot.stop()
    before = robot.simulation.true_pose
    robot.connection.pump_quietly(1.0)
    assert math.dist(before[:2], robot.simulation.true_pose[:2]) < NEAR_M
    robot.disarm()
    assert not robot.status.armed


def test_ctrl_c_while_a_program_sleeps_ends_its_velocity(robot: SimulatedRobot) -> None:
    robot.arm()
    robot.velocity(0.2, 0.0, 0.0)
    link = robot.connection.link
    read, due_s = link.read, robot.simulation.time_s + 1.0

    def interrupt(timeout_s: float) -> bytes:
        if robot.simulation.time_s >= due_s:
            link.read = read  # type: ignore[method-assign]
            raise KeyboardInterrupt
        return read(timeout_s)

    link.read = interrupt  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        robot.sleep(10.0)
    assert moved_m(robot, 1.0) < NEAR_M
    assert robot.state == "armed"
