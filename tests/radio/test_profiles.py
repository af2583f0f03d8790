# SPDX-License-Identifier: MIT
"""The radio profiles measured: a minute of what the firmware really sends, and the download on a bad radio."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from MAVProxy.modules.mavproxy_param import ParamState

from omniwheel import Robot, connect
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.presets import read_preset
from omniwheel.radio_model import RadioSettings
from omniwheel.robots import parameter_table
from omniwheel.signing import EPOCH_S, UNITS_PER_S, Signer
from tests.radio.memory_robot import RADIO, USB, MemoryLink, MemoryRobot
from tests.radio.simulated_radio import RadioLink
from tests.radio.station import KEY, START, usb

PROFILES = [9600, 57600, 115200]
BYTES_S = {baud: baud / 10 for baud in PROFILES}
LONGEST_FRAME = 100


def bad_radio(baud: int) -> RadioSettings:
    return RadioSettings(baud=baud, loss=0.2, latency_s=0.2)


@contextmanager
def robot_with(baud: int, signed: bool = False) -> Iterator[MemoryRobot]:
    """A robot with a profile loaded over USB, and perhaps a key."""
    with MemoryRobot() as robot:
        link = MemoryLink(robot, USB)
        with connect(link, clock=link.clock_s) as there:
            there.parameters.set_many(read_preset(f"radio_{baud}", parameter_table()).parameters)
        if signed:
            usb(robot).give_key(KEY)
        robot.run(3000)
        assert robot.baud == baud
        robot.read(RADIO)
        yield robot


@contextmanager
def station(robot: MemoryRobot, link: RadioLink, signed: bool = False) -> Iterator[Robot]:
    """Our own host program behind the radio."""
    signer = Signer(KEY, clock=lambda: EPOCH_S + START / UNITS_PER_S + link.clock_s(), link_id=3) if signed else None
    connection = Connection(link, clock=link.clock_s, signer=signer)
    connection.target_system, connection.target_component = 1, 1
    assert connection.wait(lambda m: m.get_type() == "HEARTBEAT", 20.0) is not None
    yield Robot(connection, table=parameter_table())


@pytest.mark.parametrize("signed", [False, True], ids=["unsigned", "signed"])
@pytest.mark.parametrize("baud", PROFILES)
def test_a_minute_of_a_profile_stays_below_60_percent_of_the_line(baud: int, signed: bool) -> None:
    with robot_with(baud, signed) as robot:
        link = RadioLink(robot, RadioSettings(baud=baud))
        with station(robot, link, signed) as there:
            heard: Counter[str] = Counter()
            lengths: list[int] = []

            def count(message: Any) -> None:
                heard[message.get_type()] += 1
                lengths.append(len(message.get_msgbuf()))

            there.connection.add_listener(count)
            start_s, start = link.clock_s(), link.radio.down.bytes_in
            assert there.parameters.download()
            there.pump(60.0 - (link.clock_s() - start_s))
            bytes_s = (link.radio.down.bytes_in - start) / (link.clock_s() - start_s)
        assert bytes_s < 0.6 * BYTES_S[baud]
        assert max(lengths) <= LONGEST_FRAME
        assert link.radio.down.bytes_overflowed == 0
        assert heard["HEARTBEAT"] >= 58
        assert heard["PARAM_VALUE"] >= len(parameter_table())
        assert heard["SYS_STATUS"] >= 11
        assert heard["OMNI_STATUS"] >= 7
        assert heard["LOCAL_POSITION_NED"] >= 50
        assert heard["OMNI_TRACKING"] >= 40


def test_the_default_rates_cannot_flood_a_slow_line() -> None:
    """Without any profile: the baud rate alone holds telemetry to half of the line, and heartbeats are in time."""
    with MemoryRobot() as robot:
        link = RadioLink(robot, RadioSettings(baud=9600))
        ages = []
        with station(robot, link) as there:
            there.pump(1.5)
            start_s, start = link.clock_s(), link.radio.down.bytes_in
            while link.clock_s() < start_s + 30.0:
                there.pump(0.1)
                ages.append(there.status.heartbeat_age_s)
            bytes_s = (link.radio.down.bytes_in - start) / (link.clock_s() - start_s)
        assert bytes_s < 0.6 * 960
        assert max(ages) < 1.5


@pytest.mark.parametrize("baud", [9600, 115200])
@pytest.mark.parametrize("signed", [False, True], ids=["unsigned", "signed"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_our_download_completes_on_a_bad_radio(baud: int, signed: bool, seed: int) -> None:
    """A fifth of the packets lost, 200 ms each way. Requests are not repeated needlessly."""
    with robot_with(baud, signed) as robot:
        link = RadioLink(robot, bad_radio(baud), seed=seed)
        with station(robot, link, signed) as there:
            counts: Counter[int] = Counter()
            there.connection.add_listener(
                lambda m: counts.update([m.param_index]) if m.get_type() == "PARAM_VALUE" else None
            )
            start_s = link.clock_s()
            values = there.parameters.download()
            took_s = link.clock_s() - start_s
        assert len(values) == len(parameter_table())
        assert took_s < (90.0 if baud == 9600 else 60.0)
        assert link.radio.down.packets_lost > 0.1 * link.radio.down.packets_sent
        assert sum(counts.values()) < 1.5 * len(values)


@pytest.mark.parametrize("baud", [9600, 115200])
@pytest.mark.parametrize("seed", [1, 2])
def test_gains_are_set_and_confirmed_on_a_bad_radio(baud: int, seed: int) -> None:
    with robot_with(baud) as robot:
        link = RadioLink(robot, bad_radio(baud), seed=seed)
        with station(robot, link) as there:
            for gain in range(5, 15):
                there.parameters["ISMC_LAM_XY"] = float(gain)
                assert there.parameters.read("ISMC_LAM_XY") == gain
        check = MemoryLink(robot, USB)
        with connect(check, clock=check.clock_s) as beside:
            assert beside.parameters.read("ISMC_LAM_XY") == 14.0


class MavProxySide:
    """What MAVProxy's parameter module wants of a connection, in simulated time."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._last_s = connection.clock()
        connection.add_listener(self._note)

    def _note(self, message: Any) -> None:
        if message.get_type() == "PARAM_VALUE":
            self._last_s = self._connection.clock()

    def time_since(self, _name: str) -> float:
        return self._connection.clock() - self._last_s

    def param_fetch_all(self) -> None:
        self._connection.send(mavlink.MAVLink_param_request_list_message(1, 1))

    def param_fetch_one(self, index: int) -> None:
        self._connection.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", index))


@pytest.mark.parametrize("baud", [9600, 115200])
def test_mavproxys_own_download_completes_on_a_bad_radio(baud: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its parameter module itself, unchanged, on the simulated clock."""
    with robot_with(baud) as robot:
        link = RadioLink(robot, bad_radio(baud), seed=4)
        monkeypatch.setattr(time, "time", lambda: 1e9 + link.clock_s())
        with station(robot, link) as there:
            console = SimpleNamespace(settings=SimpleNamespace(param_ftp=False))
            state = ParamState({}, None, "Rover", "parameters", console, 1)
            side = MavProxySide(there.connection)
            there.connection.add_listener(lambda message: state.handle_mavlink_packet(side, message))
            start_s, count = link.clock_s(), len(parameter_table())
            while len(state.mav_param_set) < count and link.clock_s() < start_s + 300.0:
                state.fetch_check(side)
                there.pump(0.05)
            took_s = link.clock_s() - start_s
        assert len(state.mav_param_set) == count
        assert took_s < 120.0
