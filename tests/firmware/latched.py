# SPDX-License-Identifier: MIT
"""What holds for a latched emergency stop, wherever it came from."""

from __future__ import annotations

from tests.firmware.client import mav
from tests.firmware.fake_robot import ARM, DISARM, DISARMED, ESTOP, HEARTBEAT, RELEASE, USB, FakeRobot, duty, velocity

ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED


def check_only_a_release_leads_out(robot: FakeRobot, link: int = USB) -> None:
    """Nothing that this link asks for moves a stopped robot; released, it drives."""
    assert robot.state() == ESTOP
    assert robot.ask(link, ARM) == DENIED
    assert robot.ask(link, DISARM) == ACCEPTED
    robot.send(USB, velocity(0.1), duty(0.2))
    robot.tick(5)
    assert robot.state() == ESTOP
    assert not robot.driven()
    for _ in range(3):  # until its wheels have come to rest
        robot.send(USB, HEARTBEAT)
        robot.tick(100)
    assert robot.ask(USB, RELEASE) == ACCEPTED
    robot.tick(5)
    assert robot.state() == DISARMED
    robot.driving(link)
