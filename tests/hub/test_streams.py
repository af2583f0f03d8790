# SPDX-License-Identifier: MIT
"""Telemetry comes once over the radio: the clients' wishes are merged, and what one fetches is for all."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mavlink_dialect import telemetry_table
from omni.hub.boot_rates import STATE, STATUS, WHEELS, messages_of
from omniwheel.dialect import mavlink
from tests.hub.bench import ACCEPTED, Bench, Station, command

LINK = Path(__file__).resolve().parents[2] / "shared" / "link"
RATE = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE


def wish(station: Station, interval_us: float, count: int = 1) -> None:
    station.send(command(RATE, ATTITUDE, interval_us, count=count))
    station.bench.run()


def asked(bench: Bench) -> list[float]:
    """Return the intervals that the robot was asked for."""
    return [message.param2 for message in bench.commands(RATE)]


def telemetry(bench: Bench, duration_s: float = 2.0, period_s: float = 1.0) -> None:
    """Let all that a robot streams at boot come, ATTITUDE among it."""
    end_s = bench.now_s + duration_s
    while bench.now_s < end_s:
        bench.run(period_s, 0.01)
        boot_ms = round(1e3 * bench.now_s)
        bench.robot_sends(mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0, 0, 0, 0))
        bench.robot_sends(mavlink.MAVLink_local_position_ned_message(boot_ms, 0, 0, 0, 0, 0, 0))
        bench.robot_sends(mavlink.MAVLink_sys_status_message(*[0] * 13))


def group(station: Station, rate_hz: int, *, start: bool = True) -> None:
    station.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, rate_hz, start))
    station.bench.run(2.0, 0.01)


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    telemetry(bench)
    return bench


def test_the_fastest_wish_goes_to_the_robot_once(bench: Bench) -> None:
    first, second, third = (bench.join(name) for name in ("first", "second", "third"))
    wish(first, 100_000.0)
    wish(second, 100_000.0)
    wish(third, 500_000.0)
    assert asked(bench) == [100_000.0]
    for station in (first, second, third):
        assert station.results(RATE)[-1] == ACCEPTED
    wish(third, 20_000.0, 2)
    assert asked(bench) == [100_000.0, 20_000.0]


def test_when_the_fastest_goes_the_next_one_counts_and_in_the_end_the_rate_at_boot(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    wish(first, 20_000.0)
    wish(second, 100_000.0)
    bench.leave(first)
    bench.run(2.0)
    assert asked(bench) == [20_000.0, 100_000.0]
    bench.leave(second)
    bench.run(2.0)
    assert asked(bench) == [20_000.0, 100_000.0, 0.0]


def test_off_is_for_the_one_who_said_it_as_long_as_others_look(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    wish(first, -1.0)
    assert asked(bench) == []
    bench.robot_sends(mavlink.MAVLink_attitude_message(1, 2, 3, 4, 5, 6, 7))
    bench.run()
    assert (len(first.got("ATTITUDE")), len(second.got("ATTITUDE"))) == (0, 1)
    wish(second, -1.0)
    assert asked(bench) == [-1.0]


def test_alone_everything_is_as_without_a_hub(bench: Bench) -> None:
    first = bench.join("first")
    for count, interval in enumerate((50_000.0, 200_000.0, -1.0, 0.0), start=1):
        wish(first, interval, count)
    assert asked(bench) == [50_000.0, 200_000.0, -1.0, 0.0]


def test_a_lost_wish_of_the_hub_is_said_again_but_not_for_ever(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    wish(first, 20_000.0)
    wish(second, 100_000.0)
    bench.answers = False
    bench.leave(first)
    bench.run(30.0, 0.01)
    assert asked(bench) == [20_000.0] + [100_000.0] * 10


def test_after_a_restart_of_the_robot_the_wishes_hold_again(bench: Bench) -> None:
    first = bench.join("first")
    wish(first, 20_000.0)
    bench.hub.port_lost()
    bench.hub.port_opened()
    bench.run(2.0, 0.01)
    assert asked(bench) == [20_000.0, 20_000.0]


def test_a_robot_that_restarts_behind_a_radio_is_asked_again(bench: Bench) -> None:
    first = bench.join("first")
    wish(first, 20_000.0)
    for boot_ms in (5000, 6000, 5900, 100, 200):
        bench.robot_sends(mavlink.MAVLink_attitude_message(boot_ms, 0, 0, 0, 0, 0, 0))
        bench.run(2.0, 0.01)
    assert asked(bench) == [20_000.0, 20_000.0]


def asked_of_attitude(bench: Bench) -> list[float]:
    return [message.param2 for message in bench.commands(RATE) if message.param1 == ATTITUDE]


def test_a_group_is_asked_for_as_fast_as_anybody_wants_it(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    for station, rate_hz in ((first, 10), (second, 4), (first, 10), (second, 20)):
        group(station, rate_hz)
    assert asked_of_attitude(bench) == [100_000.0, 50_000.0]
    bench.leave(second)
    bench.run(2.0, 0.01)
    assert asked_of_attitude(bench)[2:] == [100_000.0]


def test_a_group_does_not_undo_the_wish_for_one_message(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    wish(first, 20_000.0)
    group(second, 4)
    assert asked_of_attitude(bench) == [20_000.0]


def test_a_client_that_switches_a_group_off_switches_it_off_for_itself(bench: Bench) -> None:
    quiet, other = bench.join("quiet"), bench.join("other")
    group(quiet, 4, start=False)
    telemetry(bench)
    assert not asked(bench)
    seen = len(other.got("ATTITUDE"))
    assert (quiet.got("ATTITUDE"), seen > 0) == ([], True)
    bench.leave(quiet)
    telemetry(bench)
    assert not asked(bench)
    assert len(other.got("ATTITUDE")) > seen
    assert "REQUEST_DATA_STREAM" not in bench.names()


def test_a_group_is_off_if_all_want_that_and_back_once_a_client_comes_that_does_not(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    group(first, 0)
    group(second, 4, start=False)
    assert asked_of_attitude(bench) == [-1.0]
    bench.join("third")
    group(first, 0)
    assert asked_of_attitude(bench) == [-1.0, 0.0]


@pytest.mark.parametrize("by_group", [False, True])
def test_a_slower_rate_of_one_client_does_not_slow_another_that_wants_the_rate_at_boot(
    bench: Bench, by_group: bool
) -> None:
    slow, _other = bench.join("slow"), bench.join("other")
    telemetry(bench, 1.0, 0.1)  # ten times a second
    bench.run(0.1)
    if by_group:
        group(slow, 4)
    else:
        wish(slow, 250_000.0)
    assert not asked_of_attitude(bench)
    assert "REQUEST_DATA_STREAM" not in bench.names()
    wish(slow, 50_000.0, 2)
    assert asked_of_attitude(bench) == [50_000.0]


def test_while_the_rate_at_boot_is_not_known_it_counts(bench: Bench) -> None:
    """The hub has just opened the port; what never comes by itself is asked for at once."""
    fresh = Bench()
    fast, _other = fresh.join("fast"), fresh.join("other")
    wish(fast, 20_000.0)
    assert not asked(fresh)
    assert fast.results(RATE) == [ACCEPTED]
    fast.send(command(RATE, mavlink.MAVLINK_MSG_ID_OMNI_SAMPLE, 20_000.0, count=2))
    fresh.run()
    assert asked(fresh) == [20_000.0]
    telemetry(fresh, 3.0)
    assert asked_of_attitude(fresh) == [20_000.0]


def test_what_a_radio_does_not_stream_is_not_asked_for_by_group(bench: Bench) -> None:
    station, _other = bench.join("station"), bench.join("other")
    group(station, 4)
    bench.run(5.0, 0.01)
    numbers = {int(message.param1) for message in bench.commands(RATE)}
    assert ATTITUDE in numbers
    assert mavlink.MAVLINK_MSG_ID_ODOMETRY not in numbers


def test_groups_are_those_of_the_robot() -> None:
    reports = telemetry_table(LINK).reports
    names = {WHEELS: "wheels", STATE: "state", STATUS: "status"}
    for group_id, name in names.items():
        ids = {getattr(mavlink, f"MAVLINK_MSG_ID_{report.name}") for report in reports if report.group == name}
        assert ids == set(messages_of(group_id))
    assert set(messages_of(0)) == {number for group_id in names for number in messages_of(group_id)}


def value(bench: Bench, name: bytes, index: int, count: int = 3) -> None:
    bench.robot_sends(mavlink.MAVLink_param_value_message(name, 1.0, 9, count, index))


def test_a_list_on_its_way_is_not_asked_for_again(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    first.send(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run(0.5)
    value(bench, b"A", 0)
    second.send(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run(1.0)
    assert bench.names().count("PARAM_REQUEST_LIST") == 1
    value(bench, b"C", 2)
    second.send(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run()
    assert bench.names().count("PARAM_REQUEST_LIST") == 2, "it was at its end"


def test_a_list_that_got_lost_is_asked_for_again(bench: Bench) -> None:
    first = bench.join("first")
    first.send(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run(2.0, 0.01)
    first.send(mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run()
    assert bench.names().count("PARAM_REQUEST_LIST") == 2


def test_one_parameter_is_asked_for_once_for_two_and_again_for_whoever_repeats(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    for station in (first, second, first):
        station.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WS_P", -1))
        bench.run(0.1)
    assert bench.names().count("PARAM_REQUEST_READ") == 2
    value(bench, b"WS_P", 65535)
    second.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WS_P", -1))
    bench.run()
    assert bench.names().count("PARAM_REQUEST_READ") == 3


@pytest.mark.parametrize("others", [0, 1])
@pytest.mark.parametrize(
    ("message", "interval_us"),
    [
        (math.nan, 1e5),
        (math.inf, 1e5),
        (-1.0, 1e5),
        (float(ATTITUDE), math.nan),
        (float(ATTITUDE), -5.0),
        (float(ATTITUDE), 1.0),
        (float(mavlink.MAVLINK_MSG_ID_HEARTBEAT), -1.0),
        (float(mavlink.MAVLINK_MSG_ID_STATUSTEXT), -1.0),
    ],
)
def test_the_robot_judges_a_wish_that_cannot_be_merged(
    bench: Bench, message: float, interval_us: float, others: int
) -> None:
    station = bench.join("odd")
    for number in range(others):
        bench.join(f"other {number}")
    bench.answers = False
    station.send(command(RATE, message, interval_us))
    bench.run()
    (asked_for,) = bench.commands(RATE)
    np.testing.assert_equal([asked_for.param1, asked_for.param2], np.array([message, interval_us], dtype=np.float32))
    assert not station.results(RATE)
    bench.robot_is(armed=False)
    bench.run()
    assert station.got("HEARTBEAT")
