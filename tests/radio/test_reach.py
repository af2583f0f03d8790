# SPDX-License-Identifier: MIT
"""No parameter makes the robot deaf: at both ends of every range it hears, answers and stops, on USB and radio."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from omni_schema import Parameter, load_parameters
from omniwheel.dialect import mavlink
from omniwheel.paths import params_path
from tests.radio.memory_robot import ERASED, RADIO, USB, MemoryRobot
from tests.radio.station import Station, usb

TABLE = load_parameters(params_path())
ESTOP = mavlink.MAV_CMD_OMNI_ESTOP
STORE = mavlink.MAV_CMD_PREFLIGHT_STORAGE
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
STOPPED = 4
SLOT_BYTES = (1080 - 192) // 2
HEADER_BYTES, ENTRY_BYTES = 12, 6


def target(name: str, value: float) -> int:
    return int(value) if name == "SYS_ID" else 1


def command(station: Station, system: int, number: int, *params: float) -> int | None:
    """Send a command to this system id and return the result of its acknowledgement."""
    station.mav.command_long_send(system, 1, number, 0, *[*params, *[0.0] * (7 - len(params))])
    for _ in range(60):
        for message in station.run(100):
            if message.get_type() == "COMMAND_ACK" and message.command == number:
                return int(message.result)
    return None


def check_reachable(robot: MemoryRobot, system: int, port: int) -> None:
    station = Station(robot, port)
    station.heartbeat()
    assert command(station, system, ESTOP, 1) == ACCEPTED
    station.mav.command_long_send(
        system, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_OMNI_STATUS, 0, 0, 0, 0, 0, 0
    )
    heard = [
        m for _ in range(100) for m in station.run(100)
    ]  # at 1200 baud the stop's answer overtakes, its news waits
    assert [m.state for m in heard if m.get_type() == "OMNI_STATUS"][-1] == STOPPED
    assert "HEARTBEAT" in [m.get_type() for m in heard]
    assert command(station, system, ESTOP, 0) == ACCEPTED


@contextmanager
def robot_with(name: str, value: float) -> Iterator[MemoryRobot | None]:
    """A robot in which this was set, stored, and that was started again; None if it refused (a clash with others)."""
    with MemoryRobot() as robot:
        robot.run(50)
        station = usb(robot)
        station.mav.param_set_send(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        answers = [m for m in station.run(50) if m.get_type() == "PARAM_VALUE" and m.param_id == name]
        if answers[-1].param_value != pytest.approx(value):
            yield None
            return
        assert command(station, target(name, value), STORE, 1) == ACCEPTED
        robot.reboot()
        robot.run(50)
        yield robot


def ends(parameter: Parameter) -> set[float]:
    return {float(parameter.minimum), float(parameter.maximum)}


@pytest.mark.parametrize("parameter", TABLE.parameters, ids=lambda parameter: parameter.name)
def test_at_both_ends_of_its_range_the_robot_is_reached_and_stops(parameter: Parameter) -> None:
    for value in ends(parameter):
        with robot_with(parameter.name, value) as robot:
            if robot is not None:
                for port in (USB, RADIO):
                    check_reachable(robot, target(parameter.name, value), port)


def test_all_budgets_and_speeds_at_their_least_with_all_rates_at_their_most() -> None:
    with MemoryRobot() as robot:
        robot.run(50)
        station = usb(robot)
        for parameter in TABLE.parameters:
            if parameter.name.startswith(("SR", "LINK")) and not parameter.name.endswith("LEGACY"):
                value = parameter.maximum if parameter.name.startswith("SR") else parameter.minimum
                station.mav.param_set_send(1, 1, parameter.name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
                station.run(5)
        robot.run(3000)
        for port in (USB, RADIO):
            check_reachable(robot, 1, port)


@pytest.mark.parametrize("value", [0.0, 255.0, 256.0])
def test_a_ground_stations_own_number_is_refused_with_the_reason(value: float) -> None:
    with MemoryRobot() as robot:
        robot.run(50)
        station = usb(robot)
        station.mav.param_set_send(1, 1, b"SYS_ID", value, mavlink.MAV_PARAM_TYPE_REAL32)
        answers = station.run(50)
        assert [m.param_value for m in answers if m.get_type() == "PARAM_VALUE"] == [1.0]
        texts = [m.text for m in answers if m.get_type() == "STATUSTEXT"]
        assert f"SYS_ID {value:.0f} refused: 1..254 (255: ground station)" in texts
        check_reachable(robot, 1, USB)


@pytest.mark.parametrize("value", [0.0, 255.0])
def test_a_stored_set_that_holds_such_a_number_comes_up_reachable_and_is_said(value: float) -> None:
    with robot_with("SYS_ID", 254.0) as robot:
        assert robot is not None
        image = bytearray(robot.storage()[0])
    entry = HEADER_BYTES
    image[entry + 2 : entry + ENTRY_BYTES] = struct.pack("<f", value)
    crc = zlib.crc32(bytes(image[: HEADER_BYTES + ENTRY_BYTES]))
    image[HEADER_BYTES + ENTRY_BYTES : HEADER_BYTES + ENTRY_BYTES + 4] = crc.to_bytes(4, "little")
    with MemoryRobot(bytes(image)) as robot:
        robot.run(50)
        texts = [m.text for m in usb(robot).run(1) if m.get_type() == "STATUSTEXT"]
        assert f"stored SYS_ID {value:.0f} left out" in texts
        check_reachable(robot, 1, USB)


@pytest.mark.parametrize("system", [1, 254])
def test_a_station_with_the_robots_own_number_can_stop_it(system: int) -> None:
    with robot_with("SYS_ID", float(system)) as robot:
        assert robot is not None
        station = Station(robot, USB, system=system)
        assert command(station, system, ESTOP, 1) == ACCEPTED


def test_the_robots_own_frames_that_come_back_do_nothing() -> None:
    """A modem that echoes: the same number and the same component."""
    with MemoryRobot(ERASED) as robot:
        robot.run(50)
        station = Station(robot, USB, system=1)
        station.mav.srcComponent = mavlink.MAV_COMP_ID_AUTOPILOT1
        assert command(station, 1, ESTOP, 1) is None
