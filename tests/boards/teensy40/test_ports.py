# SPDX-License-Identifier: MIT
from __future__ import annotations

import ctypes
import random

import pytest

BUFFER = 2048


@pytest.fixture
def ports(chip: ctypes.CDLL) -> ctypes.CDLL:
    chip.port_begin(9600)
    return chip


def connect(ports: ctypes.CDLL) -> None:
    ports.fake_usb_plug(True)
    ports.fake_usb_dtr(True)


def usb_sent(ports: ctypes.CDLL) -> bytes:
    out = ctypes.create_string_buffer(1 << 16)
    count = ports.fake_usb_sent(out)
    return out.raw[:count]


def radio_sent(ports: ctypes.CDLL) -> bytes:
    out = ctypes.create_string_buffer(1 << 16)
    count = ports.fake_radio_sent(out)
    return out.raw[:count]


def test_usb_has_a_session_only_while_a_program_holds_the_port_open(ports: ctypes.CDLL) -> None:
    assert ports.usb_session() == 0
    ports.fake_usb_plug(True)
    assert ports.usb_session() == 0
    ports.fake_usb_dtr(True)
    assert ports.usb_session() == 1
    assert ports.usb_session() == 1
    ports.fake_usb_dtr(False)
    assert ports.usb_session() == 0
    ports.fake_usb_dtr(True)
    assert ports.usb_session() == 2
    ports.fake_usb_plug(False)  # the cable is pulled: DTR keeps its last state
    assert ports.usb_session() == 0
    ports.fake_usb_plug(True)
    assert ports.usb_session() == 3


def test_usb_takes_nothing_and_gives_nothing_while_nobody_is_there(ports: ctypes.CDLL) -> None:
    ports.fake_usb_plug(True)
    ports.fake_usb_host_sends(b"arm!", 4)
    data = ctypes.create_string_buffer(16)
    assert ports.usb_space() == 0
    assert not ports.usb_write(b"x", 1)
    assert ports.usb_read(data, 16) == 0
    ports.fake_usb_dtr(True)
    assert ports.usb_read(data, 16) == 0  # what came before belongs to nobody
    ports.fake_usb_host_sends(b"hello", 5)
    assert ports.usb_read(data, 3) == 3
    assert ports.usb_read(data, 16) == 2
    assert data.raw[:2] == b"lo"
    ports.fake_usb_host_sends(b"arm!", 4)
    ports.fake_usb_plug(False)
    assert ports.usb_read(data, 16) == 0
    ports.fake_usb_plug(True)
    assert ports.usb_read(data, 16) == 0  # nor does what came before the cable was pulled


def test_what_was_written_to_usb_leaves_also_when_the_flush_timer_missed_it(ports: ctypes.CDLL) -> None:
    connect(ports)
    data = ctypes.create_string_buffer(16)
    assert ports.usb_write(b"answer", 6)
    assert ports.fake_usb_under_way() == 0
    ports.usb_read(data, 16)
    assert ports.fake_usb_under_way() == 1
    ports.usb_read(data, 16)
    assert ports.fake_usb_under_way() == 1
    ports.fake_usb_host_reads(1)
    assert ports.fake_usb_under_way() == 0


def test_usb_never_waits_when_the_host_stops_reading(ports: ctypes.CDLL) -> None:
    connect(ports)
    sent = 0
    for number in range(2000):
        frame = bytes([number & 0xFF]) * 65
        sent += 65 if ports.usb_write(frame, len(frame)) else 0
    assert not ports.fake_usb_waited()
    assert sent >= 2 * BUFFER
    assert len(usb_sent(ports)) == sent  # nothing in pieces
    assert ports.usb_space() < 65
    ports.fake_usb_host_reads(4)
    assert ports.usb_write(b"again", 5)
    assert not ports.fake_usb_waited()


def test_usb_never_waits_whatever_the_host_does(ports: ctypes.CDLL) -> None:
    connect(ports)
    rng = random.Random(11)
    expected = b""
    while len(expected) < 50_000:
        frame = rng.randbytes(rng.choice([12, 21, 65, 280, 1000, 2048]))
        if ports.usb_space() >= len(frame):
            assert ports.usb_write(frame, len(frame))
            expected += frame
        else:
            assert not ports.usb_write(frame, len(frame))
        if rng.random() < 0.3:
            ports.fake_usb_host_reads(rng.randrange(4))
    assert not ports.fake_usb_waited()
    assert usb_sent(ports) == expected


def test_the_radio_takes_a_longest_frame_and_refuses_what_does_not_fit(ports: ctypes.CDLL) -> None:
    space = ports.radio_space()
    assert space >= 2 * 280  # its own 64 bytes would not take a 65-byte frame
    frame = bytes(range(256)) + bytes(24)
    assert ports.radio_write(frame, len(frame))
    assert ports.radio_write(frame, len(frame))
    rest = ports.radio_space()
    assert not ports.radio_write(bytes(rest + 1), rest + 1)
    assert ports.radio_write(bytes(rest), rest)
    assert ports.radio_space() == 0
    assert not ports.radio_write(b"x", 1)
    assert not ports.fake_radio_waited()
    assert radio_sent(ports) == frame + frame + bytes(rest)
    ports.fake_radio_sends(100)
    assert ports.radio_space() == 100


def test_the_radio_is_always_connected_and_reads_what_has_arrived(ports: ctypes.CDLL) -> None:
    data = ctypes.create_string_buffer(8192)
    assert ports.radio_read(data, 8192) == 0
    burst = random.Random(3).randbytes(4000)  # 0.35 s at 115200 baud
    ports.fake_radio_arrives(burst, len(burst))
    assert ports.radio_read(data, 10) == 10
    assert ports.radio_read(data, 8192) == len(burst) - 10


def test_the_baud_rate_changes_only_when_it_is_another(ports: ctypes.CDLL) -> None:
    data = ctypes.create_string_buffer(16)
    assert (ports.fake_radio_baud(), ports.fake_radio_begins()) == (9600, 1)
    ports.radio_set_baud(9600)
    ports.radio_read(data, 16)
    assert ports.fake_radio_begins() == 1
    ports.radio_set_baud(115200)
    ports.radio_read(data, 16)
    assert (ports.fake_radio_baud(), ports.fake_radio_begins()) == (115200, 2)


def test_what_was_written_leaves_at_the_old_baud_rate(ports: ctypes.CDLL) -> None:
    """The answer to the command that changes the rate must still be understood."""
    data = ctypes.create_string_buffer(16)
    space = ports.radio_space()
    assert ports.radio_write(bytes(50), 50)
    ports.radio_set_baud(115200)
    assert ports.radio_space() == 0  # nothing new goes at the old rate
    assert not ports.radio_write(b"x", 1)
    ports.radio_read(data, 16)
    assert ports.fake_radio_baud() == 9600
    ports.fake_radio_sends(50)
    ports.fake_radio_shifts(True)
    ports.radio_read(data, 16)
    assert ports.fake_radio_baud() == 9600
    ports.fake_radio_shifts(False)
    ports.radio_read(data, 16)
    assert ports.fake_radio_baud() == 115200
    assert ports.radio_space() == space
