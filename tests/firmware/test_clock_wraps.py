# SPDX-License-Identifier: MIT
"""A robot that has been on for weeks does what it does after ten seconds, also while a 32-bit time wraps.

In lockstep the robot's clock is the host's, so a session can begin at any time. The same session, shifted, must give
the same bytes but for the times in them.
"""

from __future__ import annotations

from typing import Any

import pytest

from tests.firmware.client import Client, lockstep_robot, mav

MILLISECOND = 1000
EARLY_US = 10_000_000
BEFORE_US = 303_000
"""Before the wrap a session begins, so that it happens while it drives. No fix is stamped 0: that means unknown."""
WRAPS = {
    "31 bits of microseconds (36 minutes)": 2**31,
    "32 bits of microseconds (72 minutes)": 2**32,
    "32 bits of 10 us (12 hours)": 2**32 * 10,
    "31 bits of milliseconds (25 days)": 2**31 * MILLISECOND,
    "32 bits of milliseconds (50 days)": 2**32 * MILLISECOND,
}
TIMES = ("time_boot_ms", "time_usec", "time_us")


def timeless(message: Any) -> str:
    """As text, in which a NaN equals itself."""
    return repr({name: value for name, value in message.to_dict().items() if name not in TIMES})


def fix(robot: Client, age_ms: int, x_mm: int) -> None:
    stamp = (robot.time_us // MILLISECOND - age_ms) % 2**32
    robot.mav.omni_pose_fix_send(stamp, x_mm, 0, 0)


def drive(robot: Client) -> list[str]:
    """Arm, drive ahead with late pose fixes of known age, follow a trajectory, disarm; return what was answered."""
    seen = []

    def ticks(count: int) -> None:
        for tick in robot.ticks(count):
            seen.append(timeless(tick.actuators))
            seen.extend(timeless(message) for message in tick.others)

    robot.set("FIX_DELAY", 0.0)
    robot.inbox.clear()
    ticks(50)
    robot.heartbeat()
    ticks(10)
    assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1) == mav.MAV_RESULT_ACCEPTED
    for number in range(40):
        robot.mav.set_position_target_local_ned_send(
            0, 1, 1, mav.MAV_FRAME_BODY_FRD, 0b0000_0101_1100_0111, 0, 0, 0, 0.3, 0, 0, 0, 0, 0, 0, 0
        )
        fix(robot, age_ms=80, x_mm=3 * number)
        ticks(10)
    robot.heartbeat()
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 3, -1) == mav.MAV_RESULT_ACCEPTED
    for _ in range(20):
        ticks(10)
    assert robot.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mav.MAV_RESULT_ACCEPTED
    ticks(20)
    return seen


def session(start_us: int) -> list[str]:
    with lockstep_robot() as robot:
        robot.time_us = start_us
        return drive(robot)


@pytest.fixture(scope="module")
def early(board: str) -> list[str]:
    return session(EARLY_US)


@pytest.mark.parametrize("wrap_us", WRAPS.values(), ids=WRAPS.keys())
def test_a_session_over_a_wrap_is_the_same_as_after_ten_seconds(wrap_us: int, early: list[str]) -> None:
    start_us = (wrap_us - BEFORE_US) // MILLISECOND * MILLISECOND
    late = session(start_us)
    assert [a for a, b in zip(late, early, strict=True) if a != b] == []
    assert any("'state': 2" in message for message in late)
