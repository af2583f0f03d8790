# SPDX-License-Identifier: MIT
"""The whole firmware with a gyro's chip on its board: what it says, and that motors do not depend on it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from omniwheel.dialect import mavlink
from tests.firmware.gyro_model import Faults
from tests.radio.memory_robot import USB, MemoryRobot
from tests.radio.station import ARM, Station
from tests.radio.test_texts import texts_of

WARN_GYRO = 1 << 22
LEARNED_TICKS = 2000


@pytest.fixture
def robot() -> Iterator[MemoryRobot]:
    with MemoryRobot() as made:
        yield made


def ask(station: Station, name: str, number: int) -> Any:
    station.mav.command_long_send(1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, number, 0, 0, 0, 0, 0, 0)
    return [message for message in station.run() if message.get_type() == name][-1]


def gyro_of(station: Station) -> Any:
    return ask(station, "OMNI_GYRO", mavlink.MAVLINK_MSG_ID_OMNI_GYRO)


def warned(station: Station) -> bool:
    return bool(ask(station, "OMNI_STATUS", mavlink.MAVLINK_MSG_ID_OMNI_STATUS).faults & WARN_GYRO)


def listen(robot: MemoryRobot, ticks: int) -> list[str]:
    return texts_of(Station(robot, USB).run(ticks))


@pytest.mark.parametrize(("axis", "sign"), [(1, 1), (3, 1), (-3, -1)])
def test_its_readings_reach_the_estimator_and_the_ground_station(robot: MemoryRobot, axis: int, sign: int) -> None:
    robot.add_gyro(axis)
    robot.turn_gyro(0.005, 0.005, 0.005)
    robot.run(LEARNED_TICKS)
    station = Station(robot, USB)
    state = gyro_of(station)
    assert (state.used, warned(station)) == (1, False)
    assert state.bias == pytest.approx(sign * 0.005, abs=2e-4)
    rates = [0.005] * 3
    rates[abs(axis) - 1] = 0.505
    robot.turn_gyro(*rates)
    robot.run(200)
    assert gyro_of(station).rate == pytest.approx(sign * 0.5, abs=0.02)
    assert texts_of(station.run(100)) == []


TROUBLES = {
    "absent": "gyro: no chip answers; check power and wires",
    "other_id": "gyro: WHO_AM_I is 0x12, not 0x47: another chip",
    "silent": "gyro: it answers but does not measure",
    "stuck": "gyro: the same reading 100 times",
}


@pytest.mark.parametrize(("fault", "text"), TROUBLES.items(), ids=TROUBLES)
def test_a_trouble_warns_names_its_cause_once_and_ends(robot: MemoryRobot, fault: str, text: str) -> None:
    faults = robot.add_gyro(3)
    station = Station(robot, USB)
    station.run(LEARNED_TICKS)
    setattr(faults, fault, 0x12 if fault == "other_id" else True)
    if fault in ("other_id", "silent"):  # they show at a start
        robot.hold_gyro(True)
        station.run(50)
        robot.hold_gyro(False)
    texts = texts_of(station.run(3000))
    assert text in texts
    assert texts.count(text) <= 2
    assert warned(station)
    setattr(faults, fault, 0)
    assert "gyro: readings again" in texts_of(station.run(3000))
    assert not warned(station)


def test_a_bus_that_is_held_low_is_said(robot: MemoryRobot) -> None:
    robot.add_gyro(3)
    station = Station(robot, USB)
    station.run(LEARNED_TICKS)
    robot.hold_gyro(True)
    assert "gyro: a line of its bus is held low" in texts_of(station.run(1000))
    robot.hold_gyro(False)
    assert "gyro: readings again" in texts_of(station.run(1000))


def test_a_robot_whose_gyro_is_not_there_arms_and_drives(robot: MemoryRobot) -> None:
    faults: Faults = robot.add_gyro(3)
    faults.absent = True
    station = Station(robot, USB)
    station.run(500)
    station.heartbeat()
    station.run(20)
    assert station.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
    station.mav.omni_setpoint_duty_send(1, 1, [0.2, 0.2, 0.2, 0.0])
    robot.run(5)
    assert robot.driven
    assert warned(station)


def test_without_an_axis_nobody_asks_for_the_chip(robot: MemoryRobot) -> None:
    faults = robot.add_gyro(0)
    faults.absent = True
    assert [text for text in listen(robot, 2000) if "gyro" in text] == []
    assert not warned(Station(robot, USB))
