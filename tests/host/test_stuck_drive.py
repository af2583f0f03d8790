# SPDX-License-Identifier: MIT
"""A motion of a robot that stands although it should not, or says nothing any more, ends long before its deadline."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from omniwheel.dialect import mavlink
from omniwheel.errors import LinkTimeoutError, NotArrivedError
from omniwheel.motion_watch import SILENT_S, STUCK_S
from omniwheel.robot import Robot, connect
from tests.host.conftest import FakeRobot

TRACKING_S = 0.1
FAR_S = 1000.0


class StandingRobot(FakeRobot):
    """Armed, at the origin; ``reference_m`` is where it should be, ``step_m`` how far it comes per message."""

    def __init__(self) -> None:
        super().__init__()
        self.reference_m, self.x_m, self.step_m = 0.0, 0.0, 0.0
        self._next_tracking_s = 0.0

    def heartbeat(self) -> None:
        kind, autopilot = mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_GENERIC
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED | mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self.send(mavlink.MAVLink_heartbeat_message(kind, autopilot, armed, 0, mavlink.MAV_STATE_ACTIVE, 3))

    def read(self, timeout_s: float) -> bytes:
        if self.now_s >= self._next_tracking_s:
            self._next_tracking_s += TRACKING_S
            self.x_m += self.step_m
            zeros, pose = [0.0] * 3, [self.x_m, 0.0, 0.0]
            reference = [self.reference_m, 0.0, 0.0]
            self.send(
                mavlink.MAVLink_omni_tracking_message(
                    round(self.now_s * 1e3), reference, zeros, pose, [0.001] * 3, 0.0, 0
                )
            )
        return super().read(timeout_s)

    def _answer(self, message: Any) -> None:
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            self.reference_m = message.x
        super()._answer(message)


@pytest.fixture
def fake() -> StandingRobot:
    return StandingRobot()


def test_a_robot_that_stands_while_its_reference_is_elsewhere_is_stuck(fake: StandingRobot, robot: Robot) -> None:
    with pytest.raises(NotArrivedError):
        robot.drive_to(1.0, 0.0, timeout_s=FAR_S)
    assert STUCK_S < fake.now_s < 2.0 * STUCK_S + 5.0


def test_a_robot_that_creeps_is_not_stuck(fake: StandingRobot, robot: Robot) -> None:
    fake.step_m = 1e-3
    assert robot.drive_to(0.1, 0.0, timeout_s=FAR_S).duration_s > STUCK_S


MOTIONS: dict[str, Callable[[Robot], object]] = {
    "drive": lambda robot: robot.drive(0.01, 0.0, 0.0, FAR_S),
    "drive_to": lambda robot: robot.drive_to(1.0, 0.0, timeout_s=FAR_S),
    "turn_to": lambda robot: robot.turn_to(1.0, timeout_s=FAR_S),
    "follow": lambda robot: robot.follow([(0.0, 0.0), (1.0, 0.0)], speed=0.1),
}


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_robot_that_falls_silent_ends_a_motion(fake: StandingRobot, motion: str) -> None:
    with connect(fake, clock=fake.clock) as robot:
        robot.parameters.download()
        begin_s = fake.now_s

        def read(timeout_s: float) -> bytes:
            fake.silent = fake.now_s > begin_s + 1.0
            return FakeRobot.read(fake, timeout_s) if fake.silent else StandingRobot.read(fake, timeout_s)

        fake.read = read  # type: ignore[method-assign]
        with pytest.raises(LinkTimeoutError):
            MOTIONS[motion](robot)
        assert fake.now_s < begin_s + 1.0 + 2.0 * SILENT_S
