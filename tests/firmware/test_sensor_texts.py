# SPDX-License-Identifier: MIT
"""What the robot says of a sensor's chip: once on each link, and again to whoever comes later."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import HEARTBEAT, HIL_OFF, HIL_ON, PORTS, RADIO, USB, FakeRobot

SAID = {
    "gyro": ("gyro: no chip answers; check power and wires", "gyro: readings again"),
    "flow": ("floor motion: no sensor answers; check its wires", "floor motion: readings again"),
}
MINUTE = 60_000


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot()
    yield one
    one.close()


@pytest.mark.parametrize("sensor", SAID)
def test_a_trouble_and_its_end_are_said_once_on_each_link(robot: FakeRobot, sensor: str) -> None:
    trouble, over = SAID[sensor]
    robot.ready().sensor_trouble(**{sensor: 1})
    robot.tick(2000)
    assert [robot.texts(port).count(trouble) for port in range(PORTS)] == [1] * PORTS
    robot.sensor_trouble()
    robot.tick(2000)
    assert [robot.texts(port).count(over) for port in range(PORTS)] == [1] * PORTS
    loud = {m.text: m.severity for m in robot.said[USB] if m.get_type() == "STATUSTEXT"}
    assert (loud[trouble], loud[over]) == (mav.MAV_SEVERITY_WARNING, mav.MAV_SEVERITY_INFO)


@pytest.mark.full
@pytest.mark.parametrize("sensor", SAID)
def test_who_comes_later_hears_it_and_the_others_not_again(robot: FakeRobot, sensor: str) -> None:
    trouble, _ = SAID[sensor]
    robot.port(RADIO, connection=0)
    robot.sensor_trouble(**{sensor: 1})
    robot.ready()
    robot.port(RADIO, connection=2)
    robot.tick(3)
    assert [robot.texts(port).count(trouble) for port in range(PORTS)] == [1] * PORTS
    robot.port(USB, connection=0)
    robot.tick(MINUTE)
    robot.port(USB, connection=2)
    robot.tick(3)
    assert [robot.texts(port).count(trouble) for port in range(PORTS)] == [2 if port == USB else 1 for port in range(4)]


@pytest.mark.parametrize("sensor", SAID)
def test_who_comes_when_it_is_over_hears_nothing(robot: FakeRobot, sensor: str) -> None:
    robot.ready().sensor_trouble(**{sensor: 1})
    robot.tick(3)
    robot.port(USB, connection=0)
    robot.tick(3)
    robot.sensor_trouble()
    robot.tick(3)
    robot.look()
    robot.said[USB].clear()
    robot.port(USB, connection=2)
    robot.tick(3)
    assert not {*SAID[sensor]} & {*robot.texts(USB)}


def test_a_host_in_the_loop_has_other_sensors(robot: FakeRobot) -> None:
    robot.ready()
    robot.ask(USB, HIL_ON)
    robot.sensor_trouble(gyro=1, flow=1)
    robot.hil_tick(USB, 20)
    assert not any(trouble in robot.texts(RADIO) for trouble, _ in SAID.values())
    robot.ask(USB, HIL_OFF)
    robot.tick(20)
    assert all(trouble in robot.texts(RADIO) for trouble, _ in SAID.values())


@pytest.mark.parametrize("sensor", SAID)
def test_a_radio_that_is_switched_on_later_hears_it(robot: FakeRobot, sensor: str) -> None:
    """Its link is connected all the time. A heartbeat, the first or after long silence, shows somebody there."""
    trouble, _ = SAID[sensor]

    def said_after(ticks: int, heartbeat: bool = True) -> list[int]:
        robot.look()
        for port in range(PORTS):
            robot.said[port].clear()
        if heartbeat:
            robot.send(RADIO, HEARTBEAT)
        robot.tick(ticks)
        return [robot.texts(port).count(trouble) for port in range(PORTS)]

    nobody, radio = [0] * PORTS, [int(port == RADIO) for port in range(PORTS)]
    robot.sensor_trouble(**{sensor: 1})
    robot.tick(30)
    assert said_after(3000, heartbeat=False) == nobody
    assert said_after(1000) == radio
    assert said_after(9000) == nobody
    assert said_after(11000) == nobody
    assert said_after(1000) == radio


def test_a_program_on_the_cable_hears_it_once(robot: FakeRobot) -> None:
    robot.sensor_trouble(gyro=1)
    robot.port(USB, connection=0)
    robot.tick(5000)
    robot.port(USB, connection=2)
    robot.tick(1000)
    robot.send(USB, HEARTBEAT)
    robot.tick(1000)
    assert robot.texts(USB).count(SAID["gyro"][0]) == 1
