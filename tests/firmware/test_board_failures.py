# SPDX-License-Identifier: MIT
"""What the firmware does about a board that crashed, whose pins or bus fail, or that hands over impossible values."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARMED,
    CRASH,
    DISARM,
    FAILSAFE,
    HIL_OFF,
    HIL_ON,
    OVER_TEMPERATURE,
    PORTS,
    POWER_ON,
    SOFTWARE,
    USB,
    WATCHDOG,
    FakeRobot,
    command,
    duty,
    frame,
)

ACCEPTED = mav.MAV_RESULT_ACCEPTED
IN1_IN2 = 1
HANDING_OVER = 50
"""Ticks for which a bus that takes nothing is asked to switch the motors off, before host-in-the-loop."""
ADDRESSES = 0x77 - 0x08 + 1
PATIENCE = 10
"""Ticks after which a scan gives a busy bus up."""


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    robot = FakeRobot()
    yield robot
    robot.close()


def loud(robot: FakeRobot, port: int) -> list[str]:
    """Return the critical texts so far."""
    robot.look()
    texts = [m for m in robot.said[port] if m.get_type() == "STATUSTEXT"]
    return [m.text for m in texts if m.severity == mav.MAV_SEVERITY_CRITICAL]


def setting(robot: FakeRobot, name: str, value: float) -> None:
    robot.send(USB, frame("param_set", 1, 1, name.encode(), value, 9))
    robot.tick(2)


@pytest.mark.full
@pytest.mark.parametrize(
    ("cause", "words"),
    [
        (POWER_ON, []),
        (WATCHDOG, ["restarted by the watchdog"]),
        (SOFTWARE, []),
        (CRASH, ["restarted after a crash"]),
        (OVER_TEMPERATURE, ["restarted: the processor was too hot"]),
    ],
)
@pytest.mark.parametrize("lines", [(), (b"crash at 0x1234ABCD",), (b"crash at 0x1234ABCD", b"exception 3")])
def test_why_it_restarted_is_said_once_to_everybody(
    robot: FakeRobot, cause: int, words: list[str], lines: tuple[bytes, ...]
) -> None:
    robot.crash_lines(*lines)
    robot.reset(cause)
    robot.ready()
    said = words + [line.decode() for line in lines]
    for port in range(PORTS):
        assert loud(robot, port) == said
        robot.port(port, connection=2)
    robot.ready()
    for port in range(PORTS):
        assert loud(robot, port) == said, "who comes back to a link has read it"


@pytest.fixture
def on_pins(robot: FakeRobot) -> FakeRobot:
    """A robot whose motors hang on the processor's own pins."""
    robot.pins()
    robot.reset()
    robot.ready()
    setting(robot, "MOT_DRIVER", IN1_IN2)
    return robot


@pytest.mark.full
def test_a_motor_pin_that_loses_its_timer_once_is_an_error_and_no_stop(on_pins: FakeRobot) -> None:
    on_pins.armed()
    before = on_pins.asked("OMNI_STATUS").i2c_errors
    on_pins.send(USB, duty(0.2))
    on_pins.tick(3)
    assert on_pins.pins_high
    for lost in (True, False):
        on_pins.pins(lost=lost)
        on_pins.tick(1)
    on_pins.tick(5)
    assert on_pins.state() == ARMED
    assert on_pins.asked("OMNI_STATUS").i2c_errors == before + 1


def test_motor_pins_that_go_on_losing_their_timers_stop_the_robot(on_pins: FakeRobot) -> None:
    setting(on_pins, "SAFE_I2C_N", 5.0)
    on_pins.armed()
    on_pins.send(USB, duty(0.2))
    on_pins.tick(3)
    on_pins.pins(lost=True)
    on_pins.tick(5)
    assert on_pins.enabled(), "four failures in a row are none too many"
    on_pins.tick(1)
    assert on_pins.state() == FAILSAFE
    assert not on_pins.pins_high
    assert not on_pins.enabled()


def test_entering_host_in_the_loop_leaves_the_pins_low(on_pins: FakeRobot) -> None:
    on_pins.armed()
    on_pins.send(USB, duty(0.2))
    on_pins.tick(3)
    on_pins.send(USB, DISARM)
    on_pins.tick(3)
    assert on_pins.ask(USB, HIL_ON) == ACCEPTED
    on_pins.tick(3)
    assert not on_pins.pins_high
    assert not on_pins.enabled()


def ticks_until_answered(robot: FakeRobot) -> int:
    """Return the ticks until the robot reads its links again."""
    for ticks in range(200):
        if robot.ask(USB, command(mav.MAV_CMD_REQUEST_MESSAGE, mav.MAVLINK_MSG_ID_OMNI_STATUS)) is not None:
            return ticks
        robot.tick()
    raise AssertionError("the robot is silent")


@pytest.mark.full
def test_a_bus_that_takes_nothing_holds_host_in_the_loop_up_for_a_moment(robot: FakeRobot) -> None:
    robot.ready()
    for _ in range(2):
        robot.bus_busy(refusals=10_000)
        assert robot.ask(USB, HIL_ON) == ACCEPTED
        assert ticks_until_answered(robot) == HANDING_OVER
        robot.bus_busy()
        assert robot.ask(USB, HIL_OFF) == ACCEPTED
        robot.tick(30)


def test_a_bus_that_takes_the_command_to_switch_off_lets_it_begin(robot: FakeRobot) -> None:
    robot.ready()
    robot.bus_busy(refusals=7)
    assert robot.ask(USB, HIL_ON) == ACCEPTED
    assert ticks_until_answered(robot) == 8


@pytest.mark.parametrize("way", ["polls", "refusals"])
@pytest.mark.parametrize("ticks", [PATIENCE - 1, PATIENCE])
def test_a_scan_waits_for_a_busy_bus_and_then_gives_it_up(robot: FakeRobot, ticks: int, way: str) -> None:
    robot.ready()
    assert robot.ask(USB, command(mav.MAV_CMD_OMNI_I2C_SCAN)) == ACCEPTED
    robot.tick(20)
    robot.bus_busy(**{way: ticks})
    robot.tick(200)
    robot.look()
    (result,) = [m for m in robot.said[USB] if m.get_type() == "OMNI_I2C_SCAN"]
    gives_up = ticks == PATIENCE
    assert bool(result.stuck) == gives_up
    assert robot.bus_busy() == int(gives_up)
    asked = sum(byte.bit_count() for byte in result.found)  # on this bus somebody answers at each address
    assert asked < ADDRESSES if gives_up else asked == ADDRESSES
