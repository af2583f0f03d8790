# SPDX-License-Identifier: MIT
"""One client commands at a time; the others are told; stops pass from any."""

from __future__ import annotations

import pytest

from omni.hub.in_command import ENDED_PAUSE_S, IDLE_S, PAUSE_S
from omni.hub.outbox import STALE_S
from omniwheel.dialect import mavlink
from omniwheel.hub import notices
from tests.hub.bench import ACCEPTED, ARM, DENIED, LATER, Bench, Station, beat, command, setpoint

STOPS = {
    "disarm": command(ARM, 0.0),
    "forced disarm": command(ARM, 0.0, 21196.0),
    "termination": command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1.0),
    "emergency stop": command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0),
    "hold": command(mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP),
    "mode hold": command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, 0.0),
    "mode of MAVSDK's hold": command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, 4.0, 3.0),
    "mode as the heartbeat has it": command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, float(4 << 16 | 3 << 24)),
}
MOVES = {
    "arm": command(ARM, 1.0),
    "trajectory": command(mavlink.MAV_CMD_OMNI_TRAJECTORY_START, -1.0, -1.0),
    "release": command(mavlink.MAV_CMD_OMNI_ESTOP, 0.0),
    "offboard": command(mavlink.MAV_CMD_DO_SET_MODE, 1.0, 6.0),
    "reboot": command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0),
}


def driven() -> tuple[Bench, Station, Station]:
    """Return a bench on which the first station drives an armed robot and the second looks on."""
    bench = Bench()
    first, second = bench.join("first"), bench.join("second")
    first.send(command(ARM, 1.0))
    bench.run()
    bench.robot_is(armed=True)
    assert first.results() == [ACCEPTED]
    return bench, first, second


def test_the_first_to_arm_commands_and_the_others_are_told() -> None:
    _, _, second = driven()
    assert "hub: first in command" in second.texts()


@pytest.mark.parametrize("name", MOVES)
def test_who_does_not_command_is_denied_with_the_reason(name: str) -> None:
    bench, _, second = driven()
    second.send(MOVES[name])
    bench.run()
    assert second.results(MOVES[name].command)[-1] == DENIED
    assert "hub: refused, first in command" in second.texts()
    assert len(bench.commands(MOVES[name].command)) == (1 if name == "arm" else 0)


def test_a_denial_carries_the_receipt_of_a_numbered_command() -> None:
    bench, _, second = driven()
    second.send(command(ARM, 1.0, count=7))
    bench.run()
    assert second.got("COMMAND_ACK")[-1].result_param2 not in (0, None)
    assert second.got("COMMAND_ACK")[-1].get_srcComponent() == 1


def test_refused_setpoints_are_said_once_in_two_seconds() -> None:
    bench, first, second = driven()
    for _ in range(100):
        first.send(beat())
        second.send(setpoint())
        bench.run(0.05)
    assert "SET_POSITION_TARGET_LOCAL_NED" not in bench.names()
    assert second.texts().count("hub: refused, first in command") == 3


@pytest.mark.parametrize("name", STOPS)
def test_a_stop_passes_from_any_client_before_everything_queued(name: str) -> None:
    bench, first, second = driven()
    bench.sent.clear()
    for number in range(20):
        first.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", number))
    first.send(setpoint(), command(mavlink.MAV_CMD_OMNI_TRAJECTORY_START, -1.0))
    second.send(STOPS[name])
    bench.run()
    assert bench.sent[0][1].command == STOPS[name].command
    assert "SET_POSITION_TARGET_LOCAL_NED" not in bench.names(), "what moves and was queued before the stop is gone"
    assert first.results(mavlink.MAV_CMD_OMNI_TRAJECTORY_START) == [DENIED]
    assert "hub: cancelled by a stop" in first.texts()
    assert second.results(STOPS[name].command)[-1] == ACCEPTED


def test_an_arm_command_said_again_after_a_stop_is_denied() -> None:
    bench = Bench()
    bench.answers = False
    first, second = bench.join("first"), bench.join("second")
    first.send(command(ARM, 1.0, count=1))
    bench.run(0.5)
    second.send(command(ARM, 0.0))
    bench.run(0.5)
    first.send(command(ARM, 1.0, count=1))
    bench.run()
    assert [message.param1 for message in bench.commands(ARM)] == [1.0, 0.0]
    assert first.results() == [DENIED]
    first.send(command(ARM, 1.0, count=2))
    bench.run()
    assert [message.param1 for message in bench.commands(ARM)] == [1.0, 0.0, 1.0], "a new one is a new decision"


