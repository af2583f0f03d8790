# SPDX-License-Identifier: MIT
"""MAV_CMD_OMNI_EXCITE: what is added to the loop, the burst that begins with it, and what is refused with a reason."""

from __future__ import annotations

import math

import numpy as np
import pytest

from omniwheel.burst import parse_burst
from tests.firmware.client import Client, mav
from tests.firmware.fake_robot import ESTOP
from tests.firmware.test_burst import fetch

EXCITE, BURST = mav.MAV_CMD_OMNI_EXCITE, mav.MAV_CMD_OMNI_BURST
ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
WHEEL, VOLTAGE, POSE = 1, 2, 3
REST = (0.0, 0.0, 0.0)


def still(robot: Client) -> None:
    """Ask for velocity zero, as an experiment does while it lasts."""
    robot.mav.set_position_target_local_ned_send(
        robot.time_us // 1000, 1, 1, 12, 0b0101_1100_0111, 0, 0, 0, *REST, 0, 0, 0, 0, 0
    )
    robot.tick()


def excite(robot: Client, *params: float, number: float = 0.0, sweep: tuple[float, float] = (0.0, 0.0)) -> int:
    return robot.command(EXCITE, *params, number, *sweep)


def wanted(robot: Client, ticks: int, wheel: int = 0) -> list[float]:
    return [robot.tick().actuators.wheel_reference[wheel] for _ in range(ticks)]


def test_a_step_of_one_wheel_for_so_many_ticks(robot: Client) -> None:
    still(robot.armed())
    assert excite(robot, WHEEL, 2, 0.5, 0.02) == ACCEPTED
    assert wanted(robot, 30, 1) == pytest.approx([0.5] * 20 + [0.0] * 10)


def test_a_burst_that_waits_begins_with_the_first_excited_tick(robot: Client) -> None:
    still(robot.armed())
    assert robot.command(BURST, 0.05, 1, 1, 1, 0, 1) == ACCEPTED
    robot.ticks(20)
    assert excite(robot, WHEEL, 1, 0.5, 0.02, sweep=(0.0, 50.0)) == ACCEPTED
    robot.ticks(60)
    seen = parse_burst(fetch(robot)).wheel("wheel_reference", 0)
    n = np.arange(20)
    assert len(seen) == 50
    assert seen[:20] == pytest.approx(0.5 * np.sin(np.pi * 1e-3 * 2.5 * n * (n - 1)), abs=1e-4)
    assert not any(seen[20:])


def excite_numbered(robot: Client, confirmation: int) -> int:
    """Send one excitation with a number."""
    robot.mav.command_long_send(1, 1, EXCITE, confirmation, WHEEL, 1, 0.5, 0.01, 7.0, 0.0, 0.0)
    return int(robot.wait("COMMAND_ACK", command=EXCITE).result)


def test_a_command_that_is_repeated_is_not_done_again(robot: Client) -> None:
    still(robot.armed())
    assert excite_numbered(robot, 0) == ACCEPTED
    robot.ticks(20)
    assert excite_numbered(robot, 1) == ACCEPTED
    assert not any(wanted(robot, 5))


def test_a_new_command_is_done_whatever_its_number(robot: Client) -> None:
    still(robot.armed())
    for _ in range(3):
        assert excite_numbered(robot, 0) == ACCEPTED
        assert wanted(robot, 5) == pytest.approx([0.5] * 5)
        robot.ticks(20)


def test_after_another_arming_the_same_number_is_new(robot: Client) -> None:
    for _ in range(2):
        still(robot.armed())
        assert excite(robot, WHEEL, 1, 0.5, 0.01, number=7.0) == ACCEPTED
        assert wanted(robot, 1) == pytest.approx([0.5])
        assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
        robot.ticks(3)


def test_it_can_be_ended(robot: Client) -> None:
    still(robot.armed())
    assert excite(robot, WHEEL, 0, 0.5, 10.0) == ACCEPTED
    assert wanted(robot, 2) == pytest.approx([0.5, 0.5])
    assert excite(robot, 0) == ACCEPTED
    assert not any(wanted(robot, 3))


def test_a_stop_in_the_same_tick_wins(robot: Client) -> None:
    still(robot.armed())
    assert excite(robot, WHEEL, 0, 0.5, 10.0) == ACCEPTED
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, 1) == ACCEPTED
    for tick in robot.ticks(5):
        assert not any(tick.actuators.wheel_reference)
        assert tick.actuators.state == ESTOP


@pytest.mark.parametrize(
    ("params", "sweep", "why"),
    [
        ((4, 1, 0.1, 1), (0, 0), "no such place"),
        ((1.5, 1, 0.1, 1), (0, 0), "no such place"),
        ((math.nan, 1, 0.1, 1), (0, 0), "no such place"),
        ((WHEEL, 4, 0.1, 1), (0, 0), "no such wheel or axis"),
        ((POSE, 3, 0.1, 1), (0, 0), "no such wheel or axis"),
        ((WHEEL, 1, 0.1, 0), (0, 0), "0.001 to 120 s"),
        ((WHEEL, 1, 0.1, 121), (0, 0), "0.001 to 120 s"),
        ((WHEEL, 1, 0.1, 1), (0, 401), "0 to 400 Hz"),
        ((WHEEL, 1, 0.1, 1), (-1, 1), "0 to 400 Hz"),
        ((WHEEL, 1, 3.1, 1), (0, 0), "beyond LIM_WHEEL"),
        ((WHEEL, 1, math.nan, 1), (0, 0), "beyond LIM_WHEEL"),
        ((VOLTAGE, 1, 12.5, 1), (0, 0), "beyond LIM_DUTY of BAT_V_NOM"),
        ((POSE, 0, -0.3, 1), (0, 0), "beyond half of SAFE_ERR_XY"),
        ((POSE, 2, 0.8, 1), (0, 0), "beyond half of SAFE_ERR_TH"),
        ((POSE, 0, 0.01, 1), (0, 0), "needs a held pose, or pose setpoints"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_moves(
    robot: Client, params: tuple[float, ...], sweep: tuple[float, float], why: str
) -> None:
    still(robot.armed())
    assert excite(robot, *params, sweep=sweep) == DENIED
    seen = robot.ticks(3)
    assert not any(w for tick in seen for w in tick.actuators.wheel_reference)
    said = [m.text for tick in seen for m in tick.others if m.get_type() == "STATUSTEXT"]
    assert f"not excited: {why}" in said


def test_a_robot_that_holds_its_pose_takes_no_speeds_and_one_at_rest_nothing(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(20)
    robot.inbox.clear()
    assert excite(robot, WHEEL, 1, 0.5, 1.0) == DENIED
    assert robot.wait("STATUSTEXT").text == "not excited: arm first"
    robot.armed()
    assert excite(robot, WHEEL, 1, 0.5, 1.0) == DENIED
    assert excite(robot, POSE, 0, 0.01, 1.0) == ACCEPTED
