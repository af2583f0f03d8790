# SPDX-License-Identifier: MIT
"""Over the link: the current limit says that it binds, and a motor that is too hot stops the robot with its name."""

from __future__ import annotations

from typing import Any

from tests.firmware.client import Client, mav

VELOCITY_ONLY = 0b0101_1100_0111


def turn(robot: Client, ticks: int, rate: float, stuck: int | None = None) -> list[Any]:
    """Stream a turn rate at 50 Hz, with a wheel that stands; return all messages."""
    said: list[Any] = []
    angles = list(robot.angles)
    for number in range(ticks):
        if number % 20 == 0:
            robot.heartbeat()
            robot.mav.set_position_target_local_ned_send(
                0, 1, 1, mav.MAV_FRAME_BODY_FRD, VELOCITY_ONLY, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, rate
            )
        if stuck is not None:
            robot.angles[stuck] = angles[stuck]
        said += robot.tick().others
    return said


def texts(said: list[Any]) -> list[str]:
    return [message.text for message in said if message.get_type() == "STATUSTEXT"]


def of(said: list[Any], name: str) -> list[Any]:
    return [message for message in said if message.get_type() == name]


def test_a_limit_that_binds_is_said_and_reported(robot: Client) -> None:
    robot.set("LIM_I", 0.8)
    robot.set("SAFE_STALL_T", 20.0)
    robot.armed()
    said = turn(robot, 1500, 0.5, stuck=1)
    told = [text for text in texts(said) if text.startswith("motors pushed at ")]
    assert told
    assert told[0].endswith(" %: LIM_I 0.8 A")
    assert 0 < int(told[0].split()[3]) < 100
    wheels = of(said, "OMNI_WHEELS")[-1]
    assert 0.0 < wheels.current_cut < 1.0
    assert max(abs(current_A) for current_A in wheels.current) < 0.85
    assert list(wheels.heat) == [0.0] * 4
    assert of(said, "BATTERY_STATUS")[-1].current_battery >= 0


def test_without_it_nothing_is_said_and_no_current_is_known(robot: Client) -> None:
    robot.armed()
    said = turn(robot, 1500, 0.4)
    assert not [text for text in texts(said) if text.startswith("motors pushed")]
    assert of(said, "OMNI_WHEELS")[-1].current_cut == 0.0
    assert of(said, "BATTERY_STATUS")[-1].current_battery == -1


def test_a_motor_that_is_too_hot_stops_the_robot_and_is_named(robot: Client) -> None:
    robot.set("SAFE_I", 0.5)
    robot.set("SAFE_I_TC", 1.0)
    robot.set("SAFE_STALL_T", 20.0)
    robot.armed()
    said = turn(robot, 1500, 0.5, stuck=1)
    assert "failsafe: motor heat" in texts(said)
    (told,) = [text for text in texts(said) if text.startswith("motor 2 too hot: ")]
    assert told.endswith(" A, SAFE_I 0.5 A")
    assert abs(float(told.split()[4])) > 0.5
    assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mav.MAV_RESULT_ACCEPTED
    robot.heartbeat()
    assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) != mav.MAV_RESULT_ACCEPTED, "it is hot"
    for _ in range(4):
        robot.ticks(100)
        robot.heartbeat()
    robot.armed()
