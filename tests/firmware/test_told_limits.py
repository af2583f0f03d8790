# SPDX-License-Identifier: MIT
"""The robot says which limit makes it slower than asked, and with what last values it stopped."""

from __future__ import annotations

from typing import Any

import pytest

from tests.firmware.client import ALL_WHEELS, Client, mav

FAILSAFE = 3
VELOCITY_ONLY = 0b0101_1100_0111
RIM_M, RADIUS_M, LIM_WHEEL = 0.2632, 0.0508, 3.0  # three_wheel.toml and the default


def drive(robot: Client, ticks: int, rate: tuple[float, float, float], **sensors: Any) -> list[str]:
    """Stream a velocity (forward, right, turn rate) at 50 Hz and return what the robot says meanwhile."""
    said: list[str] = []
    for number in range(ticks):
        if number % 20 == 0:
            robot.heartbeat()
            robot.mav.set_position_target_local_ned_send(
                0, 1, 1, mav.MAV_FRAME_BODY_FRD, VELOCITY_ONLY, 0, 0, 0, rate[0], rate[1], 0, 0, 0, 0, 0, rate[2]
            )
        tick = robot.tick(**sensors)
        said += [m.text for m in tick.others if m.get_type() == "STATUSTEXT"]
    return said


def scaled(texts: list[str]) -> list[str]:
    return [text for text in texts if text.startswith("velocity scaled")]


@pytest.mark.parametrize("turn", [1.0, 2.0])
def test_a_velocity_beyond_the_wheels_is_said_with_the_limit(robot: Client, turn: float) -> None:
    robot.armed()
    percent = int(100.0 * LIM_WHEEL / (turn * RIM_M / RADIUS_M))
    assert scaled(drive(robot, 300, (0.0, 0.0, turn))) == [f"velocity scaled to {percent} %: LIM_WHEEL 3 rad/s"]


def test_a_velocity_that_is_followed_as_asked_says_nothing(robot: Client) -> None:
    robot.armed()
    assert scaled(drive(robot, 300, (0.0, 0.0, 0.99 * LIM_WHEEL * RADIUS_M / RIM_M))) == []


def test_the_limit_that_decides_is_named(robot: Client) -> None:
    """A limit that shrinks while a set-point is in force cuts it: the next one would be refused."""
    robot.armed()
    drive(robot, 100, (0.1, 0.0, 0.0))
    robot.set("LIM_V", 0.05)
    texts = [m.text for t in robot.ticks(100) for m in t.others if m.get_type() == "STATUSTEXT"]
    assert scaled(texts) == ["velocity scaled to 50 %: LIM_V 0.05 m/s"]


@pytest.mark.full
def test_it_is_said_again_every_five_seconds_while_it_lasts(robot: Client) -> None:
    robot.armed()
    assert len(scaled(drive(robot, 4_900, (0.0, 0.0, 1.0)))) == 1
    assert len(scaled(drive(robot, 200, (0.0, 0.0, 1.0)))) == 1


def test_a_path_that_is_slowed_down_says_by_how_much_and_because_of_which_limit(robot: Client) -> None:
    robot.armed()
    for name, value in {"TRJ_TYPE": 3, "TRJ_ROT": 0, "TRJ_SIZE": 0.5, "TRJ_PERIOD": 10, "LIM_WHEEL": 2.0}.items():
        robot.set(name, value)
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1, 1) == mav.MAV_RESULT_ACCEPTED
    (text,) = [text for text in robot.texts() if text.startswith("path slowed")]
    # a circle of 0.5 m in 10 s is 0.314 m/s, 6.18 rad/s of a wheel that points along it; 0.8 of LIM_WHEEL may be used
    assert text == f"path slowed to {int(100 * 0.8 * 2.0 * RADIUS_M / (0.1 * 3.14159265))} %: LIM_WHEEL 2 rad/s x 0.8"


def test_a_stall_names_the_wheel_its_voltage_and_its_speed(robot: Client) -> None:
    robot.armed()
    drive(robot, 100, (0.0, 0.0, 0.5))
    angles = list(robot.angles)
    said: list[str] = []
    for _ in range(1500):
        robot.angles[1] = angles[1]  # the second wheel is stuck
        said += drive(robot, 1, (0.0, 0.0, 0.55))
    assert "failsafe: stall" in said
    (text,) = [text for text in said if text.startswith("wheel ")]
    assert text.startswith("wheel 2: given ")
    volts, speed = float(text.split()[3]), float(text.split()[-2])
    assert abs(volts) >= 4.0  # SAFE_STALL_V
    assert abs(speed) < 0.5


def test_an_encoder_that_fails_is_named(robot: Client) -> None:
    robot.armed()
    said = drive(robot, 30, (0.0, 0.0, 0.5), valid=ALL_WHEELS & ~0b100)
    assert "failsafe: encoder" in said
    assert [text.split(":")[0] for text in said if text.startswith("wheel ")] == ["wheel 3"]


def test_a_low_supply_is_said_with_its_value_and_the_limit(robot: Client) -> None:
    robot.armed()
    said = drive(robot, 200, (0.0, 0.0, 0.1), battery_v=8.5)
    assert "failsafe: battery" in said
    assert "supply 8.5 V: BAT_V_MIN 9 V" in said


@pytest.mark.full
def test_a_pose_beyond_the_limit_stops_with_the_limit(robot: Client) -> None:
    """By velocities, which name no place that could be refused; then arming is refused until the pose is within."""
    robot.set("LIM_POS", 0.1)
    robot.armed()
    said = drive(robot, 3_000, (0.1, 0.0, 0.0))
    assert "failsafe: position" in said
    assert "pose beyond LIM_POS 0.1 m" in said
    assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mav.MAV_RESULT_ACCEPTED
    robot.heartbeat()
    assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) != mav.MAV_RESULT_ACCEPTED
    robot.set("LIM_POS", 20.0)
    robot.armed()


def test_set_points_that_stop_are_said_with_the_limit(robot: Client) -> None:
    robot.armed()
    drive(robot, 100, (0.0, 0.0, 0.1))
    said = [m.text for t in robot.ticks(700) for m in t.others if m.get_type() == "STATUSTEXT"]
    assert "failsafe: command loss" in said
    assert "no setpoint for SAFE_CMD_TO 0.5 s" in said
