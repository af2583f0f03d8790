# SPDX-License-Identifier: MIT
"""Where a hub listens, and what its link may be given."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import pytest

from omni.hub.addresses import WIDE_BYTES_S, budget_of, is_local, listen_address
from omni.hub.server import HubServer, short_name
from omniwheel.errors import LinkOpenError, LinkUrlError
from omniwheel.limits import HUB_LISTEN
from omniwheel.ports import Port


def test_what_is_listened_at_by_default_is_this_computer() -> None:
    assert all(is_local(listen_address(text)) for text in HUB_LISTEN)


@pytest.mark.parametrize("text", ["tcp:0.0.0.0:5790", "udp:192.168.1.7:14550", "tcp:robot.example:1"])
def test_other_addresses_are_open_to_others(text: str) -> None:
    assert not is_local(listen_address(text))


@pytest.mark.parametrize("text", ["tcp:localhost:1", "udp:127.0.0.1:14550", "tcp:[::1]:5790"])
def test_these_are_this_computer(text: str) -> None:
    assert is_local(listen_address(text))


def test_a_tcp_port_of_0_is_a_free_one() -> None:
    assert listen_address("tcp:127.0.0.1:0").number == 0
    assert listen_address("tcp:127.0.0.1:5790").number == 5790


@pytest.mark.parametrize("text", ["", "/dev/ttyACM0", "5790", "udp:127.0.0.1:0", "tcp:127.0.0.1"])
def test_what_is_no_address_is_refused_with_what_is(text: str) -> None:
    with pytest.raises(LinkUrlError) as caught:
        listen_address(text)
    assert "tcp:host:port" in caught.value.hint


def test_an_address_that_is_taken_is_said(own_places: None) -> None:
    with HubServer("/nowhere", ["tcp:127.0.0.1:0"]) as first, pytest.raises(LinkOpenError, match="cannot listen"):
        HubServer("/elsewhere", [first.urls[0]])


@pytest.mark.parametrize(
    ("url", "path", "bytes_s"),
    [
        ("/dev/ttyUSB0,9600", "/dev/ttyUSB0", 480.0),
        ("/dev/ttyUSB0", "/dev/ttyUSB0", 2880.0),
        ("/dev/ttyACM0", "/dev/ttyACM0", WIDE_BYTES_S),
        ("/dev/ttyACM0,9600", "/dev/ttyACM0", WIDE_BYTES_S),
        ("/tmp/robot", "/dev/pts/3", WIDE_BYTES_S),
        ("/tmp/robot,9600", "/dev/pts/3", 480.0),
        ("tcp:127.0.0.1:5760", "tcp:127.0.0.1:5760", WIDE_BYTES_S),
    ],
)
def test_a_serial_port_is_a_radio_of_its_rate_unless_it_is_usb(url: str, path: str, bytes_s: float) -> None:
    ports = [Port("/dev/ttyACM0", "", "teensy", "12"), Port("/dev/ttyUSB0", "", "xbee", "A1")]
    with patch("omni.hub.addresses.serial_ports", lambda: ports):
        assert budget_of(url, path).bytes_s == pytest.approx(bytes_s)


def test_a_ports_name_fits_a_status_text() -> None:
    assert short_name("/dev/ttyACM0") == "ttyACM0"
    long = short_name("/dev/serial/by-id/usb-Teensyduino_USB_Serial_12345670-if00")
    assert (len(long), long[-5:]) == (20, "-if00")


def test_the_same_usb_device_is_taken_under_its_new_name(own_places: None, tmp_path: Path) -> None:
    with HubServer(f"{tmp_path}/ttyACM0", ["tcp:127.0.0.1:0"]) as server:
        server._serial_number = "12"
        ports = [Port("/dev/ttyACM7", "", "teensy", "12"), Port("/dev/ttyACM8", "", "teensy", "13")]
        with patch("omni.hub.server.serial_ports", lambda: ports):
            assert server._url_now() == "/dev/ttyACM7,57600"
