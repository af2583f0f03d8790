# SPDX-License-Identifier: MIT
"""A parameter that has nothing to do with the motors' wires leaves the motors as they are."""

from __future__ import annotations

from tests.firmware.client import mav
from tests.firmware.fake_robot import USB, FakeRobot, duty, frame


def test_motors_keep_turning_while_another_parameter_changes() -> None:
    robot = FakeRobot()
    try:
        robot.driving()
        robot.send(USB, frame("param_set", 1, 1, b"LIM_V", 0.3, mav.MAV_PARAM_TYPE_REAL32))
        for _ in range(30):
            robot.send(USB, duty(0.3))
            robot.tick()
            assert robot.driven()
        robot.look()
        values = [m for m in robot.said[USB] if m.get_type() == "PARAM_VALUE" and m.param_id == "LIM_V"]
        assert abs(values[-1].param_value - 0.3) < 1e-6
    finally:
        robot.close()
