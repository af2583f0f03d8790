# SPDX-License-Identifier: MIT
"""A burst comes whole through a radio of 9600 baud that loses packets, and nothing else suffers."""

from __future__ import annotations

from typing import Any

import pytest

from omniwheel.dialect import mavlink
from omniwheel.log_download import LogDownload
from omniwheel.radio_model import RadioSettings
from omniwheel.robot import Robot, connect
from tests.radio.download_page import robot_with, station
from tests.radio.memory_robot import USB, MemoryLink
from tests.radio.simulated_radio import RadioLink
from tests.radio.station import usb

SLOW = RadioSettings(baud=9600, loss=0.05, latency_s=0.05)
SIGNALS = ("wheel_reference", "wheel_speed")


def fetch(robot: Robot) -> bytes:
    download = LogDownload(robot.connection)
    return download.fetch(download.await_log(5.0))


@pytest.mark.parametrize("burst_s", [0.25, pytest.param(1.0, marks=pytest.mark.nightly)])
def test_a_burst_comes_whole_over_9600_baud_with_lost_packets(burst_s: float) -> None:
    with robot_with(9600) as robot:
        cable = MemoryLink(robot, USB)
        with connect(cable, clock=cable.clock_s) as there:
            there.start_burst(burst_s, SIGNALS, wheels=[0])
            there.pump(burst_s + 0.1)
            whole = fetch(there)
        link = RadioLink(robot, SLOW, seed=3)
        with station(robot, link) as there:
            began_s = link.clock_s()
            assert fetch(there) == whole
            assert link.radio.down.packets_lost > 0
            assert link.clock_s() - began_s < 120.0 * burst_s
        assert len(whole) > 12_000 * burst_s


def test_a_stop_comes_through_while_a_burst_is_sent() -> None:
    with robot_with(9600) as robot:
        link = RadioLink(robot, RadioSettings(baud=9600), seed=1)
        with station(robot, link) as there:
            there.start_burst(1.0, SIGNALS)
            there.pump(1.2)
            there.send(mavlink.MAVLink_log_request_data_message(1, 1, 0, 0, 0xFFFFFFFF))
            there.pump(2.0)
            begun_s = link.clock_s()
            there.estop()
            assert link.clock_s() - begun_s < 1.0
            usb(robot).heartbeat()
            beats = [m for m in _heard(there, 10.0) if m.get_type() == "HEARTBEAT"]
            assert len(beats) >= 9  # telemetry goes on beside the burst


def _heard(robot: Robot, duration_s: float) -> list[Any]:
    heard: list[Any] = []
    remove = robot.connection.add_listener(heard.append)
    robot.pump(duration_s)
    remove()
    return heard