def test_the_command_is_free_once_the_robot_is_not_armed() -> None:
    bench, first, second = driven()
    first.send(command(ARM, 0.0))
    bench.run()
    bench.robot_is(armed=False)
    bench.run()
    assert "hub: no client in command" in second.texts()
    second.send(command(ARM, 1.0))
    bench.run()
    assert second.results()[-1] == ACCEPTED


@pytest.mark.parametrize("name", STOPS)
def test_a_stream_that_somebody_else_stopped_does_not_get_the_command_back(name: str) -> None:
    bench, first, second = driven()
    first.send(setpoint())
    second.send(STOPS[name])
    bench.run(0.05)
    bench.robot_is(armed=name == "hold")
    second.send(command(mavlink.MAV_CMD_OMNI_ESTOP, 0.0))
    bench.run(0.05)
    bench.sent.clear()
    for _ in range(60):
        first.send(setpoint(), beat())
        bench.run(0.05)
    for _ in range(3):
        bench.run(2 * PAUSE_S)
        first.send(setpoint())
        bench.run()
    assert "SET_POSITION_TARGET_LOCAL_NED" not in bench.names(), "a program that stood still for a moment is the same"
    bench.run(ENDED_PAUSE_S)
    first.send(setpoint())
    bench.run()
    assert "SET_POSITION_TARGET_LOCAL_NED" in bench.names(), "after a long silence it may be another program"


def test_a_client_that_arms_anew_streams_anew() -> None:
    bench, first, second = driven()
    second.send(command(ARM, 0.0))
    bench.run(0.05)
    bench.robot_is(armed=False)
    first.send(command(ARM, 1.0), setpoint())
    bench.run()
    assert "SET_POSITION_TARGET_LOCAL_NED" in bench.names()


def test_the_command_is_free_once_its_client_has_gone() -> None:
    bench, first, second = driven()
    bench.leave(first)
    second.send(setpoint())
    bench.run()
    assert bench.names().count("SET_POSITION_TARGET_LOCAL_NED") == 1


def test_a_refused_stream_does_not_take_over_in_its_middle() -> None:
    bench, first, second = driven()
    second.send(setpoint())
    bench.run(0.05)
    bench.leave(first)
    for _ in range(60):
        second.send(setpoint())
        bench.run(0.05)
    assert "SET_POSITION_TARGET_LOCAL_NED" not in bench.names()
    assert "hub: refused, pause before you take over" in second.texts()
    bench.run(PAUSE_S)
    second.send(setpoint())
    bench.run()
    assert "SET_POSITION_TARGET_LOCAL_NED" in bench.names()


def test_a_client_in_command_that_heartbeats_keeps_an_armed_robot_and_a_silent_one_loses_it() -> None:
    bench, first, second = driven()
    for _ in range(20):
        first.send(beat())
        bench.run(1.0, 0.1)
    assert bench.hub.command.holder == first.number
    bench.run(IDLE_S, 0.1)
    assert bench.hub.command.holder is None
    assert "hub: no client in command" in second.texts()


def test_who_moves_a_disarmed_robot_and_goes_idle_loses_the_command_although_it_heartbeats() -> None:
    bench = Bench()
    first = bench.join("first")
    bench.robot_is(armed=False)
    first.send(setpoint())
    for _ in range(5):
        bench.run(1.0, 0.1)
        first.send(beat())
    assert bench.hub.command.holder is None


def test_an_armed_robot_hears_the_heartbeats_of_the_client_in_command_only() -> None:
    bench, first, second = driven()
    bench.sent.clear()
    for _ in range(10):
        second.send(beat())
        bench.run(0.1)
    assert "HEARTBEAT" not in bench.names()
    first.send(beat())
    bench.run()
    assert bench.names().count("HEARTBEAT") == 1
    bench.leave(first)
    for _ in range(50):
        second.send(beat())
        bench.run(0.1)
    assert bench.names().count("HEARTBEAT") == 1, "nobody's heartbeats hide that the commanding client has gone"


