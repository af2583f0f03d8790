# SPDX-License-Identifier: MIT
"""The streams of signed frames that the robot remembers: none is shut out by others, and no recording is taken."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from omniwheel.dialect import mavlink
from tests.radio.memory_robot import RADIO, MemoryRobot
from tests.radio.station import ARM, KEY, START, Station, state_of, usb

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
MINUTE = 6_000_000
FULL_HOUSE = 16
"""Streams that the robot remembers."""


@pytest.fixture
def robot() -> Iterator[MemoryRobot]:
    """A robot whose key is set and which is ready to be armed."""
    with MemoryRobot() as robot:
        robot.run(100)
        assert any("set" in text for text in usb(robot).give_key(KEY))
        robot.run(2000)
        robot.read(RADIO)  # what was on the line before
        yield robot


def refused(robot: MemoryRobot) -> tuple[int, int, int]:
    status = usb(robot).signing_status()
    return status.refused_unsigned, status.refused_wrong, status.refused_replayed


def test_many_streams_over_time_find_room_and_old_ones_stay_refused(robot: MemoryRobot) -> None:
    first = Station(robot, key=KEY, time=START, link_id=0)
    assert first.command(ARM, 0) == ACCEPTED
    for number in range(1, 60):
        station = Station(robot, key=KEY, time=START + number * MINUTE // 4, link_id=number)
        assert station.command(ARM, 0) == ACCEPTED, number
    robot.write(first.port, first.frames[0])
    robot.run(100)
    assert refused(robot) == (0, 0, 1)


def now(robot: MemoryRobot) -> int:
    """Return the robot's signing clock, which those of programs agree with."""
    return int(usb(robot).signing_status().time) // 10


def many(robot: MemoryRobot, count: int) -> list[Station]:
    """Let so many programs arm and disarm one after the other, within a few seconds; each is a stream of its own."""
    stations = []
    for number in range(count):
        stations.append(Station(robot, key=KEY, time=now(robot), link_id=number))
        assert does(robot, stations[-1], 1), number
        assert does(robot, stations[-1], 0), number
    return stations


def does(robot: MemoryRobot, station: Station, arm: int) -> bool:
    """Return whether the robot arms or disarms as it is asked; a new program may miss the answer in half a frame."""
    station.mav.command_long_send(1, 1, ARM, 0, arm, 0, 0, 0, 0, 0, 0)
    robot.run(50)
    return bool(state_of(robot) == ("armed" if arm else "disarmed"))


def test_a_new_stream_is_admitted_however_many_came_before_it(robot: MemoryRobot) -> None:
    many(robot, 3 * FULL_HOUSE)
    assert refused(robot) == (0, 0, 0)


def test_no_recording_of_a_stream_that_made_room_is_taken(robot: MemoryRobot) -> None:
    stations = many(robot, 2 * FULL_HOUSE)
    recording = [frame for station in stations for frame in station.frames]
    for frame in recording:
        robot.write(RADIO, frame)
        robot.run(20)
        assert state_of(robot) == "disarmed"
    assert refused(robot) == (0, 0, len(recording))


def test_a_stream_that_made_room_goes_on_with_its_next_frame(robot: MemoryRobot) -> None:
    first, *_ = many(robot, FULL_HOUSE + 1)
    first.mav.signing.timestamp = now(robot)
    assert does(robot, first, 1)
    assert refused(robot) == (0, 0, 0)


def test_the_stream_that_makes_room_is_the_one_that_was_silent_for_longest(robot: MemoryRobot) -> None:
    """So a program whose clock is a little behind is still admitted, and one that goes on keeps its place."""
    busy = Station(robot, key=KEY, time=now(robot), link_id=200)
    half_way = 0
    for number in range(2 * FULL_HOUSE):
        assert does(robot, Station(robot, key=KEY, time=now(robot), link_id=number), 1)
        busy.mav.signing.timestamp = now(robot)
        assert does(robot, busy, 0)
        half_way = now(robot) if number == FULL_HOUSE + 1 else half_way
    assert does(robot, Station(robot, key=KEY, time=half_way, link_id=201), 1)


def test_a_stop_of_a_new_stream_inside_an_unfinished_frame_acts(robot: MemoryRobot) -> None:
    """It is looked at twice: at once and when it is its turn."""
    *_, last = many(robot, FULL_HOUSE)
    last.mav.signing.timestamp = now(robot)
    assert does(robot, last, 1)
    robot.write(RADIO, last.frames[0][:14])
    assert does(robot, Station(robot, key=KEY, time=now(robot), link_id=99), 0)
    robot.run(1000)
    assert refused(robot) == (0, 0, 0)


def test_a_clock_that_is_set_back_admits_new_streams_also_after_many(robot: MemoryRobot) -> None:
    assert Station(robot, key=KEY, time=START + 60 * MINUTE, link_id=180).command(ARM, 0) == ACCEPTED
    many(robot, FULL_HOUSE + 4)
    usb(robot).give_key(KEY, START + MINUTE)
    robot.run(3000)
    robot.read(RADIO)
    assert does(robot, Station(robot, key=KEY, time=START + 2 * MINUTE, link_id=150), 1)
