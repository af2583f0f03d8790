# SPDX-License-Identifier: MIT
"""Answers of the small protocols, field by field, against the words of MAVLink's own guides."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.firmware.client import GCS, mav
from tests.firmware.fake_robot import RADIO, USB, FakeRobot, frame

NAK, NOT_FOUND, UNKNOWN_COMMAND, OPEN = 129, 10, 7, 4
STATION = 190
"""Component of the station in every frame() here."""


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot().ready()
    one.look()
    yield one
    one.close()


def answers(robot: FakeRobot, port: int, request: bytes, name: str) -> list[Any]:
    """Return what the robot says to a request in messages of one name, without a tick."""
    robot.look()
    robot.said[port].clear()
    robot.send(port, request)
    robot.background()
    robot.look()
    return [message for message in robot.said[port] if message.get_type() == name]


def file_request(sequence: int, session: int, opcode: int) -> bytes:
    payload = [sequence & 0xFF, sequence >> 8, session, opcode, 3, 0, 0, 0, 11, 12, 13, 14, 15, 16, 17]
    return frame("file_transfer_protocol", 0, 1, 1, payload + [0] * (251 - len(payload)))


@pytest.mark.parametrize("opcode", [0, 1, OPEN, 5, 13, 127])
@pytest.mark.parametrize(("sequence", "session"), [(0, 0), (0x00FF, 1), (0x1234, 77), (0x8000, 255), (0xFFFF, 3)])
def test_a_file_request_is_answered_with_the_next_number_of_its_session(
    robot: FakeRobot, sequence: int, session: int, opcode: int
) -> None:
    (nak,) = answers(robot, RADIO, file_request(sequence, session, opcode), "FILE_TRANSFER_PROTOCOL")
    following = (sequence + 1) % 65536
    wanted = [following % 256, following // 256, session, NAK, 1, opcode, 0, 0, 0, 0, 0, 0]
    wanted.append(NOT_FOUND if opcode == OPEN else UNKNOWN_COMMAND)
    assert list(nak.payload) == wanted + [0] * (251 - len(wanted))
    assert (nak.target_system, nak.target_component, nak.target_network) == (GCS, STATION, 0)


@pytest.mark.parametrize("opcode", [128, NAK, 255])
def test_an_answer_about_files_is_not_answered(robot: FakeRobot, opcode: int) -> None:
    assert answers(robot, RADIO, file_request(5, 1, opcode), "FILE_TRANSFER_PROTOCOL") == []


def test_a_ping_to_everybody_comes_back_to_its_sender_and_an_answer_does_not(robot: FakeRobot) -> None:
    (pong,) = answers(robot, RADIO, frame("ping", 123_456_789, 17, 0, 0), "PING")
    assert (pong.time_usec, pong.seq) == (123_456_789, 17)
    assert (pong.target_system, pong.target_component) == (GCS, STATION)
    assert answers(robot, RADIO, frame("ping", 123_456_789, 17, 1, 1), "PING") == []


def test_the_robots_clock_in_nanoseconds_and_only_for_who_asks(robot: FakeRobot) -> None:
    (first,) = answers(robot, USB, frame("timesync", 0, 987_654_321), "TIMESYNC")
    assert first.ts1 == 987_654_321
    robot.tick(250)
    (second,) = answers(robot, USB, frame("timesync", 0, 5), "TIMESYNC")
    assert second.tc1 - first.tc1 == 250 * 1_000_000
    assert answers(robot, USB, frame("timesync", 1, 5), "TIMESYNC") == []


def test_only_the_asker_is_answered_about_missions_and_logs(robot: FakeRobot) -> None:
    fence = mav.MAV_MISSION_TYPE_FENCE
    (count,) = answers(robot, RADIO, frame("mission_request_list", 1, 1, fence), "MISSION_COUNT")
    assert (count.target_system, count.target_component, count.count) == (GCS, STATION, 0)
    (ack,) = answers(robot, RADIO, frame("mission_clear_all", 1, 1, fence), "MISSION_ACK")
    assert (ack.target_system, ack.target_component, ack.mission_type) == (GCS, STATION, fence)
    (ack,) = answers(robot, RADIO, frame("mission_set_current", 1, 1, 0), "MISSION_ACK")
    assert ack.mission_type == mav.MAV_MISSION_TYPE_MISSION
    (data,) = answers(robot, RADIO, frame("log_request_data", 1, 1, 7, 90, 90), "LOG_DATA")
    assert (data.id, data.ofs, data.count) == (7, 90, 0)
    robot.look()
    assert {m.get_type() for m in robot.said[USB]}.isdisjoint({"MISSION_COUNT", "MISSION_ACK", "LOG_DATA"})
