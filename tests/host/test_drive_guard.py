# SPDX-License-Identifier: MIT
"""Whatever drives from a program ends at once when another station stops the robot, and moves it no more."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from omniwheel import Robot, connect
from omniwheel.cli.drive import _until_done
from omniwheel.dialect import mavlink
from omniwheel.errors import OmniError, StoppedError
from omniwheel.identification.live import excite
from omniwheel.tuning import Experiment
from tests.host import stepped
from tests.host.conftest import FakeRobot

AFTER_S = 0.5
LONG_S = 30.0
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
STOPS = {
    "disarm": (ARM, 0.0, 0.0),
    "hold": (mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0, 0.0),
    "e-stop": (mavlink.MAV_CMD_OMNI_ESTOP, 1.0, 0.0),
}
DRIVES: dict[str, Callable[[Robot], object]] = {
    "velocity": lambda robot: robot.drive_velocity(0.1, 0.0, 0.0, LONG_S),
    "pose": lambda robot: robot.drive_pose(1.0, 0.0, 0.0, LONG_S),
    "duty": lambda robot: robot.drive_duty([0.2, 0.2, 0.2], LONG_S),
    "identify": lambda robot: excite(robot, {"run": np.full((1500, 3), 0.2)}, lambda _: None),
    "path": lambda robot: follow_rose(robot),
    "tune": lambda robot: Experiment(robot).step("x", 0.1, LONG_S),
}
SELF_ARMING = ("identify", "tune")


def follow_rose(robot: Robot) -> None:
    robot.start_trajectory("rose")
    _until_done(robot, LONG_S, quiet=True)


class Another:
    """Another station on the same line, which stops the robot half a second after it has armed."""

    def __init__(self, robot: Robot, stop: str) -> None:
        self.stopped_s: float | None = None
        self._robot, self._stop = robot, STOPS[stop]
        self._codec = mavlink.MAVLink(None, 254, 190)
        self._armed_s: float | None = None
        robot.connection.add_listener(self._hear)

    def _hear(self, _message: Any) -> None:
        now_s = self._robot.connection.clock()
        if self._armed_s is None:
            self._armed_s = now_s if self._robot.status.armed else None
        elif self.stopped_s is None and now_s - self._armed_s > AFTER_S:
            self.stopped_s = now_s
            connection = self._robot.connection
            target = (connection.target_system, connection.target_component)
            command = mavlink.MAVLink_command_long_message(*target, self._stop[0], 0, *self._stop[1:], *[0.0] * 5)
            connection.link.write(command.pack(self._codec))


@pytest.fixture
def robot() -> Iterator[Robot]:
    with stepped.robot(end_s=120.0) as url, stepped.connect(url) as robot:
        yield robot


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("drive", DRIVES)
def test_a_drive_that_another_station_stops_is_over(robot: Robot, drive: str, stop: str) -> None:
    another = Another(robot, stop)
    if drive not in SELF_ARMING:
        robot.arm()
    with pytest.raises(OmniError) as caught:
        DRIVES[drive](robot)
    assert isinstance(caught.value, StoppedError) or isinstance(caught.value.__cause__, StoppedError)
    assert another.stopped_s is not None
    assert robot.connection.clock() - another.stopped_s < 1.5
    assert "254/190" in str(caught.value)
    if stop != "hold":
        robot.pump(0.5)
        assert not robot.status.armed


def test_set_points_may_be_sent_before_arming(robot: Robot) -> None:
    robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 0.5)
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 1.0)
    assert robot.status.armed


def status_of(state: int) -> Any:
    return mavlink.MAVLink_omni_status_message(0, 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, state, 0)


def test_what_the_robot_said_before_it_was_armed_is_no_stop(fake: FakeRobot) -> None:
    """A radio brings the state every five seconds: what is known then is the failsafe from before."""
    with connect(fake, clock=fake.clock) as robot:
        fake.send(status_of(3))
        robot.pump(0.1)
        assert robot.status.state == "failsafe"
        robot.arm()
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 1.0)
        fake.send(status_of(3))
        with pytest.raises(StoppedError):
            robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 1.0)


def test_a_new_arming_begins_a_new_drive(robot: Robot) -> None:
    Another(robot, "disarm")
    robot.arm()
    with pytest.raises(StoppedError):
        robot.drive_velocity(0.1, 0.0, 0.0, LONG_S)
    robot.pump(1.0)
    robot.arm()
    robot.drive_velocity(0.1, 0.0, 0.0, 1.0)
    assert robot.status.armed
