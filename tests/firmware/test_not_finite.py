# SPDX-License-Identifier: MIT
"""NaN and infinity in every float of every message that the robot reads, while it drives: it never gets to a motor."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any

import pytest

from tests.firmware.client import ALL_WHEELS, Client, lockstep_robot, mav
from tests.firmware.test_commands import (
    ARM,
    ARMED,
    BODY_FRD,
    DISARMED,
    FAILSAFE,
    LOCAL_NED,
    POSITION_YAW,
    VELOCITY_ONLY,
)

YAW_RATE = 0.2
REFERENCE = YAW_RATE * 0.2632 / 0.0508  # three_wheel.toml
VALUES = (math.nan, math.inf, -math.inf)
COMMANDS = {
    mav.MAV_CMD_OMNI_TRAJECTORY_START: {0, 1, 2},
    mav.MAV_CMD_OMNI_HIL: {0},
    mav.MAV_CMD_OMNI_SET_POSE: {0, 1, 2},
    mav.MAV_CMD_OMNI_WAYPOINT: {0, 1, 2, 3},
    mav.MAV_CMD_DO_SET_MODE: {1},
    mav.MAV_CMD_PREFLIGHT_STORAGE: {0},
    mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: {0},
    mav.MAV_CMD_COMPONENT_ARM_DISARM: {0},
    mav.MAV_CMD_SET_MESSAGE_INTERVAL: {0, 1},
    mav.MAV_CMD_REQUEST_MESSAGE: {0},
}
"""Commands and the parameters that the robot looks at. The emergency stops are in test_stations.py: they stop."""


@dataclass
class Probe:
    """A message: how many floats it takes, how it is sent with them, and which of them the robot looks at."""

    floats: int
    send: Callable[[Client, list[float]], None]
    looked_at: Collection[int]


def target(mask: int, frame: int, looked_at: Collection[int]) -> Probe:
    """X y z, vx vy vz, ax ay az, yaw, yaw rate."""
    return Probe(11, lambda r, f: r.mav.set_position_target_local_ned_send(0, 1, 1, frame, mask, *f), looked_at)


def command_long(number: int) -> Probe:
    return Probe(7, lambda r, f: r.mav.command_long_send(1, 1, number, 0, *f), COMMANDS[number])


def command_int(number: int) -> Probe:
    return Probe(5, lambda r, f: r.mav.command_int_send(1, 1, 0, number, 0, 0, *f[:4], 0, 0, f[4]), COMMANDS[number])


PROBES = {
    "velocity": target(VELOCITY_ONLY, BODY_FRD, {3, 4, 10}),
    "pose": target(POSITION_YAW, LOCAL_NED, {0, 1, 9}),
    "everything": target(0, LOCAL_NED, {0, 1, 3, 4, 9, 10}),
    "duty": Probe(4, lambda r, f: r.mav.omni_setpoint_duty_send(1, 1, f), range(4)),
    "vicon": Probe(27, lambda r, f: r.mav.vicon_position_estimate_send(r.time_us, *f[:6], covariance=f[6:]), range(27)),
    "mocap": Probe(28, lambda r, f: r.mav.att_pos_mocap_send(r.time_us, f[:4], *f[4:7], covariance=f[7:]), range(28)),
    "parameter": Probe(1, lambda r, f: r.mav.param_set_send(1, 1, b"ISMC_LAM_XY", f[0], 9), {0}),
    "locked parameter": Probe(1, lambda r, f: r.mav.param_set_send(1, 1, b"WHEEL_RADIUS", f[0], 9), {0}),
    **{f"command {number}": command_long(number) for number in COMMANDS},
    **{f"command {number} int": command_int(number) for number in COMMANDS},
}


@pytest.fixture(scope="module")
def driving() -> Iterator[Client]:
    """A robot that turns on the spot, and goes on doing so from test to test."""
    with lockstep_robot() as client:
        yield client.armed()


def keep_turning(robot: Client, ticks: int) -> list[Any]:
    robot.heartbeat()
    robot.mav.set_position_target_local_ned_send(
        0, 1, 1, BODY_FRD, VELOCITY_ONLY, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -YAW_RATE
    )
    return robot.ticks(ticks)


def check(ticks: list[Any], tolerance: float) -> None:
    for tick in ticks:
        assert tick.actuators.state == ARMED
        assert all(math.isfinite(value) for value in [*tick.actuators.pose, *tick.actuators.reference])
        assert list(tick.actuators.wheel_reference)[:3] == pytest.approx([REFERENCE] * 3, abs=tolerance)


@pytest.mark.parametrize("name", PROBES)
def test_a_message_with_a_number_that_is_none_changes_nothing(driving: Client, name: str) -> None:
    probe = PROBES[name]
    check(keep_turning(driving, 150)[-1:], 1e-4)
    for at in probe.looked_at:
        for value in VALUES:
            floats = [0.0] * probe.floats
            floats[at] = value
            probe.send(driving, floats)
            check(keep_turning(driving, 2), 0.06)
    check(keep_turning(driving, 150)[-1:], 1e-4)


@pytest.mark.full
@pytest.mark.parametrize("value", VALUES)
def test_a_supply_voltage_that_is_no_number_stops_the_robot_until_it_is_one_again(robot: Client, value: float) -> None:
    robot.armed()
    check(keep_turning(robot, 300)[-1:], 1e-4)
    tick = robot.tick(battery_v=value, valid=ALL_WHEELS)
    assert tick.actuators.state == FAILSAFE
    assert tick.actuators.output_enable == 0
    texts = [m.text for t in [tick, *robot.ticks(3, battery_v=value)] for m in t.others if m.get_type() == "STATUSTEXT"]
    assert "failsafe: not finite" in texts
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == DISARMED
    robot.ticks(250)  # its wheels come to rest
    robot.armed()
    check(keep_turning(robot, 300)[-1:], 1e-4)
