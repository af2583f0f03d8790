# SPDX-License-Identifier: MIT
from __future__ import annotations

import os
import socket
import sys
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkLostError, LinkOpenError, LinkUrlError, OmniError
from omniwheel.link import DEFAULT_BAUD, LinkAddress, open_link, parse_url


@pytest.mark.parametrize(
    ("url", "expected"),
    [
        ("/dev/ttyACM0", LinkAddress("serial", "/dev/ttyACM0", DEFAULT_BAUD)),
        ("/dev/ttyUSB0,9600", LinkAddress("serial", "/dev/ttyUSB0", 9600)),
        ("/dev/serial/by-id/usb:1", LinkAddress("serial", "/dev/serial/by-id/usb:1", DEFAULT_BAUD)),
        ("COM3", LinkAddress("serial", "COM3", DEFAULT_BAUD)),
        ("COM12,115200", LinkAddress("serial", "COM12", 115200)),
        ("tcp:localhost:5760", LinkAddress("tcp", "localhost", 5760)),
        ("tcp:[::1]:5760", LinkAddress("tcp", "::1", 5760)),
        ("udp:0.0.0.0:14550", LinkAddress("udpin", "0.0.0.0", 14550)),
        ("udpin:0.0.0.0:14550", LinkAddress("udpin", "0.0.0.0", 14550)),
        ("udpout:10.0.0.2:14550", LinkAddress("udpout", "10.0.0.2", 14550)),
    ],
)
def test_urls_are_understood(url: str, expected: LinkAddress) -> None:
    assert parse_url(url) == expected


@pytest.mark.parametrize(
    "url",
    ["", "tcp:", "tcp:host", "tcp:host:", "tcp:host:0", "tcp:host:65536", "tcp:host:x", "tcp::1", "udp:5760",
     "http://host:80", "tcp://host:5760", "serial:9600", "/dev/ttyACM0,", "/dev/ttyACM0,fast", "/dev/ttyACM0,0",
     ",9600"],
)  # fmt: skip
def test_a_bad_url_is_refused_with_what_is_allowed(url: str) -> None:
    with pytest.raises(LinkUrlError, match="cannot understand") as caught:
        parse_url(url)
    assert "tcp:host:port" in caught.value.hint
    assert caught.value.exit_code == 2


@pytest.mark.full
@given(st.text(max_size=40))
def test_any_text_is_a_link_or_a_link_url_error(url: str) -> None:
    try:
        address = parse_url(url)
    except LinkUrlError:
        return
    assert address.place
    assert address.number > 0


def test_a_closed_port_is_reported_at_once_with_the_reason() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(LinkOpenError, match="refused") as caught:
        open_link(f"tcp:127.0.0.1:{port}")
    assert "omni sitl" in caught.value.hint


def test_a_missing_serial_port_is_named() -> None:
    with pytest.raises(LinkOpenError, match=r"/dev/ttyDOESNOTEXIST.*no such port"):
        open_link("/dev/ttyDOESNOTEXIST")


def test_tcp_carries_bytes_both_ways_and_reports_the_end() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = open_link(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        peer, _ = server.accept()
        link.write(b"ping")
        assert peer.recv(16) == b"ping"
        peer.sendall(b"pong")
        assert link.read(5.0) == b"pong"
        assert link.read(0.0) == b""
        peer.close()
        with pytest.raises(LinkLostError, match="closed the connection"):
            link.read(5.0)
        link.close()


def test_udp_answers_the_one_who_spoke_first() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    waiting, calling = open_link(f"udp:127.0.0.1:{port}"), open_link(f"udpout:127.0.0.1:{port}")
    waiting.write(b"nobody is there yet")
    calling.write(b"hello")
    assert waiting.read(5.0) == b"hello"
    waiting.write(b"hi")
    assert calling.read(5.0) == b"hi"
    waiting.close()
    calling.close()


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")
def test_a_pseudo_terminal_is_a_serial_port() -> None:
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    link = open_link(f"{os.ttyname(slave)},9600")
    link.write(b"abc")
    assert os.read(master, 3) == b"abc"
    os.write(master, b"defg")
    got = b""
    while len(got) < 4:
        got += link.read(5.0)
    assert got == b"defg"
    assert link.read(0.0) == b""
    link.close()
    os.close(master)
    os.close(slave)


def test_reading_wakes_up_when_bytes_come() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = open_link(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        peer, _ = server.accept()
        sender = threading.Thread(target=peer.sendall, args=(b"late",))
        sender.start()
        assert link.read(30.0) == b"late"
        sender.join()
        peer.close()
        link.close()


class _Written:
    """A link that keeps what is written."""

    def __init__(self) -> None:
        self.data = b""

    def write(self, data: bytes) -> None:
        self.data += data


@pytest.mark.parametrize(("given", "station"), [("", 255), ("254", 254), ("1", 1)])
def test_a_computer_speaks_as_the_station_that_it_was_given(
    monkeypatch: pytest.MonkeyPatch, given: str, station: int
) -> None:
    monkeypatch.setenv("OMNI_STATION", given)
    link = _Written()
    Connection(link).send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3))  # type: ignore[arg-type]
    (heard,) = mavlink.MAVLink(None).parse_buffer(link.data)
    assert heard.get_srcSystem() == station


@pytest.mark.parametrize("given", ["0", "256", "-1", "one", "1.5", " "])
def test_a_station_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, given: str) -> None:
    monkeypatch.setenv("OMNI_STATION", given)
    with pytest.raises(OmniError):
        Connection(_Written())  # type: ignore[arg-type]


@pytest.mark.parametrize("digits", ["9" * 23, "9" * 5000], ids=["23 digits", "5000 digits"])
@pytest.mark.parametrize("url", ["/dev/ttyS0,{}", "tcp:localhost:{}", "udp:localhost:{}"])
def test_a_number_that_no_port_has_is_refused(url: str, digits: str) -> None:
    with pytest.raises(LinkUrlError):
        parse_url(url.format(digits))
