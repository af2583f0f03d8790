# SPDX-License-Identifier: MIT
"""Noise, half frames and strangers' messages in front of a stop: it goes out at once, as the robot's own parser has it.

The tests of that parser are tests/fuzz, tests/docs/test_link_vectors.py and tests/radio/test_noise.py.
"""

from __future__ import annotations

import struct
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omni.hub.frame_finder import SILENCE_S, FrameFinder
from omni.hub.rules import Kind, kind_of
from omniwheel.dialect import mavlink
from tests.hub.bench import ARM, Bench, beat, command, setpoint

ESTOP = mavlink.MAV_CMD_OMNI_ESTOP
STOPS = {
    "emergency stop": (ESTOP, 1.0),
    "disarm": (ARM, 0.0),
    "flight termination": (mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1.0),
    "end of host-in-the-loop": (mavlink.MAV_CMD_OMNI_HIL, 0.0),
    "hold": (mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0),
    "end of an excitation": (mavlink.MAV_CMD_OMNI_EXCITE, 0.0),
}
REMOTE_LOG_BLOCK = 184
"""A message of ArduPilot's, which our dialect does not have; 200 of its bytes are anything."""
UNKNOWN = 0xABCDEF


def frame_of(message: Any, *, version_1: bool = False, sequence: int = 0) -> bytes:
    """Return a ground station's frame."""
    codec = mavlink.MAVLink(None, 255, 190)
    codec.seq = sequence
    return bytes(message.pack(codec, force_mavlink1=version_1))


def signed(frame: bytes) -> bytes:
    """Return a frame that says that it is signed; the hub lets the robot judge that."""
    body = bytes([frame[0], frame[1], 1]) + frame[3:-2]
    crc = mavlink.x25crc(body[1:])
    crc.accumulate(bytes([mavlink.mavlink_map[int.from_bytes(frame[7:10], "little")].crc_extra]))
    return body + struct.pack("<H", crc.crc) + bytes(13)


def stranger(payload: bytes) -> bytes:
    """Return a whole frame of ArduPilot's REMOTE_LOG_DATA_BLOCK."""
    seed, _ = mavlink.familiar_messages[REMOTE_LOG_BLOCK]
    body = struct.pack("<BBBBBBBHB", 0xFD, len(payload), 0, 0, 7, 255, 190, REMOTE_LOG_BLOCK, 0) + payload
    crc = mavlink.x25crc(body[1:])
    crc.accumulate(bytes([seed]))
    return body + struct.pack("<H", crc.crc)


def header(number: int, length: int, flags: int = 0) -> bytes:
    """Return the beginning of a frame that claims to be long."""
    return struct.pack("<BBBBBBBHB", 0xFD, length, flags, 0, 7, 255, 190, number & 0xFFFF, number >> 16)


HALF = frame_of(setpoint())
NOISE = {
    "a start byte of MAVLink 1": b"\xfe",
    "a start byte of MAVLink 2": b"\xfd",
    "many of both": b"\xfe\xfd\xfd\xfe" * 40,
    "a message that nobody knows": header(UNKNOWN, 255),
    "flags that nobody knows": header(0, 255, 0x82),
    "a long message's beginning": header(mavlink.MAVLINK_MSG_ID_LOGGING_DATA, 255),
    "the same, signed": header(mavlink.MAVLINK_MSG_ID_LOGGING_DATA, 255, 1),
    "a stranger's beginning": header(REMOTE_LOG_BLOCK, 206),
    **{f"{count} bytes of a setpoint": HALF[:count] for count in range(1, len(HALF), 7)},
}


def taken(finder: FrameFinder, data: bytes, cuts: list[int]) -> list[Any]:
    """Return what is found in bytes that come in pieces, cut at these places."""
    places = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    return [m for begin, end in pairwise(places) for m in finder.take(data[begin:end])]


def stopped(bench: Bench, number: int, frames: bytes) -> list[Any]:
    """Let a client send bytes and return the commands that the robot has got a millisecond later."""
    bench.hub.from_client(number, frames)
    bench.run(0.001)
    return [message for _, message in bench.sent if message.get_type().startswith("COMMAND_")]


