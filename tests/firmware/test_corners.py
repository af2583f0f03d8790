# SPDX-License-Identifier: MIT
"""Corners of the application that only a changed program showed to be unwatched (docs/checks/testing.md, Mutants)."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    DISARM,
    DISARMED,
    EMERGENCY,
    HIL_ON,
    PORTS,
    RADIO,
    RELEASE,
    USB,
    WATCHDOG,
    FakeRobot,
    command,
    frame,
)

ACCEPTED, DENIED, LATER = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED, mav.MAV_RESULT_TEMPORARILY_REJECTED
SCAN = command(mav.MAV_CMD_OMNI_I2C_SCAN)
LOG = frame("log_request_data", 1, 1, 0, 0, 0xFFFFFFFF)
EXTENDED_STATUS = 2


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    robot = FakeRobot().ready()
    yield robot
    robot.close()


def messages(robot: FakeRobot, name: str, port: int = USB) -> list[object]:
    """Return what has come of one message since this was last asked."""
    robot.look()
    found = [message for message in robot.said[port] if message.get_type() == name]
    robot.said[port].clear()
    return found


def in_a_second(robot: FakeRobot, name: str) -> int:
    """Return how often a message comes."""
    count = 0
    for _ in range(100):
        robot.tick(10)
        count += len(messages(robot, name))
    return count


def test_a_restart_by_the_watchdog_is_said_once_on_each_link(robot: FakeRobot) -> None:
    robot.reset(WATCHDOG)
    robot.ready()
    for port in range(PORTS):
        assert robot.texts(port).count("restarted by the watchdog") == 1


def test_a_stop_is_said_louder_than_a_disarm(robot: FakeRobot) -> None:
    for request in (ARM, EMERGENCY):
        robot.send(USB, request)
        robot.tick(5)
    robot.look()
    loud = {m.text: m.severity for m in robot.said[USB] if m.get_type() == "STATUSTEXT"}
    assert loud["armed"] == mav.MAV_SEVERITY_INFO
    assert loud["estop"] == mav.MAV_SEVERITY_CRITICAL


def test_what_may_be_tried_again_and_what_not(robot: FakeRobot) -> None:
    assert robot.ask(USB, DISARM) == ACCEPTED
    assert robot.ask(USB, ARM) == LATER  # in one tick with it the disarming would win
    robot.tick(3)
    assert robot.ask(USB, EMERGENCY) == ACCEPTED
    robot.tick(3)
    assert robot.ask(USB, ARM) == DENIED
    assert robot.ask(USB, RELEASE) == ACCEPTED
    assert robot.ask(USB, ARM) == LATER
    assert robot.ask(USB, EMERGENCY) == ACCEPTED  # the release is void
    assert robot.ask(USB, ARM) == DENIED
    robot.tick(3)
    assert robot.ask(USB, RELEASE) == ACCEPTED
    robot.tick()
    assert robot.state() == DISARMED
    assert robot.ask(USB, ARM) == ACCEPTED


def test_a_scan_waits_for_the_simulation(robot: FakeRobot) -> None:
    assert robot.ask(USB, SCAN) == ACCEPTED
    robot.tick(300)
    assert len(messages(robot, "OMNI_I2C_SCAN")) == 1
    assert robot.ask(USB, HIL_ON) == ACCEPTED
    robot.tick(3)
    assert robot.ask(USB, SCAN) == LATER
    assert "I2C scan refused: no sensor readings yet" in robot.texts()


def test_refusals_that_were_left_out_are_told_by_number(robot: FakeRobot) -> None:
    for _ in range(40):
        robot.ask(USB, command(mav.MAV_CMD_OMNI_SET_POSE, 1e9))
        robot.ask(USB, command(mav.MAV_CMD_OMNI_WAYPOINT, 99.0))
    robot.wait(20.0)
    robot.background()
    told = [text for text in robot.texts() if text.endswith(" more refusals left out")]
    assert sum(int(text.split()[0]) for text in told) > 60


@pytest.mark.full
def test_a_rate_at_boot_that_is_changed_alone_counts(robot: FakeRobot) -> None:
    for rate in (50.0, 10.0):
        robot.send(USB, frame("param_set", 1, 1, b"SR1_STATUS", rate, 9))
        in_a_second(robot, "OMNI_STATUS")  # the old rate's next one is still due
        assert in_a_second(robot, "OMNI_STATUS") == pytest.approx(rate, abs=1)


def test_a_ground_station_may_wish_for_the_extended_status_alone(robot: FakeRobot) -> None:
    robot.send(USB, frame("request_data_stream", 1, 1, EXTENDED_STATUS, 20, 1))
    in_a_second(robot, "SYS_STATUS")
    assert in_a_second(robot, "SYS_STATUS") == pytest.approx(20, abs=1)


def test_a_damaged_memory_is_said_to_whoever_wants_its_content(robot: FakeRobot) -> None:
    assert robot.ask(USB, command(mav.MAV_CMD_PREFLIGHT_STORAGE, 1.0)) == ACCEPTED
    robot.storage = bytes(2048)
    robot.texts()
    robot.said[USB].clear()
    robot.send(USB, command(mav.MAV_CMD_PREFLIGHT_STORAGE, 0.0))
    robot.background()
    assert len(robot.texts()) == 1, robot.texts()


def test_a_burst_waits_for_an_experiment_or_not_at_all(robot: FakeRobot) -> None:
    for wait in (2.0, -1.0, 0.5):
        assert robot.ask(USB, command(mav.MAV_CMD_OMNI_BURST, 0.02, 1.0, 0.0, 0.0, 0.0, wait)) == DENIED


def test_who_comes_to_a_link_is_not_sent_what_somebody_else_asked_for(robot: FakeRobot) -> None:
    robot.ask(RADIO, command(mav.MAV_CMD_OMNI_BURST, 0.03, 1.0))
    robot.tick(60)
    robot.send(RADIO, LOG)
    robot.tick(2)
    assert messages(robot, "LOG_DATA", RADIO)
    robot.port(RADIO, connection=2)
    robot.tick(1)
    messages(robot, "LOG_DATA", RADIO)
    robot.tick(100)
    assert not messages(robot, "LOG_DATA", RADIO)
