# SPDX-License-Identifier: MIT
"""Who gets what: the robot's frames unchanged to all, answers to who asked, parameters to everybody."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from omniwheel.dialect import mavlink
from tests.hub.bench import ACCEPTED, ARM, DENIED, WIDE, Bench, beat, command, setpoint

REBOOT_INFO = mavlink.MAV_CMD_REQUEST_MESSAGE


def test_the_robots_frames_reach_every_client_byte_by_byte() -> None:
    bench = Bench()
    stations = [bench.join("first"), bench.join("second")]
    bench.robot_is(armed=False)
    bench.robot_sends(mavlink.MAVLink_attitude_message(1, 2, 3, 4, 5, 6, 7))
    bench.run()
    for station in stations:
        assert [(m.get_type(), m.get_seq(), m.get_srcSystem()) for m in station.inbox] == [
            ("HEARTBEAT", 0, 1),
            ("ATTITUDE", 1, 1),
        ]
    assert stations[0].raw == stations[1].raw


def test_a_clients_frame_reaches_the_robot_as_it_was_sent() -> None:
    bench = Bench()
    station = bench.join("first", system=200)
    message = mavlink.MAVLink_param_set_message(1, 1, b"WS_P", 4.0, 9)
    message.pack(station.codec)
    wanted = bytes(message.get_msgbuf())
    bench.hub.from_client(station.number, wanted)
    bench.run()
    assert [frame for _, frame in bench.frames] == [wanted]


def test_a_changed_parameter_is_seen_by_all() -> None:
    bench = Bench()
    first, second = bench.join("first"), bench.join("second")
    first.send(mavlink.MAVLink_param_set_message(1, 1, b"WS_P", 4.0, 9))
    bench.run()
    bench.robot_sends(mavlink.MAVLink_param_value_message(b"WS_P", 4.0, 9, 10, 65535))
    bench.run()
    assert len(first.got("PARAM_VALUE")) == len(second.got("PARAM_VALUE")) == 1


def test_two_clients_with_the_same_question_each_get_one_answer() -> None:
    bench = Bench()
    bench.answers = False
    first, second, third = bench.join("first"), bench.join("second"), bench.join("third")
    first.send(command(REBOOT_INFO, 148.0))
    second.send(command(REBOOT_INFO, 148.0))
    bench.run()
    bench.robot_sends(mavlink.MAVLink_command_ack_message(REBOOT_INFO, ACCEPTED, 0, 0, 255, 190))
    bench.run()
    assert (first.results(REBOOT_INFO), second.results(REBOOT_INFO)) == ([ACCEPTED], [])
    assert third.results(REBOOT_INFO) == [ACCEPTED], "who waits for nothing may know it"
    bench.robot_sends(mavlink.MAVLink_command_ack_message(REBOOT_INFO, ACCEPTED, 0, 0, 255, 190))
    bench.run()
    assert second.results(REBOOT_INFO) == [ACCEPTED]


@pytest.mark.parametrize("source", [(1, 191), (1, 241), (2, 1)])
def test_what_others_than_the_robot_answer_is_no_answer(source: tuple[int, int]) -> None:
    bench = Bench()
    bench.answers = False
    first, second = bench.join("first"), bench.join("second")
    bench.robot_is(armed=False)
    first.send(command(REBOOT_INFO, 148.0))
    bench.run()
    acknowledgement = mavlink.MAVLink_command_ack_message(REBOOT_INFO, DENIED, 0, 0, 255, 190)
    bench.hub.from_port(bytes(acknowledgement.pack(mavlink.MAVLink(None, *source))))
    second.send(command(REBOOT_INFO, 148.0))
    bench.run()
    bench.robot_sends(mavlink.MAVLink_command_ack_message(REBOOT_INFO, ACCEPTED, 0, 0, 255, 190))
    bench.run()
    assert first.results(REBOOT_INFO)[-1] == ACCEPTED
    assert ACCEPTED not in second.results(REBOOT_INFO)


@pytest.mark.parametrize("source", [(1, 191), (1, 241), (2, 1)])
def test_a_parameter_of_another_component_ends_no_request(source: tuple[int, int]) -> None:
    bench = Bench()
    first, second = bench.join("first"), bench.join("second")
    bench.robot_is(armed=False)
    first.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WS_P", -1))
    bench.run()
    value = mavlink.MAVLink_param_value_message(b"WS_P", 4.0, 9, 10, 3)
    bench.hub.from_port(bytes(value.pack(mavlink.MAVLink(None, *source))))
    second.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WS_P", -1))
    bench.run()
    assert bench.names().count("PARAM_REQUEST_READ") == 1


def test_a_broadcast_goes_to_the_other_clients_too_but_not_back() -> None:
    bench = Bench()
    first, second = bench.join("first"), bench.join("second")
    first.send(beat())
    bench.run()
    assert len(second.got("HEARTBEAT")) == 1
    assert first.got("HEARTBEAT") == []


def test_a_message_for_another_clients_system_goes_there_and_not_to_the_robot() -> None:
    bench = Bench()
    first, camera, third = bench.join("first"), bench.join("camera", system=42), bench.join("third")
    camera.send(beat())
    bench.run(1.0, 0.1)
    bench.sent.clear()
    first.send(mavlink.MAVLink_command_long_message(42, 100, 2000, 0, 0, 0, 0, 0, 0, 0, 0))
    bench.run()
    assert len(camera.got("COMMAND_LONG")) == 1
    assert third.got("COMMAND_LONG") == []
    assert bench.sent == []


def test_the_hub_speaks_as_a_component_of_its_own_of_the_robots_system() -> None:
    bench = Bench()
    bench.robot_is(armed=False)
    bench.hub.port_lost()
    station = bench.join("first")
    bench.run()
    (text,) = station.got("STATUSTEXT")
    assert (text.get_srcSystem(), text.get_srcComponent()) == (1, mavlink.MAV_COMP_ID_UART_BRIDGE)


@pytest.mark.parametrize("new", [2, 254])
def test_a_robot_that_gets_another_number_is_followed_at_once(new: int) -> None:
    bench = Bench()
    driver = bench.join("driver")
    bench.robot_is(armed=False)
    driver.send(mavlink.MAVLink_param_set_message(1, 1, b"SYS_ID", float(new), mavlink.MAV_PARAM_TYPE_REAL32))
    bench.robot_system(new)
    bench.robot_is(armed=False)
    driver.send(command(ARM, 1.0))
    bench.run()
    bench.robot_is(armed=True)
    assert bench.hub.command.armed
    bench.robot_is(armed=False)
    assert bench.hub.command.holder is None


def test_a_robot_whose_number_nobody_asked_for_is_another_one() -> None:
    bench = Bench()
    bench.robot_is(armed=False)
    bench.robot_system(2)
    bench.robot_is(armed=True)
    assert not bench.hub.command.armed


def test_a_robot_that_refused_another_number_is_not_taken_for_the_one_that_has_it() -> None:
    bench = Bench()
    driver = bench.join("driver")
    bench.robot_is(armed=False)
    driver.send(mavlink.MAVLink_param_set_message(1, 1, b"SYS_ID", 2.0, mavlink.MAV_PARAM_TYPE_REAL32))
    bench.robot_sends(mavlink.MAVLink_param_value_message(b"SYS_ID", 1.0, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))
    bench.robot_system(2)
    bench.robot_is(armed=True)
    assert not bench.hub.command.armed


# ---- several robots behind one port


def to_system(system: int, message: Any) -> Any:
    """Return the same message for another system."""
    for field in ("target_system", "target"):
        if hasattr(message, field):
            setattr(message, field, system)
    return message


ONE_EACH: dict[str, Callable[[], Any]] = {
    "e-stop": lambda: command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0),
    "disarm": lambda: command(ARM, 0.0),
    "hold": lambda: command(mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP),
    "numbered command": lambda: command(REBOOT_INFO, 148.0, count=7),
    "setpoint": setpoint,
    "sticks": lambda: mavlink.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0),
    "list": lambda: mavlink.MAVLink_param_request_list_message(1, 1),
    "parameter": lambda: mavlink.MAVLink_param_request_read_message(1, 1, b"MOT_R", -1),
    "rate": lambda: command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 30.0, 100_000.0),
}


@pytest.mark.parametrize("name", ONE_EACH)
def test_what_is_for_one_robot_does_not_take_the_place_of_what_is_for_another(name: str) -> None:
    bench = Bench()
    station = bench.join("first")
    bench.robot_is(armed=False)
    station.send(*(to_system(system, ONE_EACH[name]()) for system in (1, 2)))
    bench.run()
    sent = [getattr(message, "target_system", getattr(message, "target", None)) for _, message in bench.sent]
    assert sent == [1, 2]


def test_a_stop_reaches_the_robot_though_a_program_uses_its_system_id() -> None:
    """MAVROS does so unless told otherwise."""
    bench = Bench(replace(WIDE, system_id=7))
    station, other = bench.join("first"), bench.join("mavros", system=1)
    other.send(beat())
    bench.run()
    bench.sent.clear()
    station.send(command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0))
    bench.run()
    assert [message.get_type() for _, message in bench.sent] == ["COMMAND_LONG"]
    assert len(other.got("COMMAND_LONG")) == 1


@pytest.mark.parametrize("name", [*sorted(ONE_EACH.keys() - {"rate"}), "parameter to set"])
@pytest.mark.parametrize("system", [1, 2], ids=["the robot that is followed", "another robot"])
def test_what_is_for_a_robot_reaches_it_though_a_program_uses_its_system_id(system: int, name: str) -> None:
    """As a companion computer or MAVROS does. Both get it."""
    bench = Bench()
    station, companion = bench.join("first"), bench.join("companion", system=system)
    for number in (1, 2):
        bench.robot_system(number)
        bench.robot_is(armed=False)
    companion.send(beat())
    bench.run()
    bench.sent.clear()
    companion.inbox.clear()
    wanted = ONE_EACH.get(name, lambda: mavlink.MAVLink_param_set_message(1, 1, b"WS_P", 4.0, 9))()
    station.send(to_system(system, wanted))
    bench.run()
    targets = [getattr(message, "target_system", getattr(message, "target", None)) for _, message in bench.sent]
    assert targets == [system]
    assert len(companion.got(wanted.get_type())) == 1


def test_a_program_reaches_its_robot_under_their_common_system_id_before_the_robot_is_heard() -> None:
    bench = Bench()
    bench.robot_is(armed=False)
    companion = bench.join("companion", system=2)
    companion.send(to_system(2, command(ARM, 1.0)))
    bench.run()
    assert len(bench.commands(ARM)) == 1