def test_a_disarmed_robot_hears_one_heartbeat_a_second_of_all() -> None:
    bench = Bench()
    stations = [bench.join(f"{number}") for number in range(3)]
    bench.robot_is(armed=False)
    for _ in range(100):
        for station in stations:
            station.send(beat())
        bench.run(0.1)
    assert 9 <= bench.names().count("HEARTBEAT") <= 12


def test_each_station_behind_a_hub_is_heard_while_nobody_commands() -> None:
    bench = Bench()
    stations = [bench.join("one"), bench.join("two", system=254)]
    bench.robot_is(armed=False)
    for _ in range(10):
        for station in stations:
            station.send(beat())
        bench.run(1.0, 0.1)
    systems = [message.get_srcSystem() for _, message in bench.sent if message.get_type() == "HEARTBEAT"]
    assert sorted(set(systems)) == [254, 255]
    assert systems.count(254) == systems.count(255)


def test_heartbeats_of_other_components_take_the_place_of_no_stations_heartbeat() -> None:
    bench = Bench()
    station, camera = bench.join("station"), bench.join("camera", system=42)
    bench.robot_is(armed=False)
    for _ in range(100):
        camera.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_CAMERA, 8, 0, 0, 4, 3))
        station.send(beat())
        bench.run(0.1)
    kinds = [message.type for _, message in bench.sent if message.get_type() == "HEARTBEAT"]
    assert kinds
    assert set(kinds) == {mavlink.MAV_TYPE_GCS}


def test_the_hub_never_repeats_a_setpoint() -> None:
    bench, first, _ = driven()
    first.send(setpoint())
    bench.run(5.0, 0.01)
    assert bench.names().count("SET_POSITION_TARGET_LOCAL_NED") == 1


def test_nothing_of_a_client_that_has_gone_is_sent_but_its_stop() -> None:
    bench, first, _ = driven()
    bench.sent.clear()
    first.send(setpoint(), mavlink.MAVLink_param_request_list_message(1, 1))
    bench.leave(first)
    bench.run()
    assert bench.sent == []
    third = bench.join("third")
    third.send(command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0))
    bench.leave(third)
    bench.run()
    assert len(bench.commands(mavlink.MAV_CMD_OMNI_ESTOP)) == 1


def test_without_a_port_commands_are_put_off_and_everybody_is_told() -> None:
    bench, first, second = driven()
    bench.hub.port_lost()
    first.send(command(ARM, 1.0))
    second.send(command(ARM, 0.0))
    bench.run(1.0, 0.1)
    assert first.results()[-1] == LATER
    assert second.results()[-1] == LATER
    assert "hub: port is disconnected, waiting for it" in first.texts()
    assert "hub: port is disconnected, waiting for it" in second.texts()
    bench.sent.clear()
    bench.hub.port_opened()
    bench.run(STALE_S * 2)
    assert bench.sent == [], "nothing that was asked for before is done now"
    assert second.texts()[-1] == "hub: port is connected"


def test_who_had_the_port_before_keeps_an_armed_robot() -> None:
    bench = Bench(opened=False)
    first = bench.join("127.0.0.1:1")
    first.send(mavlink.MAVLink_statustext_message(6, b"this was omni drive (1)"))
    second = bench.join("second")
    bench.hub.port_opened()
    bench.robot_is(armed=True)
    first.send(beat())
    second.send(command(ARM, 1.0))
    bench.run()
    assert second.results() == [DENIED]
    assert "hub: refused, omni drive (1) in command" in second.texts()
    assert "HEARTBEAT" in bench.names()


def test_who_had_the_port_of_a_robot_at_rest_does_not_command() -> None:
    bench = Bench(opened=False)
    first = bench.join("127.0.0.1:1")
    first.send(mavlink.MAVLink_statustext_message(6, b"this was omni monitor (1)"))
    second = bench.join("second")
    bench.hub.port_opened()
    bench.robot_is(armed=False)
    second.send(command(ARM, 1.0))
    bench.run()
    assert second.results() == [ACCEPTED]


def test_a_name_that_is_too_long_or_strange_leaves_room_for_the_text() -> None:
    bench, _, second = driven()
    first = bench.stations[0]
    first.send(mavlink.MAVLink_statustext_message(6, b"this is \x1b[31m" + b"x" * 40))
    second.send(command(ARM, 1.0))
    bench.run()
    assert f"hub: refused, {('[31m' + 'x' * 40)[:25]} in command" in second.texts()


