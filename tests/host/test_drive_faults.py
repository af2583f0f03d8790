# SPDX-License-Identifier: MIT
"""What happens to a program that waits for a drive: the right exception, in time, and the robot at rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from hil_sim.lockstep import SteppedLink
from omniwheel import sync
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkLostError, StoppedError
from omniwheel.simulation import SimulatedRobot

AFTER_S = 1.0
"""The fault comes so long after the drive has begun."""
REST_TICKS = 6000
"""A robot that hears of nobody stops after SAFE_LINK_TO, 3 s."""
REST_M_S, REST_RAD_S = 0.01, 0.02

DRIVES: dict[str, Callable[[SimulatedRobot], object]] = {
    "drive_to": lambda robot: robot.drive_to(3.0, 1.0),
    "drive_to with a speed": lambda robot: robot.drive_to(3.0, 1.0, speed=0.3),
    "turn_to": lambda robot: [robot.turn_to(heading) for heading in (1.5, 3.0, -1.5) * 10],
    "drive": lambda robot: robot.drive(0.2, 0.0, 0.3, duration=30.0),
    "follow": lambda robot: robot.follow([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)], speed=0.3),
    "follow_trajectory": lambda robot: robot.follow_trajectory("circle"),
    "velocity": lambda robot: drive_on_and_back(robot),
}


def drive_on_and_back(robot: SimulatedRobot) -> None:
    """Use a motion that nobody waits for; the next one says what became of it."""
    robot.velocity(0.2, 0.0, 0.0)
    robot.sleep(4.0)
    robot.hold()
    robot.drive_to(0.0, 0.0)


def pull_the_cable(robot: SimulatedRobot) -> None:
    def read(timeout_s: float) -> bytes:
        raise LinkLostError("lost the serial port", hint="was it unplugged?")

    robot.connection.link.read = read  # type: ignore[method-assign]


def stop_from_another_program(robot: SimulatedRobot) -> None:
    """Press the emergency stop at another station on the same line."""
    codec = mavlink.MAVLink(None, 254, 190)
    target = (robot.connection.target_system, robot.connection.target_component)
    stop = mavlink.MAVLink_command_long_message(*target, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1.0, *[0.0] * 6)
    robot.connection.link.write(stop.pack(codec))


def interrupt(_: SimulatedRobot) -> None:
    raise KeyboardInterrupt


def end_the_firmware(robot: SimulatedRobot) -> None:
    robot.simulation.firmware.stop()


@dataclass(frozen=True)
class Trouble:
    """A fault, the exception it ends a drive with, and within which time [s] of simulation."""

    happens: Callable[[SimulatedRobot], None]
    error: type[BaseException]
    within_s: float


FAULTS = {
    "pulled cable": Trouble(pull_the_cable, LinkLostError, 0.2),
    "emergency stop of another program": Trouble(stop_from_another_program, StoppedError, 1.5),
    "encoder fault": Trouble(lambda robot: robot.simulation.fault("encoder_stuck", wheel=1), StoppedError, 3.0),
    "Ctrl-C": Trouble(interrupt, KeyboardInterrupt, 2.0),
    "restart": Trouble(end_the_firmware, LinkLostError, 0.2),
}


@pytest.fixture
def robot() -> Iterator[SimulatedRobot]:
    with sync.simulate() as robot:
        robot.arm()
        yield robot


def let_happen(robot: SimulatedRobot, trouble: Trouble) -> Callable[[], float]:
    """Have a fault happen a while after now; the returned function says when it did."""
    link = robot.connection.link
    read, due_s = link.read, robot.simulation.time_s + AFTER_S
    happened: list[float] = []

    def read_or_fail(timeout_s: float) -> bytes:
        if not happened and robot.simulation.time_s >= due_s:
            happened.append(robot.simulation.time_s)
            trouble.happens(robot)
        return read(timeout_s)

    link.read = read_or_fail  # type: ignore[method-assign]
    return lambda: happened[0]


def let_time_pass(robot: SimulatedRobot) -> None:
    """Let the world go on without the program."""
    link = robot.simulation.link
    assert isinstance(link, SteppedLink)
    link.run(REST_TICKS, link.drop_received)


@pytest.mark.full
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("drive", DRIVES)
def test_a_fault_ends_a_drive_with_its_exception_and_the_robot_at_rest(
    robot: SimulatedRobot, drive: str, fault: str
) -> None:
    trouble = FAULTS[fault]
    happened_s = let_happen(robot, trouble)
    with pytest.raises(trouble.error):
        DRIVES[drive](robot)
    ended_s = robot.simulation.time_s
    assert ended_s - happened_s() < trouble.within_s + (4.0 if drive == "velocity" else 0.0)
    if fault == "Ctrl-C" and drive != "velocity":
        assert robot.armed, "the program may go on"
    if fault != "restart":
        let_time_pass(robot)
        vx, vy, wz = robot.simulation.true_twist
        assert math.hypot(vx, vy) < REST_M_S
        assert abs(wz) < REST_RAD_S
