# SPDX-License-Identifier: MIT
"""OMNI_FLOW: what a robot tells of its sensor of motion over the floor, as the guide to its scale needs it."""

from __future__ import annotations

from typing import Any

import pytest

from omniwheel.telemetry import FlowState
from tests.host.bringup.conftest import MakeBench


def test_a_drive_of_known_length_tells_scale_and_direction(make_bench: MakeBench) -> None:
    """The sensor reads 3 % too little and is turned by 5 degrees more than it was told."""

    def change(config: Any) -> None:
        config.flow_rate_Hz = 50.0
        config.flow_scale_error = -0.03
        config.flow_angle_rad = 0.0873

    bench = make_bench(on_floor=True, change=change, parameters={"FLOW_MODE": 2.0, "CTL_MODE": 0.0})
    robot, world = bench.robot, bench.world
    robot.set_message_interval("OMNI_FLOW", 20)
    first = robot.wait_for(FlowState)
    assert first.usable
    start = list(world.c.pose)
    robot.arm()
    robot.drive_velocity(0.15, 0.0, 0.0, 4.0)
    robot.disarm()
    robot.pump(1.0)
    last = robot.wait_for(FlowState)
    way = float(world.c.pose[0]) - start[0]
    assert way > 0.5
    x, y = last.x_m - first.x_m, last.y_m - first.y_m
    assert x == pytest.approx(0.97 * way, rel=0.01)
    assert y / x == pytest.approx(-0.0873, abs=0.01), "it says that the robot went aside the other way"
    assert last.turn_rad - first.turn_rad == pytest.approx(float(world.c.pose[2]) - start[2], abs=5e-3)
    assert last.readings_used + last.readings_refused > 100
    robot.set_message_interval("OMNI_FLOW", None)


def test_a_robot_that_has_none_tells_nothing_of_it(make_bench: MakeBench) -> None:
    bench = make_bench(on_floor=True)
    bench.robot.set_message_interval("OMNI_FLOW", 20)
    state = bench.robot.wait_for(FlowState)
    assert (state.x_m, state.readings_used, state.readings_refused, state.usable) == (0.0, 0, 0, False)