def test_another_robot_on_the_same_radio_does_not_free_the_command() -> None:
    bench, first, _ = driven()
    other = mavlink.MAVLink(bench, 2, 1)
    for _ in range(5):
        other.heartbeat_send(mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_GENERIC, 0, 0, 4)
        first.send(beat())
        bench.robot_is(armed=True)
        bench.run(1.0, 0.1)
    assert bench.hub.command.holder == first.number


@pytest.mark.parametrize("first", [1, 2])
def test_another_robot_that_is_armed_is_kept_going_by_its_own_driver_only(first: int) -> None:
    """Two robots on the line: the hub follows the one that it heard first, a program may drive the other one."""
    bench = Bench()
    for system in (first, 3 - first):
        bench.robot_system(system)
        bench.robot_is(armed=False)
    driver, onlooker = bench.join("driver"), bench.join("onlooker", 254)
    arm = command(ARM, 1.0)
    arm.target_system = 2
    driver.send(beat(), arm)
    for second in range(12):
        for system in (1, 2):
            bench.robot_system(system)
            bench.robot_is(armed=system == 2)
        onlooker.send(beat())
        if second < 6:
            driver.send(beat())
        elif second == 6:
            bench.leave(driver)
        bench.run(1.0, 0.05)
    heard = [message.get_srcSystem() for _, message in bench.sent if message.get_type() == "HEARTBEAT"]
    assert heard.count(255) >= 6
    assert 254 not in heard


@pytest.mark.parametrize("name", STOPS)
def test_who_drives_is_told_which_program_ended_its_drive_and_that_its_setpoints_are_refused(name: str) -> None:
    bench, first, second = driven()
    second.inbox.clear()
    second.send(STOPS[name])
    bench.run()
    assert [text for text in first.texts() if "second" in text and notices.ends_drive(text)]
    assert not [text for text in second.texts() if notices.ends_drive(text)], "its own"
    first.inbox.clear()
    first.send(setpoint())
    bench.run()
    assert [text for text in first.texts() if notices.ends_drive(text)]


def test_a_robot_that_stops_by_itself_is_no_programs_doing() -> None:
    bench, first, _ = driven()
    bench.robot_is(armed=False)
    bench.run()
    assert bench.hub.command.holder is None
    assert not [text for text in first.texts() if notices.ends_drive(text)]


def test_a_stop_of_another_robot_ends_no_drive_and_takes_nothing_away() -> None:
    bench, first, second = driven()
    bench.answers = False
    bench.sent.clear()
    first.send(setpoint(), command(mavlink.MAV_CMD_OMNI_TRAJECTORY_START, -1.0, count=5))
    for number, value in ((ARM, 0.0), (mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0), (mavlink.MAV_CMD_OMNI_ESTOP, 1.0)):
        stop = command(number, value)
        stop.target_system = 2
        second.send(stop)
    bench.run()
    assert "SET_POSITION_TARGET_LOCAL_NED" in bench.names()
    first.send(setpoint(), command(mavlink.MAV_CMD_OMNI_TRAJECTORY_START, -1.0, count=5))
    bench.run()
    assert bench.hub.command.holder == first.number
    assert bench.names().count("SET_POSITION_TARGET_LOCAL_NED") == 2
    assert len(bench.commands(mavlink.MAV_CMD_OMNI_TRAJECTORY_START)) == 2
    assert not [text for text in first.texts() if notices.ends_drive(text)]
    everybody = command(ARM, 0.0)
    everybody.target_system = 0
    second.send(everybody)
    bench.run()
    assert bench.hub.command.holder is None


def test_a_stop_ends_the_drive_of_a_program_that_was_silent_for_a_while() -> None:
    """Its robot waits longer for it than the hub does, and it would go on after the stop."""
    bench, first, second = driven()
    bench.run(2 * IDLE_S, 0.1)
    assert bench.hub.command.holder is None
    second.send(STOPS["hold"])
    bench.run()
    bench.sent.clear()
    first.send(setpoint())
    bench.run()
    assert "SET_POSITION_TARGET_LOCAL_NED" not in bench.names()
    assert [text for text in first.texts() if notices.ends_drive(text)]
