# SPDX-License-Identifier: MIT
"""Bursts: what the tick saw, word by word, in the robot's memory and out of it again."""

from __future__ import annotations

import math
import struct
import zlib
from typing import Any

import numpy as np
import pytest

from omniwheel.burst import Burst, parse_burst
from omniwheel.errors import LogError
from tests.firmware.client import COUNTS_PER_RAD, Client, lockstep_robot, mav

BURST = mav.MAV_CMD_OMNI_BURST
ACCEPTED, DENIED = mav.MAV_RESULT_ACCEPTED, mav.MAV_RESULT_DENIED
REFERENCE, SPEED, ANGLE, POSE = 1, 2, 16, 32


def entry(robot: Client) -> Any:
    robot.mav.log_request_list_send(1, 1, 0, 0xFFFF)
    return robot.wait("LOG_ENTRY")


def piece(robot: Client, offset: int, count: int = 90, number: int = 0) -> Any:
    robot.mav.log_request_data_send(1, 1, number, offset, count)
    return robot.wait("LOG_DATA", ofs=offset)


def finished(robot: Client) -> int:
    """Return the size of the burst once it is sealed."""
    for _ in range(1000):
        if (size := entry(robot).size) > 0:
            return int(size)
        robot.tick()
    raise AssertionError("the burst was never complete")


def fetch(robot: Client) -> bytes:
    size = finished(robot)
    pieces = [piece(robot, at) for at in range(0, size, 90)]
    assert [p.count for p in pieces[:-1]] == [90] * (len(pieces) - 1)
    return b"".join(bytes(p.data[: p.count]) for p in pieces)


def burst_of(robot: Client, ticks: int, *params: float) -> tuple[Burst, list[Any]]:
    """Record while this many ticks are driven; return the burst and what the ticks answered."""
    assert robot.command(BURST, *params) == ACCEPTED
    answers = [robot.tick().actuators for _ in range(ticks)]
    return parse_burst(fetch(robot)), answers


def drive(robot: Client) -> None:
    robot.mav.set_position_target_local_ned_send(
        robot.time_us // 1000, 1, 1, 12, 0b0101_1100_0111, 0, 0, 0, 0.05, 0.02, 0, 0, 0, 0, 0, 0.2
    )


def test_a_burst_is_what_each_tick_said(robot: Client) -> None:
    robot.armed()
    drive(robot)
    burst, answers = burst_of(robot, 60, 0.05, 1, REFERENCE | POSE | ANGLE)
    told = np.array([a.wheel_reference[:3] for a in answers[:50]])
    assert np.array_equal(burst["wheel_reference"].astype(np.float32), told.astype(np.float32))
    assert np.ptp(told[:, 0]) > 0.05  # it moved
    assert np.array_equal(burst["pose"].astype(np.float32), np.array([a.pose for a in answers[:50]], dtype=np.float32))
    assert burst.start_s == answers[0].time_us * 1e-6
    assert np.allclose(burst.time_s, 1e-3 * np.arange(50))
    assert burst.complete
    assert burst.units["pose"] == ("m", "m", "rad")
    assert set(burst.signals) == {"wheel_reference", "pose", "wheel_angle"}


def test_the_next_burst_is_as_good_and_tells_which_parameters_it_began_and_ended_with(robot: Client) -> None:
    first, _ = burst_of(robot, 60, 0.05, 1, POSE)
    assert robot.command(BURST, 0.05, 1, POSE) == ACCEPTED
    robot.ticks(20)
    robot.set("ISMC_LAM_XY", 7.0)
    robot.ticks(60)
    second = parse_burst(fetch(robot))
    assert second.number == first.number + 1
    assert first.config_sequence[0] == first.config_sequence[1] == second.config_sequence[0]
    assert second.config_sequence[1] == second.config_sequence[0] + 1


def test_counts_become_angles_of_the_wheel_and_every_thins_them_out(robot: Client) -> None:
    robot.armed()
    drive(robot)
    before = list(robot.angles)
    burst, _ = burst_of(robot, 100, 0.1, 4, ANGLE, 0b010)
    assert burst.wheels == (1,)
    assert len(burst.time_s) == 25
    assert burst.period_s == pytest.approx(4e-3)
    turned = burst.wheel("wheel_angle", 1)
    assert turned[-1] == pytest.approx(robot.angles[1] - before[1], rel=0.1)
    assert np.allclose(np.diff(turned) * COUNTS_PER_RAD, np.round(np.diff(turned) * COUNTS_PER_RAD), atol=1e-3)


