# SPDX-License-Identifier: MIT
"""The I2C scan and OMNI_HEALTH, in lockstep with the simulated world's bus and without one."""

from __future__ import annotations

from typing import Any

import pytest

from hil_sim.faults import Fault
from hil_sim.world import World, world_config
from omniwheel.robots import read_robot
from tests.firmware.client import PCA9685, Client, connect, firmware, mav
from tests.firmware.fake_robot import HIL_OFF, HIL_ON, RADIO, USB, FakeRobot, command
from tests.firmware.test_commands import ARM, ARMED, DISARMED

SCAN = mav.MAV_CMD_OMNI_I2C_SCAN
ADDRESSES = range(0x08, 0x78)
PLENTY = len(ADDRESSES) + 20


def addresses(result: Any) -> list[int]:
    return [a for a in range(128) if result.found[a // 8] >> a % 8 & 1]


def messages(robot: Client, world: World, ticks: int, kind: str) -> list[Any]:
    """Run ticks in the world and return the messages of one kind."""
    seen = []
    for _ in range(ticks):
        sensors = world.sense()
        robot.sequence += 1
        robot.mav.omni_hil_sensors_send(
            sensors.time_us + 1000,
            robot.sequence,
            list(sensors.counts),
            sensors.battery_V,
            sensors.counts_valid,
            sensors.i2c_status,
            sensors.i2c_read_length,
            list(sensors.i2c_read),
        )
        actuators = robot.wait("OMNI_HIL_ACTUATORS", sequence=robot.sequence)
        world.i2c(bytes(actuators.i2c[: actuators.i2c_length]))
        world.step()
        seen += [m for m in robot.inbox if m.get_type() == kind]
        robot.inbox = [m for m in robot.inbox if m.get_type() != kind]
    return seen


def scan(robot: Client, world: World) -> Any:
    messages(robot, world, 20, "OMNI_I2C_SCAN")
    assert robot.command(SCAN) == mav.MAV_RESULT_ACCEPTED
    results = messages(robot, world, PLENTY, "OMNI_I2C_SCAN")
    assert len(results) == 1
    return results[0]


@pytest.mark.parametrize(
    ("overrides", "found"),
    [
        ({}, [PCA9685]),
        ({"i2c_stranger": 0x68}, [PCA9685, 0x68]),
        ({"pca9685_address": 0x41}, [0x41, 0x70]),  # never set up, it listens to "all call" too
        ({"i2c_stranger": 0x08}, [0x08, PCA9685]),
        ({"i2c_stranger": 0x77}, [PCA9685, 0x77]),
    ],
)
def test_a_scan_finds_who_is_there(robot: Client, overrides: dict[str, Any], found: list[int]) -> None:
    result = scan(robot, World(world_config(read_robot("three_wheel"), **overrides)))
    assert addresses(result) == found
    assert not result.stuck


@pytest.mark.parametrize(("kind", "stuck"), [("i2c_nack", 0), ("i2c_stuck", 1)])
def test_nobody_answers_on_a_dead_bus(robot: Client, kind: str, stuck: int) -> None:
    result = scan(robot, World(world_config(read_robot("three_wheel"), faults=[Fault(kind, 0.0)])))
    assert addresses(result) == []
    assert result.stuck == stuck


def test_the_motors_are_told_off_again_then_every_address_is_asked_once(robot: Client) -> None:
    robot.ticks(20)
    assert robot.command(SCAN) == mav.MAV_RESULT_ACCEPTED
    asked = []
    for _ in range(len(ADDRESSES) + 2):
        robot.sequence += 1
        robot.time_us += 1000
        robot.mav.omni_hil_sensors_send(robot.time_us, robot.sequence, [0] * 4, 12.0, 15, 0, 0, [0] * 8)
        actuators = robot.wait("OMNI_HIL_ACTUATORS", sequence=robot.sequence)
        asked.append(bytes(actuators.i2c[: actuators.i2c_length]))
    off, *probes = [data for data in asked if data]
    assert off == bytes([PCA9685, 2, 0xFD, 0x10, 0])
    assert probes == [bytes([address, 0, 0]) for address in ADDRESSES]


def test_the_driver_sets_its_chip_up_again_before_anybody_arms(robot: Client) -> None:
    world = World(world_config(read_robot("three_wheel")))
    messages(robot, world, 20, "OMNI_I2C_SCAN")
    robot.heartbeat()
    assert robot.command(SCAN) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(ARM, 1) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    messages(robot, world, PLENTY, "OMNI_I2C_SCAN")
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    messages(robot, world, 5, "OMNI_STATUS")
    robot.command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_OMNI_STATUS)
    assert robot.wait("OMNI_STATUS").state == ARMED


def test_an_armed_robot_refuses_to_scan(robot: Client) -> None:
    robot.armed()
    assert robot.command(SCAN) == mav.MAV_RESULT_DENIED
    assert any("disarm first" in text for text in robot.texts())
    assert robot.tick().actuators.state == ARMED


def test_leaving_no_scan_behind_when_host_in_the_loop_begins_anew(robot: Client) -> None:
    robot.ticks(20)
    assert robot.command(SCAN) == mav.MAV_RESULT_ACCEPTED
    robot.ticks(10, nack=True)
    assert robot.command(mav.MAV_CMD_OMNI_HIL, 1) == mav.MAV_RESULT_ACCEPTED
    robot.time_us = 0
    robot.registers = bytearray(256)
    assert robot.armed().tick().actuators.state == ARMED


CANCELLED = "I2C scan cancelled: HIL switched"


@pytest.mark.pc_only
def test_whoever_waits_for_a_scan_is_told_that_entering_host_in_the_loop_cancels_it() -> None:
    robot = FakeRobot().ready()
    assert robot.ask(USB, command(SCAN)) == mav.MAV_RESULT_ACCEPTED
    robot.tick(10)
    assert robot.ask(RADIO, HIL_ON) == mav.MAV_RESULT_ACCEPTED
    robot.tick(3)
    assert CANCELLED in robot.texts(USB)
    robot.close()


@pytest.mark.pc_only
def test_whoever_waits_for_a_scan_is_told_that_leaving_host_in_the_loop_cancels_it() -> None:
    robot = FakeRobot().in_loop(RADIO, drive=False)
    assert robot.ask(USB, command(SCAN)) == mav.MAV_RESULT_ACCEPTED
    robot.hil_tick(RADIO, 10)
    assert robot.ask(RADIO, HIL_OFF) == mav.MAV_RESULT_ACCEPTED
    robot.tick(3)
    assert CANCELLED in robot.texts(USB)
    robot.tick(30)
    assert robot.ask(USB, command(SCAN)) == mav.MAV_RESULT_ACCEPTED
    robot.tick(PLENTY)
    robot.look()
    assert [m.get_type() for m in robot.said[USB]].count("OMNI_I2C_SCAN") == 1
    robot.close()


def test_without_hardware_the_pc_finds_its_stand_in() -> None:
    with firmware() as process:
        client = connect(process)
        try:
            client.wait("HEARTBEAT")
            assert client.command(SCAN) == mav.MAV_RESULT_ACCEPTED
            assert addresses(client.wait("OMNI_I2C_SCAN")) == [PCA9685]
            assert client.wait("HEARTBEAT").system_status == mav.MAV_STATE_STANDBY
        finally:
            client.socket.close()


def test_health_counts_what_the_bus_does(robot: Client) -> None:
    robot.ticks(20)
    robot.ticks(3, nack=True)
    assert robot.command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_OMNI_HEALTH) == mav.MAV_RESULT_ACCEPTED
    health = robot.wait("OMNI_HEALTH")
    assert health.i2c_nacks == 3
    assert health.i2c_timeouts == 0
    assert health.reset_cause == 0
    assert health.encoder_errors == [0, 0, 0, 0]
    assert robot.tick().actuators.state == DISARMED


@pytest.mark.full
def test_health_comes_with_the_status_group(robot: Client) -> None:
    robot.set("SR1_STATUS", 2.0)
    seen = [m.get_type() for tick in robot.ticks(3000) for m in tick.others]
    assert seen.count("OMNI_HEALTH") == pytest.approx(seen.count("OMNI_STATUS"), abs=1)
    assert seen.count("OMNI_HEALTH") >= 5


@pytest.mark.pc_only
def test_a_scan_in_a_loop_that_has_not_begun_is_refused_with_the_reason() -> None:
    robot = FakeRobot().ready()
    assert robot.ask(USB, HIL_ON) == mav.MAV_RESULT_ACCEPTED
    robot.tick(3)
    assert robot.ask(USB, command(SCAN)) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    assert "I2C scan refused: no sensor readings yet" in robot.texts()
    robot.close()
