# SPDX-License-Identifier: MIT
"""A slow radio is not flooded by three programs at once, and a stop does not wait for them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest

from omni.hub.addresses import SHARE
from omni.hub.core import HubSettings
from omniwheel.dialect import mavlink
from omniwheel.robots import parameter_table
from tests.hub.bench import ARM, LATER, Bench, beat, command, setpoint
from tests.hub.budget import BAUD, Result, run

STOP_S = 0.2
"""From an emergency stop to its last byte on a 9600-baud line, as docs/guides/hub.md says."""


@pytest.fixture(scope="module", params=[False, True], ids=["open", "signed"])
def crowded(request: pytest.FixtureRequest) -> Result:
    return run(20.0, 1, signed=request.param)


@pytest.mark.full
def test_three_programs_stay_inside_the_byte_budget_at_any_time(crowded: Result) -> None:
    assert crowded.excess_bytes <= 0.0
    assert 0.8 * SHARE * BAUD / 10 < crowded.bytes_s <= SHARE * BAUD / 10


@pytest.mark.full
def test_setpoints_come_often_enough_for_the_robot_to_drive(crowded: Result) -> None:
    assert crowded.gap_s < parameter_table()["SAFE_CMD_TO"].default


def test_an_emergency_stop_is_on_the_line_in_time_although_the_budget_is_spent(crowded: Result) -> None:
    assert len(crowded.stop_s) >= 5
    assert max(crowded.stop_s) < STOP_S


def test_a_program_that_asks_for_too_much_is_told_and_still_served(crowded: Result) -> None:
    assert crowded.told
    assert crowded.read > 10


NAN_HOLD = mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP
SLOW = HubSettings("radio", 480.0, 100.0)


def test_of_setpoints_only_the_newest_waits() -> None:
    bench = Bench(SLOW)
    station = bench.join("first")
    for speed in range(20):
        station.send(setpoint(float(speed)))
    bench.run(1.0)
    assert [message.vx for _, message in bench.sent] == [19.0]


def test_an_old_setpoint_is_not_sent_but_said() -> None:
    bench = Bench(SLOW)
    driver = bench.join("first")
    driver.send(*(mavlink.MAVLink_ping_message(number, 0, 1, 1) for number in range(20)), setpoint())
    bench.run(3.0)
    assert "SET_POSITION_TARGET_LOCAL_NED" not in bench.names()
    assert "hub: link is full, 1 dropped" in driver.texts()


def test_commands_that_do_not_fit_are_put_off() -> None:
    bench = Bench(SLOW)
    station = bench.join("first")
    for number in range(1, 101):
        station.send(command(mavlink.MAV_CMD_REQUEST_MESSAGE, 148.0, count=number))
    bench.run(0.01)
    assert station.results(mavlink.MAV_CMD_REQUEST_MESSAGE).count(LATER) > 50
    assert any("dropped" in text for text in station.texts())


def test_a_frame_larger_than_the_burst_goes_out_when_nothing_else_does() -> None:
    bench = Bench(SLOW)
    station = bench.join("first")
    payload = bytes(range(1, 252))
    station.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(payload)))
    bench.run(1.0)
    assert bench.names() == ["FILE_TRANSFER_PROTOCOL"]


def test_a_command_said_again_while_it_waits_goes_out_once() -> None:
    bench = Bench(SLOW)
    bench.answers = False
    station = bench.join("first")
    station.send(*(mavlink.MAVLink_ping_message(number, 0, 1, 1) for number in range(8)))
    for _ in range(3):
        station.send(command(ARM, 1.0, count=1))
        bench.run(0.001)
    bench.run(3.0)
    assert len(bench.commands(ARM)) == 1


def at_robot(system: int, number: int, value: float) -> Any:
    message = command(number, value)
    message.target_system = system
    return message


@pytest.mark.parametrize("flood", [ARM, NAN_HOLD, mavlink.MAV_CMD_OMNI_ESTOP], ids=["disarm", "hold", "e-stop"])
@pytest.mark.parametrize("stop", [ARM, NAN_HOLD, mavlink.MAV_CMD_OMNI_ESTOP], ids=["disarm", "hold", "e-stop"])
def test_one_programs_stops_for_many_robots_hold_back_no_other_programs_stop(stop: int, flood: int) -> None:
    bench = Bench(SLOW)
    bench.answers = False
    many, other = bench.join("many"), bench.join("other")
    values = {mavlink.MAV_CMD_OMNI_ESTOP: 1.0}
    for system in range(2, 255):
        many.send(at_robot(system, flood, values.get(flood, 0.0)))
    bench.run(0.01)
    other.send(at_robot(1, stop, values.get(stop, 0.0)))
    asked_s = bench.now_s
    bench.run(60.0, 0.005)
    (sent_s,) = [at_s for at_s, message in bench.sent if message.target_system == 1]
    assert sent_s - asked_s < 1.0
    assert sorted(message.target_system for _, message in bench.sent) == list(range(1, 255)), "no stop is lost"


def test_stops_of_as_many_programs_take_turns() -> None:
    bench = Bench(SLOW)
    bench.answers = False
    stations = [bench.join(f"station {at}") for at in range(3)]
    for at, station in enumerate(stations):
        for system in range(2, 12):
            station.send(at_robot(20 * at + system, ARM, 0.0))
    bench.run(20.0, 0.005)
    senders = [message.target_system // 20 for _, message in bench.sent]
    assert all(set(senders[at : at + 3]) == {0, 1, 2} for at in range(0, 30, 3))


URGENT = [(mavlink.MAV_CMD_OMNI_ESTOP, 1.0), (mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1.0), (ARM, 0.0)]


@pytest.mark.parametrize("clients", [1, 50])
@pytest.mark.parametrize(("number", "value"), URGENT)
def test_holds_with_nan_in_unused_fields_keep_no_stop_waiting(number: int, value: float, clients: int) -> None:
    bench = Bench(SLOW)
    bench.answers = False
    stations = [bench.join(f"station {at}") for at in range(clients)]
    for at in range(50):
        stations[at % clients].send(command(NAN_HOLD, math.nan, math.nan, math.nan, math.nan))
    bench.join("calm").send(command(number, value))
    bench.run(STOP_S)
    assert bench.sent[0][1].command == number


def test_an_emergency_stop_goes_before_a_disarm_before_a_hold() -> None:
    bench = Bench(SLOW)
    station = bench.join("first")
    for number, value in [(NAN_HOLD, 0.0), (ARM, 0.0), (mavlink.MAV_CMD_OMNI_ESTOP, 1.0)]:
        station.send(command(number, value))
    bench.run(1.0)
    assert [message.command for _, message in bench.sent] == [mavlink.MAV_CMD_OMNI_ESTOP, ARM, NAN_HOLD]


def test_a_flood_of_holds_does_not_starve_the_heartbeats() -> None:
    bench = Bench(SLOW)
    bench.answers = False
    station = bench.join("first")
    for step in range(3000):
        station.send(command(NAN_HOLD, math.nan))
        if step % 100 == 0:
            station.send(beat())
        bench.run(0.001)
    beats_s = [at_s for at_s, message in bench.sent if message.get_type() == "HEARTBEAT"]
    assert max(after - before for before, after in itertools.pairwise([0.0, *beats_s, bench.now_s])) < 1.5
    assert sum(len(frame) for _, frame in bench.frames) < 3.0 * SLOW.bytes_s + 400


@pytest.mark.full
def test_a_flood_of_stops_does_not_fill_the_line_and_another_programs_stop_still_gets_through() -> None:
    bench = Bench(SLOW)
    mad, calm = bench.join("mad"), bench.join("calm")
    for step in range(5000):
        mad.send(command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0, count=step + 1))
        if step == 2500:
            calm.send(command(ARM, 0.0))
            asked_s = bench.now_s
        bench.run(0.001)
    (sent_s,) = [at_s for at_s, message in bench.sent if message.command == ARM]
    assert sent_s - asked_s < STOP_S
    assert sum(len(frame) for _, frame in bench.frames) < 5.0 * SLOW.bytes_s + 400