@pytest.mark.parametrize(
    ("params", "why"),
    [
        ((0.1, 0.0), "burst: a number is out of its range"),
        ((0.1, 1.5), "burst: a number is out of its range"),
        ((0.1, 101.0), "burst: a number is out of its range"),
        ((0.1, 1.0, 512.0), "burst: a number is out of its range"),
        ((0.1, 1.0, 0.0, 8.0), "burst: a number is out of its range"),
        ((math.nan, 1.0), "burst: a number is out of its range"),
        ((-1.0, 1.0), "burst: a number is out of its range"),
        ((100.0, 1.0), "burst too long: 2.128 s fit"),
    ],
)
def test_bad_numbers_record_nothing_and_the_last_burst_stays(
    robot: Client, params: tuple[float, ...], why: str
) -> None:
    robot.ticks(20)
    before, _ = burst_of(robot, 10, 0.01, 1, POSE)
    assert robot.command(BURST, *params) == DENIED
    robot.wait("STATUSTEXT", text=why)
    assert parse_burst(fetch(robot)).number == before.number


def test_one_at_a_time_ended_early_with_what_it_has(robot: Client) -> None:
    robot.ticks(20)
    assert robot.command(BURST, 1.0, 1, POSE) == ACCEPTED
    robot.ticks(30)
    assert entry(robot).num_logs == 0
    assert piece(robot, 0).count == 0
    assert robot.command(BURST, 1.0, 1, POSE) == DENIED
    robot.wait("STATUSTEXT", text="burst: one is being recorded")
    assert robot.command(BURST, 0.0) == ACCEPTED
    robot.tick()
    burst = parse_burst(fetch(robot))
    assert not burst.complete
    assert 25 <= len(burst.time_s) <= 35


def test_erased_it_is_gone_and_another_number_has_nothing(robot: Client) -> None:
    robot.ticks(20)
    burst_of(robot, 10, 0.01, 1, POSE)
    assert piece(robot, 0, number=1).count == 0
    assert piece(robot, 1 << 20).count == 0
    robot.mav.log_erase_send(1, 1)
    assert entry(robot).num_logs == 0
    assert piece(robot, 0).count == 0


def test_a_whole_log_asked_for_at_once_ends_with_a_short_piece(robot: Client) -> None:
    robot.ticks(20)
    burst_of(robot, 40, 0.04, 1, POSE | SPEED)
    size = finished(robot)
    robot.mav.log_request_data_send(1, 1, 0, 0, 0xFFFFFFFF)
    first = robot.wait("LOG_DATA")
    others = [m for tick in robot.ticks(30) for m in tick.others]
    pieces = [first, *(m for m in others if m.get_type() == "LOG_DATA")]
    assert [p.count for p in pieces[:-1]] == [90] * (size // 90)
    assert sum(p.count for p in pieces) == size


def test_damage_is_found(robot: Client) -> None:
    robot.ticks(20)
    assert robot.command(BURST, 0.01, 1, POSE) == ACCEPTED
    robot.ticks(12)
    data = bytearray(fetch(robot))
    assert struct.unpack("<I", data[-4:])[0] == zlib.crc32(data[:-4])
    data[100] ^= 1
    with pytest.raises(LogError, match="damaged"):
        parse_burst(bytes(data))
    for length in (0, 3, 39, 44, len(data) - 1):
        with pytest.raises(LogError):
            parse_burst(bytes(data[:length]))


def test_recording_changes_nothing_that_the_robot_does() -> None:
    said = []
    for wanted in (False, True):
        with lockstep_robot() as robot:
            robot.armed()
            if wanted:
                assert robot.command(BURST, 1.0, 1) == ACCEPTED
            else:
                assert robot.command(mav.MAV_CMD_OMNI_SET_POSE, 0.0) == DENIED  # as many frames, another command
            drive(robot)
            ticks = robot.ticks(300)
            kinds = ("COMMAND_ACK", "STATUSTEXT")
            others = [str(m) for tick in ticks for m in tick.others if m.get_type() not in kinds]
            said.append(([tick.actuators.to_dict() for tick in ticks], others))
    assert said[0][0] == said[1][0]
    assert said[0][1] == said[1][1]