@pytest.mark.parametrize("stop", STOPS)
@pytest.mark.parametrize("noise", NOISE)
def test_a_stop_behind_noise_goes_out_at_once(noise: str, stop: str) -> None:
    bench = Bench()
    station = bench.join("noisy")
    (first, *_) = stopped(bench, station.number, NOISE[noise] + frame_of(command(*STOPS[stop])))
    assert (first.command, first.param1) == STOPS[stop]


@pytest.mark.parametrize("noise", NOISE)
def test_so_does_one_that_comes_byte_by_byte(noise: str) -> None:
    bench = Bench()
    station = bench.join("slow")
    frame = frame_of(command(ESTOP, 1.0))
    for byte in NOISE[noise] + frame[:-1]:
        assert stopped(bench, station.number, bytes([byte])) == []
    assert stopped(bench, station.number, frame[-1:])[0].command == ESTOP


@pytest.mark.parametrize("version_1", [False, True])
@pytest.mark.parametrize("with_signature", [False, True])
def test_in_every_kind_of_frame(version_1: bool, with_signature: bool) -> None:
    frame = frame_of(command(ESTOP, 1.0), version_1=version_1)
    if with_signature and not version_1:
        frame = signed(frame)
    bench = Bench()
    station = bench.join("noisy")
    assert stopped(bench, station.number, b"\xfe" + frame)[0].command == ESTOP


def test_what_else_stands_behind_noise_is_heard_after_a_moment() -> None:
    bench = Bench()
    station = bench.join("noisy")
    bench.hub.from_client(station.number, header(mavlink.MAVLINK_MSG_ID_LOGGING_DATA, 255) + frame_of(beat()))
    bench.run(0.9 * SILENCE_S)
    assert "HEARTBEAT" not in bench.names()
    bench.run(0.2 * SILENCE_S)
    assert "HEARTBEAT" in bench.names()


def test_an_arm_command_in_front_of_the_stop_does_not_have_the_last_word() -> None:
    bench = Bench()
    station = bench.join("noisy")
    arm, stop = frame_of(command(ARM, 1.0)), frame_of(command(ESTOP, 1.0))
    bench.hub.from_client(station.number, header(mavlink.MAVLINK_MSG_ID_LOGGING_DATA, 255) + arm + stop)
    bench.run(3.0 * SILENCE_S)
    commands = [message.command for _, message in bench.sent if message.get_type() == "COMMAND_LONG"]
    assert commands[0] == ESTOP
    assert commands[-1] == ESTOP


def test_a_whole_message_is_not_obeyed_for_what_it_carries() -> None:
    bench = Bench()
    station = bench.join("logs")
    inside = frame_of(command(ARM, 1.0)) + frame_of(command(ESTOP, 1.0))
    tunnel = mavlink.MAVLink_tunnel_message(1, 1, 0, len(inside), list(inside.ljust(128, b"\0")))
    assert stopped(bench, station.number, stranger(inside) + frame_of(tunnel)) == []
    bench.run(3.0 * SILENCE_S)
    assert bench.commands(ARM) == bench.commands(ESTOP) == []


@given(
    st.lists(st.one_of(st.sampled_from([b"\xfe", b"\xfd", HALF[:9], HALF[:-1]]), st.binary(max_size=30)), max_size=5),
    st.lists(st.integers(0, 200), max_size=8),
)
def test_no_bytes_before_it_and_no_cuts_hold_a_stop_back(noise: list[bytes], cuts: list[int]) -> None:
    data = b"".join(noise) + frame_of(command(ESTOP, 1.0))
    found = taken(FrameFinder(lambda message: kind_of(message) is Kind.STOP), data, cuts)
    assert ESTOP in [message.command for message in found if message.get_type() == "COMMAND_LONG"]


@given(st.lists(st.integers(0, 300), max_size=20), st.integers(0, 255))
def test_frames_are_given_once_and_in_order_however_they_are_cut(cuts: list[int], sequence: int) -> None:
    frames = [frame_of(m, sequence=sequence) for m in (beat(), setpoint(), command(ARM, 1.0), command(ESTOP, 1.0))]
    data = b"".join(frames)
    finder = FrameFinder(lambda message: kind_of(message) is Kind.STOP)
    assert [bytes(message.get_msgbuf()) for message in taken(finder, data, cuts)] == frames
    assert not finder.waits
