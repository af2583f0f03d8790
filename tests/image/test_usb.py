# SPDX-License-Identifier: MIT
"""The image's USB serial port at an emulated host: enumeration, sessions, cables, full hosts, packets."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import pairwise

import pytest

pytest.importorskip("unicorn")
pytest.importorskip("elftools")

from emulated_teensy.image_file import Image
from emulated_teensy.machine import Channel, Machine, Snapshot, Stop
from hil_sim.frame_watch import FrameWatch
from hil_sim.telemetry_compare import frames
from omniwheel._core import lib
from omniwheel.dialect import mavlink

DTR_AND_RTS = 3
PORTSC1 = 0x402E0184
SUSPENDED, HIGH_SPEED = 1 << 7, 1 << 9
PARAMETERS = mavlink.MAVLink_param_request_list_message(1, 1)
OUTPUT_SIZE = lib.RT1062_OUTPUT_SIZE


@pytest.fixture(scope="module")
def booted(flashed_image: Image) -> Iterator[tuple[Machine, Snapshot]]:
    with Machine(flashed_image) as machine:
        machine.power_on()
        machine.run(0.5)
        yield machine, machine.snapshot()


@pytest.fixture
def machine(booted: tuple[Machine, Snapshot]) -> Machine:
    """A board that has started, without a cable."""
    machine, snapshot = booted
    machine.restore(snapshot)
    return machine


def number(machine: Machine, symbol: str, form: str = "B") -> int:
    found = struct.unpack("<" + form, machine.read(machine.address_of(symbol), struct.calcsize(form)))
    return int(found[0])


def plug(machine: Machine, *, full_speed: bool = False) -> None:
    lib.rt1062_usb_full_speed(machine._c, full_speed)
    machine.usb_cable(True)
    machine.run(0.3)
    assert machine.usb_ready


def opened(machine: Machine) -> Machine:
    plug(machine)
    machine.usb_open(True)
    machine.run(0.1)
    return machine


def port_register(machine: Machine) -> int:
    return int(lib.rt1062_bus_read(machine._c, PORTSC1, 4))


def packed(message: mavlink.MAVLink_message) -> bytes:
    return bytes(message.pack(mavlink.MAVLink(None, 255, 190)))


def messages(machine: Machine, duration_s: float) -> list[int]:
    machine.receive(Channel.USB)
    machine.run(duration_s)
    return FrameWatch().feed(machine.receive(Channel.USB))


def test_the_host_configures_it_at_high_speed_after_the_pauses_of_the_standard(machine: Machine) -> None:
    begin_s = machine.time_s
    machine.usb_cable(True)
    while not machine.usb_ready:
        machine.run(0.001)
        assert machine.time_s < begin_s + 1.0
    assert 0.160 < machine.time_s - begin_s < 0.200  # 100 ms debounce, 50 ms reset, 10 ms recovery
    assert number(machine, "usb_configuration") == 1
    assert number(machine, "usb_high_speed") == 1
    assert port_register(machine) & HIGH_SPEED
    assert machine.findings() == []


def test_a_host_of_12_mbit_gets_packets_of_64(machine: Machine) -> None:
    plug(machine, full_speed=True)
    assert number(machine, "usb_high_speed") == 0
    machine.usb_open(True)
    machine.run(0.1)
    assert number(machine, "tx_packet_size", "H") == 64
    assert machine.send(Channel.USB, packed(PARAMETERS)) > 0
    assert messages(machine, 0.5).count(mavlink.MAVLINK_MSG_ID_PARAM_VALUE) > 20


def test_the_program_at_the_port_decides_line_coding_and_session(machine: Machine) -> None:
    plug(machine)
    assert number(machine, "usb_cdc_line_rtsdtr") == 0
    assert machine.send(Channel.USB, b"nobody has it open") == 0
    machine.usb_open(True, 57600)
    machine.run(0.05)
    assert number(machine, "usb_cdc_line_coding", "I") == 57600
    assert number(machine, "usb_cdc_line_rtsdtr") == DTR_AND_RTS
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in messages(machine, 1.1)
    machine.usb_open(False, 57600)
    machine.run(0.05)
    assert number(machine, "usb_cdc_line_rtsdtr") == 0
    assert messages(machine, 0.5) == []


def test_134_baud_leads_to_the_uploader_after_ten_milliseconds_of_frames(machine: Machine) -> None:
    plug(machine)
    machine.usb_open(True, 134)
    begin_s = machine.time_s
    assert machine.run(1.0) == Stop.UPLOAD
    assert 0.009 < machine.time_s - begin_s < 0.012


def test_a_pulled_cable_suspends_the_port_and_ends_the_session(machine: Machine) -> None:
    opened(machine)
    assert messages(machine, 0.2)
    machine.usb_cable(False)
    machine.run(0.002)
    assert not port_register(machine) & SUSPENDED
    machine.run(0.002)
    assert port_register(machine) & SUSPENDED
    assert not machine.usb_ready
    assert messages(machine, 0.3) == []
    assert machine.send(Channel.USB, b"lost") == 0


def test_after_a_cable_was_put_back_a_new_session_is_greeted(machine: Machine) -> None:
    opened(machine)
    for _ in range(3):
        machine.usb_cable(False)
        machine.run(0.1)
        opened(machine)
        assert not port_register(machine) & SUSPENDED
        assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in messages(machine, 1.1)
    assert machine.findings() == []


def test_a_cable_with_a_loose_contact_does_no_harm(machine: Machine) -> None:
    for pause_ms in (1, 50, 101, 120, 151, 155, 161, 162, 163, 170):
        machine.usb_cable(True)
        machine.run(pause_ms * 1e-3)
        machine.usb_cable(False)
        machine.run(0.001)
    opened(machine)
    assert mavlink.MAVLINK_MSG_ID_HEARTBEAT in messages(machine, 1.1)


def test_a_host_that_stops_reading_loses_no_byte_and_stops_nothing_but_telemetry(machine: Machine) -> None:
    opened(machine)
    for _ in range(100):  # ask on; nothing is read meanwhile
        machine.send(Channel.USB, packed(PARAMETERS))
        before = number(machine, "systick_millis_count", "I")
        assert machine.run(0.25) == Stop.TIME
        assert number(machine, "systick_millis_count", "I") - before >= 249
        if machine.call("usb_serial_write_buffer_free") == 0:
            break
    assert machine.call("usb_serial_write_buffer_free") == 0
    heard = machine.receive(Channel.USB)
    assert OUTPUT_SIZE - 512 < len(heard) <= OUTPUT_SIZE
    machine.run(1.0)
    heard += machine.receive(Channel.USB)
    sequences = [frame.sequence for frame in frames(heard)]
    assert len(sequences) > 500
    assert all((later - earlier) % 256 == 1 for earlier, later in pairwise(sequences))


@pytest.mark.parametrize("padding", [0, 1, 511, 512, 513, 1024])
def test_bytes_come_whole_whatever_the_packets_are(machine: Machine, padding: int) -> None:
    """Requests behind so much else that packets end within a frame, at its end, or are full to the last byte."""
    opened(machine)
    request = packed(PARAMETERS)
    assert machine.send(Channel.USB, bytes(padding) + request) == padding + len(request)
    assert messages(machine, 1.5).count(mavlink.MAVLINK_MSG_ID_PARAM_VALUE) > 100


def test_the_whole_of_what_is_sent_in_bursts_arrives(machine: Machine) -> None:
    opened(machine)
    ping = packed(mavlink.MAVLink_timesync_message(0, 1))
    count = 200
    waiting = ping * count
    heard = b""
    machine.receive(Channel.USB)
    while waiting:
        waiting = waiting[machine.send(Channel.USB, waiting[:1000]) :]
        machine.run(0.01)
        heard += machine.receive(Channel.USB)
    machine.run(0.2)
    heard += machine.receive(Channel.USB)
    assert FrameWatch().feed(heard).count(mavlink.MAVLINK_MSG_ID_TIMESYNC) == count


def test_a_packet_takes_its_time_on_the_bus(machine: Machine) -> None:
    """13 packets of 512 bytes in a microframe at most: 53 MB/s [USB 2.0, 5.8.4]; far more than the image takes."""
    opened(machine)
    machine.run(0.05)
    machine.receive(Channel.USB)
    machine.send(Channel.USB, packed(mavlink.MAVLink_timesync_message(0, 1)))
    machine.stop_on(Stop.OUTPUT)
    begin_s = machine.time_s
    try:
        while mavlink.MAVLINK_MSG_ID_TIMESYNC not in FrameWatch().feed(machine.receive(Channel.USB)):
            assert machine.run(0.01) == Stop.OUTPUT
    finally:
        machine.stop_on()
    assert 6e-6 < machine.time_s - begin_s < 2e-3


def test_the_same_bytes_at_the_same_time_give_the_same_machine(booted: tuple[Machine, Snapshot]) -> None:
    machine, snapshot = booted
    results = []
    for _ in range(2):
        machine.restore(snapshot)
        opened(machine)
        machine.send(Channel.USB, packed(PARAMETERS))
        machine.run(0.5)
        results.append((machine.receive(Channel.USB), machine.instructions, machine.time_ns))
    assert results[0] == results[1]
