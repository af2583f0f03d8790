# SPDX-License-Identifier: MIT
"""Protocols that the robot does not speak: it refuses in their own words, and leaves calls to everybody alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.firmware.client import Client, mav

UNSUPPORTED = mav.MAV_MISSION_UNSUPPORTED
FENCE = mav.MAV_MISSION_TYPE_FENCE
Ask = Callable[[Any, int], None]

MISSIONS: dict[str, Ask] = {
    "upload": lambda m, to: m.mission_count_send(to, 1, 3, FENCE),
    "item": lambda m, to: m.mission_item_send(to, 1, 0, 0, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, FENCE),
    "item int": lambda m, to: m.mission_item_int_send(to, 1, 0, 0, 16, 0, 1, 0, 0, 0, 0, 0, 0, 0, FENCE),
    "request": lambda m, to: m.mission_request_send(to, 1, 0, FENCE),
    "request int": lambda m, to: m.mission_request_int_send(to, 1, 0, FENCE),
    "partial list": lambda m, to: m.mission_request_partial_list_send(to, 1, 0, 1, FENCE),
    "partial write": lambda m, to: m.mission_write_partial_list_send(to, 1, 0, 1, FENCE),
    "clear": lambda m, to: m.mission_clear_all_send(to, 1, FENCE),
}
OTHERS: dict[str, Ask] = {
    "set current": lambda m, to: m.mission_set_current_send(to, 1, 0),
    "log list": lambda m, to: m.log_request_list_send(to, 1, 0, 0xFFFF),
    "log data": lambda m, to: m.log_request_data_send(to, 1, 7, 90, 90),
    "log erase": lambda m, to: m.log_erase_send(to, 1),
    "file": lambda m, to: m.file_transfer_protocol_send(0, to, 1, [0] * 251),
}


@pytest.mark.parametrize("ask", MISSIONS.values(), ids=MISSIONS.keys())
def test_missions_are_refused_with_their_own_acknowledgement(robot: Client, ask: Ask) -> None:
    ask(robot.mav, 1)
    ack = robot.wait("MISSION_ACK")
    assert (ack.type, ack.mission_type) == (UNSUPPORTED, FENCE)
    assert (ack.target_system, ack.target_component) == (255, 190)


def test_the_list_of_missions_is_empty(robot: Client) -> None:
    robot.mav.mission_request_list_send(1, 1, FENCE)
    answer = robot.wait("MISSION_COUNT")
    assert (answer.count, answer.mission_type) == (0, FENCE)


def test_there_are_no_logs_and_no_current_item(robot: Client) -> None:
    robot.mav.mission_set_current_send(1, 1, 0)
    assert robot.wait("MISSION_ACK").type == UNSUPPORTED
    robot.mav.log_request_list_send(1, 1, 0, 0xFFFF)
    entry = robot.wait("LOG_ENTRY")
    assert (entry.num_logs, entry.last_log_num) == (0, 0)
    robot.mav.log_request_data_send(1, 1, 7, 90, 90)
    data = robot.wait("LOG_DATA")
    assert (data.id, data.ofs, data.count) == (7, 90, 0)
    robot.mav.log_erase_send(1, 1)
    robot.wait("STATUSTEXT", text="there are no logs to erase")


def test_unknown_commands_are_acknowledged_as_unsupported(robot: Client) -> None:
    for command in (16, 20, 22, 511 + 1000, 31_000, 65_535):
        assert robot.command(command) == mav.MAV_RESULT_UNSUPPORTED


@pytest.mark.parametrize("ask", [*MISSIONS.values(), *OTHERS.values()], ids=[*MISSIONS, *OTHERS])
@pytest.mark.parametrize("to", [0, 9], ids=["everybody", "another robot"])
def test_what_everybody_or_another_robot_was_asked_is_not_refused(robot: Client, ask: Ask, to: int) -> None:
    robot.tick()
    robot.inbox.clear()
    ask(robot.mav, to)
    robot.mav.ping_send(1, 5, 0, 0)
    robot.wait("PING", seq=5)
    assert [m.get_type() for m in robot.inbox] == []
