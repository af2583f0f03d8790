# SPDX-License-Identifier: MIT
"""The hub has the radio's key; programs behind it need none."""

from __future__ import annotations

from typing import Any

import pytest

from omni.hub import wire
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.signing import Signer
from tests.hub.bench import ARM, WIDE, Bench, Station, beat, command

KEY, OTHER = bytes(range(32)), bytes(range(1, 33))


def signer(key: bytes = KEY) -> Signer:
    return Signer(key, clock=lambda: 1.8e9, link_id=7)


def radio(key: bytes = KEY) -> tuple[Bench, Station]:
    """Return a hub with the key at a robot that signs with ``key``, and a station without one."""
    bench = Bench(WIDE, signer())
    signer(key).attach(bench._robot)
    bench._robot.signing.link_id = 9
    return bench, bench.join("first")


def robots_parser(key: bytes = KEY) -> Any:
    """Return a parser that takes what the robot would take."""
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    signer(key).attach(parser)
    parser.signing.goodsig_count = 1  # from now on nothing unsigned
    return parser


def test_what_goes_to_the_radio_is_signed_and_otherwise_as_it_was() -> None:
    bench, station = radio()
    station.send(command(ARM, 0.0, count=3), beat(), mavlink.MAVLink_param_request_list_message(1, 1))
    bench.run()
    messages = robots_parser().parse_buffer(b"".join(frame for _, frame in bench.frames))
    assert [message.get_type() for message in messages] == ["COMMAND_LONG", "HEARTBEAT", "PARAM_REQUEST_LIST"]
    assert [message.get_seq() for message in messages] == [0, 1, 2]
    assert messages[0].param5 == 3.0
    assert {(message.get_srcSystem(), message.get_srcComponent()) for message in messages} == {(255, 190)}


def test_a_mavlink_1_frame_goes_on_as_a_signed_mavlink_2_frame() -> None:
    bench, station = radio()
    message = command(ARM, 0.0)
    message.pack(station.codec, force_mavlink1=True)
    bench.hub.from_client(station.number, bytes(message.get_msgbuf()))
    bench.run()
    (taken,) = robots_parser().parse_buffer(bench.frames[0][1])
    assert (taken.command, taken.param1) == (ARM, 0.0)


def test_a_program_without_the_key_gets_the_robots_frames_without_signature() -> None:
    bench, station = radio()
    bench.robot_is(armed=False)
    bench.run()
    (heard,) = station.got("HEARTBEAT")
    assert not wire.is_signed(heard)


def test_a_program_with_the_key_gets_them_signed() -> None:
    bench, station = radio()
    signer().attach(station.codec)
    station.send(beat())
    bench.robot_is(armed=False)
    bench.run()
    assert [message.get_signed() for message in station.got("HEARTBEAT")] == [True]


def test_who_signs_with_another_key_is_not_heard() -> None:
    bench, station = radio(OTHER)
    bench.robot_is(armed=True)
    bench.run()
    assert station.inbox == []
    assert not bench.hub.command.armed


@pytest.mark.parametrize("key", [KEY, None], ids=["hub with the key", "hub without"])
def test_what_a_program_signs_itself_is_taken_by_the_robot(key: bytes | None) -> None:
    bench = Bench(WIDE, None if key is None else signer(key))
    station = bench.join("first")
    signer().attach(station.codec)
    station.send(command(ARM, 0.0))
    bench.run()
    assert len(robots_parser().parse_buffer(bench.frames[0][1])) == 1


def test_our_own_connection_without_a_key_works_behind_a_hub() -> None:
    bench, station = radio()

    class HubEnd:
        url = "hub"

        def read(self, timeout_s: float) -> bytes:
            bench.robot_is(armed=False)
            bench.run(0.1)
            return bytes(station.raw)

        def write(self, data: bytes) -> None:
            bench.hub.from_client(station.number, data)

        def close(self) -> None:
            return

    connection = Connection(HubEnd(), clock=lambda: bench.now_s)
    found = connection.wait(lambda message: message.get_type() == "HEARTBEAT", 1.0)
    assert found is not None
    assert connection.wrongly_signed == 0
