# SPDX-License-Identifier: MIT
"""Telemetry comes once over the radio: the clients' wishes are merged, and what one fetches is for all."""

from __future__ import annotations

import math

import numpy as np
import pytest

from omniwheel.dialect import mavlink
from tests.hub.bench import ACCEPTED, Bench, Station, command

RATE = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE


def wish(station: Station, interval_us: float, count: int = 1) -> None:
    station.send(command(RATE, ATTITUDE, interval_us, count=count))
    station.bench.run()


def asked(bench: Bench) -> list[float]:
    """Return the intervals that the robot was asked for."""
    return [message.param2 for message in bench.commands(RATE)]


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.run()
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


def test_a_group_is_asked_for_as_fast_as_anybody_wants_it(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")

    def group(station: Station, rate_hz: int) -> None:
        station.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, rate_hz, 1))
        bench.run()

    group(first, 10)
    group(second, 4)
    group(first, 10)
    group(second, 20)
    rates = [m.req_message_rate for _, m in bench.sent if m.get_type() == "REQUEST_DATA_STREAM"]
    assert rates == [10, 20]


def test_a_group_does_not_undo_the_wish_for_one_message(bench: Bench) -> None:
    first, second = bench.join("first"), bench.join("second")
    wish(first, 20_000.0)
    second.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 4, 1))
    bench.run(2.0, 0.01)
    assert asked(bench) == [20_000.0, 20_000.0]


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
