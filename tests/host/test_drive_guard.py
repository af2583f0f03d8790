# SPDX-License-Identifier: MIT
"""Whatever drives from a program ends at once when another station stops the robot, and moves it no more."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from omniwheel.dialect import mavlink
from omniwheel.errors import OmniError, StoppedError
from omniwheel.identification.live import excite
from omniwheel.robot import Robot, connect
from omniwheel.tuning import Experiment
from tests.host import stepped
from tests.host.conftest import FakeRobot
from tests.hub.behind import BehindHub

AFTER_S = 0.5
LONG_S = 30.0
PROGRAM = "omni monitor (9)"
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
STOPS = {
    "disarm": (ARM, 0.0, 0.0),
    "hold": (mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0, 0.0),
    "e-stop": (mavlink.MAV_CMD_OMNI_ESTOP, 1.0, 0.0),
}
DRIVES: dict[str, Callable[[Robot], object]] = {
    "velocity": lambda robot: robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), LONG_S),
    "pose": lambda robot: robot.repeat(lambda: robot.set_pose(1.0, 0.0, 0.0), LONG_S),
    "duty": lambda robot: robot.drive_duty([0.2, 0.2, 0.2], LONG_S),
    "identify": lambda robot: excite(robot, {"run": np.full((1500, 3), 0.2)}, lambda _: None),
    "path": lambda robot: follow_rose(robot),
    "tune": lambda robot: Experiment(robot).step("x", 0.1, LONG_S),
}
SELF_ARMING = ("identify", "tune")
START = mavlink.MAV_CMD_OMNI_TRAJECTORY_START
TAKES_OVER = {"path": (START, 2.0, 1.0), "arm": (ARM, 1.0, 0.0)}
"""Commands of another station that take the command over."""


def follow_rose(robot: Robot) -> None:
    robot.follow_trajectory("rose", timeout_s=LONG_S)


class Another:
    """Another station on the same line, which stops the robot half a second after it has armed.

    With a hub it is another program there. To the robot it is the same station: all of ours have the same ids.
    """

    def __init__(self, robot: Robot, stop: str) -> None:
        self.stopped_s: float | None = None
        self._robot, self._stop = robot, {**STOPS, **TAKES_OVER}[stop]
        self._is_station = stop in TAKES_OVER
        self._codec = mavlink.MAVLink(None, 254, 190)
        link = robot.connection.link
        self._write: Callable[[bytes], object] = link.write
        if isinstance(link, BehindHub):
            hub, number = link.hub, link.hub.join(PROGRAM)
            self._codec = mavlink.MAVLink(None, 255, 190)
            self._write = lambda frame: hub.from_client(number, bytes(frame))
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
            beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
            for message in [beat, command] if self._is_station else [command]:
                self._write(message.pack(self._codec))


@pytest.fixture
def robot() -> Iterator[Robot]:
    with stepped.robot(end_s=120.0) as url, stepped.connect(url) as robot:
        yield robot


@pytest.fixture
def behind_hub() -> Iterator[Robot]:
    with stepped.robot(end_s=120.0) as url:
        link = BehindHub(stepped.connect(url).connection.link, "omni drive (1)")
        with connect(link, clock=link.clock_s) as robot:
            yield robot


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(("link", "who"), [("robot", "254/190"), ("behind_hub", PROGRAM)])
def test_a_drive_that_another_station_stops_is_over(
    request: pytest.FixtureRequest, link: str, who: str, drive: str, stop: str
) -> None:
    robot: Robot = request.getfixturevalue(link)
    another = Another(robot, stop)
    if drive not in SELF_ARMING:
        robot.arm()
    with pytest.raises(OmniError) as caught:
        DRIVES[drive](robot)
    assert isinstance(caught.value, StoppedError) or isinstance(caught.value.__cause__, StoppedError)
    assert another.stopped_s is not None
    assert robot.connection.clock() - another.stopped_s < 1.5
    assert who in str(caught.value)
    if stop != "hold":
        robot.pump(0.5)
        assert not robot.status.armed


@pytest.mark.parametrize("command", TAKES_OVER)
@pytest.mark.parametrize("drive", DRIVES)
def test_a_drive_that_another_station_takes_over_is_over(robot: Robot, drive: str, command: str) -> None:
    another = Another(robot, command)
    if drive not in SELF_ARMING:
        robot.arm()
    with pytest.raises(OmniError) as caught:
        DRIVES[drive](robot)
    assert isinstance(caught.value, StoppedError) or isinstance(caught.value.__cause__, StoppedError)
    assert another.stopped_s is not None
    assert robot.connection.clock() - another.stopped_s < 1.5
    assert "254/190" in str(caught.value)


def test_a_program_that_takes_the_command_back_drives_on(robot: Robot) -> None:
    """The robot tells everybody of it, this program too."""
    another = Another(robot, "path")
    robot.arm()
    with pytest.raises(StoppedError):
        robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), LONG_S)
    assert another.stopped_s is not None
    robot.start_trajectory("circle")
    robot.pump(1.0)
    robot.guard.check()
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 1.0)


def test_setpoints_may_be_sent_before_arming(robot: Robot) -> None:
    robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 0.5)
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 1.0)
    assert robot.status.armed


ARMED_STATE, FAILSAFE_STATE = 2, 3


def status_of(state: int) -> Any:
    return mavlink.MAVLink_omni_status_message(0, 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0, state, 0)


def heartbeat(*, armed: bool) -> Any:
    mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return mavlink.MAVLink_heartbeat_message(10, mavlink.MAV_AUTOPILOT_GENERIC, mode, 0, 3, 3)


def test_what_the_robot_said_before_it_was_armed_is_no_stop(fake: FakeRobot) -> None:
    """A radio brings the state every five seconds: what is known then is the failsafe from before."""
    with connect(fake, clock=fake.clock) as robot:
        fake.send(status_of(FAILSAFE_STATE))
        robot.pump(0.1)
        assert robot.status.state == "failsafe"
        robot.arm()
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 1.0)
        fake.send(status_of(FAILSAFE_STATE))
        with pytest.raises(StoppedError):
            robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 1.0)


def test_a_new_arming_begins_a_new_drive(robot: Robot) -> None:
    Another(robot, "disarm")
    robot.arm()
    with pytest.raises(StoppedError):
        robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), LONG_S)
    robot.pump(1.0)
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 1.0)
    assert robot.status.armed


@pytest.mark.parametrize("link", ["robot", "behind_hub"])
def test_a_failsafe_is_nobodys_stop(request: pytest.FixtureRequest, link: str) -> None:
    """The hub says at once that nobody commands any more: that is a consequence."""
    robot: Robot = request.getfixturevalue(link)
    robot.arm()
    robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 1.0)
    with pytest.raises(StoppedError) as caught:
        robot.repeat(lambda: None, 5.0)
    assert robot.status.safety is not None
    faults = robot.status.safety.fault_history
    assert faults
    assert all(fault in str(caught.value) for fault in faults)


def test_a_failsafe_is_none_either_if_the_safety_state_comes_late(fake: FakeRobot) -> None:
    """As over a radio: the heartbeat says first that the robot is not armed."""
    with connect(fake, clock=fake.clock) as robot:
        robot.arm()
        fake._next_heartbeat_s = float("inf")  # its own say that it is not armed
        fake.send(heartbeat(armed=True))
        fake.send(status_of(ARMED_STATE))
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 1.0)
        fake.send(heartbeat(armed=False))
        late_s = fake.now_s + 0.6

        def drive() -> None:
            if fake.now_s > late_s:
                fake.send(status_of(FAILSAFE_STATE))

        with robot.connection.repeating(drive, 0.1), pytest.raises(StoppedError, match="failsafe"):
            robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 2.0)


LEAD_IN, ON_PATH, DONE = 1, 2, 3


def tracking_of(phase: int, path_s: float) -> Any:
    zero = [0.0, 0.0, 0.0]
    return mavlink.MAVLink_omni_tracking_message(0, zero, zero, zero, zero, path_s, phase)


@pytest.mark.parametrize("another_begins", [False, True])
def test_another_path_is_noticed_even_if_the_text_that_says_so_was_lost(fake: FakeRobot, another_begins: bool) -> None:
    own = [(LEAD_IN, 0.0), *((ON_PATH, 0.2 * number) for number in range(10))]
    others = [(LEAD_IN, 0.0), (ON_PATH, 0.2)] if another_begins else []
    said = iter([*own, *others, (DONE, 3.0), (DONE, 3.0)])
    phases: list[str] = []
    with connect(fake, clock=fake.clock) as robot:
        robot.arm()
        read = fake.read

        def read_and_say(timeout_s: float) -> bytes:
            if robot.status.tracking is None or fake.now_s > next_s[0]:
                next_s[0] = fake.now_s + 0.1
                if (words := next(said, None)) is not None:
                    fake.send(tracking_of(*words))
            return read(timeout_s)

        next_s = [fake.now_s]
        fake.read = read_and_say  # type: ignore[method-assign]
        follow = partial(
            robot.follow_trajectory, "rose", timeout_s=LONG_S, progress=lambda tracking: phases.append(tracking.phase)
        )
        if another_begins:
            with pytest.raises(StoppedError):
                follow()
        else:
            follow()
            assert phases[-1] == "done"


def test_another_program_that_has_taken_the_command_ends_a_drive(behind_hub: Robot) -> None:
    """Its own program was silent for so long that the hub gave the command away."""
    link = behind_hub.connection.link
    assert isinstance(link, BehindHub)
    behind_hub.parameters.download()
    behind_hub.parameters.set_many({"SAFE_CMD_TO": 30.0, "SAFE_LINK_TO": 30.0})
    behind_hub.arm()
    behind_hub.repeat(lambda: behind_hub.set_velocity(0.0, 0.0, 0.0), 1.0)
    other, codec = link.hub.join(PROGRAM), mavlink.MAVLink(None, 255, 190)
    with behind_hub.connection.without_heartbeats():
        behind_hub.pump(4.0)
    arm = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1.0, *[0.0] * 6)
    link.hub.from_client(other, bytes(arm.pack(codec)))
    with pytest.raises(StoppedError, match="omni monitor"):
        behind_hub.repeat(lambda: behind_hub.set_velocity(0.1, 0.0, 0.0), 1.0)
