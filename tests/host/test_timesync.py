# SPDX-License-Identifier: MIT
"""The robot's clock through a radio that delays, on simulated clocks."""

from __future__ import annotations

import random

import pytest

from omniwheel.connection import Connection
from omniwheel.dialect import mavlink
from omniwheel.timesync import ROBOT_RESOLUTION_S, TimeSync

STEP_S = 0.005


class Radio:
    """A link with a robot behind it that answers TIMESYNC; each way takes a random time, the clocks drift apart."""

    url = "radio"

    def __init__(self, seed: int, *, offset_s: float = -1000.0, drift: float = 5e-5, slowest_s: float = 0.1) -> None:
        self.now_s = 2000.0
        self.offset_s = offset_s
        self.drift = drift
        self.slowest_s = slowest_s
        self.mute = False
        self.foreign = False
        self.requests = 0
        self._random = random.Random(seed)
        self._up: list[tuple[float, int]] = []
        self._down: list[tuple[float, bytes]] = []
        self._reader = mavlink.MAVLink(None, 1, 1)
        self._writer = mavlink.MAVLink(None, 7, 1)

    def clock(self) -> float:
        return self.now_s

    def robot_s(self, host_s: float) -> float:
        return host_s + self.offset_s + self.drift * (host_s - 2000.0)

    def write(self, data: bytes) -> None:
        for message in self._reader.parse_buffer(data) or ():
            self.requests += 1
            assert message.tc1 == 0
            self._up.append((self.now_s + self._delay(), message.ts1))

    def _delay(self) -> float:
        return 0.02 + self.slowest_s * self._random.random() ** 3

    def read(self, timeout_s: float) -> bytes:
        self.now_s += STEP_S
        for arrival_s, stamp in [entry for entry in self._up if entry[0] <= self.now_s]:
            self._up.remove((arrival_s, stamp))
            robot_ns = int(self.robot_s(arrival_s) / ROBOT_RESOLUTION_S) * int(ROBOT_RESOLUTION_S * 1e9)
            stamp = stamp + 1 if self.foreign else stamp
            answer = mavlink.MAVLink_timesync_message(robot_ns, stamp).pack(self._writer)
            self._down.append((arrival_s + self._delay(), bytes(answer)))
        due = [entry for entry in self._down if entry[0] <= self.now_s]
        self._down = [entry for entry in self._down if entry[0] > self.now_s]
        return b"" if self.mute else b"".join(frame for _, frame in due)

    def close(self) -> None:
        pass


def synchronised(radio: Radio, seconds: float) -> TimeSync:
    sync = TimeSync(Connection(radio, clock=radio.clock, heartbeat=False))
    serve(radio, sync, seconds)
    return sync


def serve(radio: Radio, sync: TimeSync, seconds: float) -> None:
    end_s = radio.now_s + seconds
    while radio.now_s < end_s:
        sync.serve()
        sync._connection.poll(STEP_S)


@pytest.mark.parametrize("seed", range(5))
def test_the_offset_stays_within_the_error_it_claims_while_clocks_drift(seed: int) -> None:
    radio = Radio(seed)
    sync = synchronised(radio, 1.0)
    for _ in range(40):
        serve(radio, sync, 5.0)
        best = sync.best
        assert best is not None
        error_s = abs(sync.robot_time_us(radio.now_s) * 1e-6 - radio.robot_s(radio.now_s))
        assert error_s <= best.error_s(radio.now_s)
        assert error_s < 0.015  # the quickest of many round trips, not the average one, which is off by up to 50 ms
    assert sync.restarts == 0


def test_a_quick_sample_is_preferred_to_newer_slow_ones() -> None:
    radio = Radio(1, slowest_s=0.0)
    sync = synchronised(radio, 1.0)
    quick = sync.best
    radio.slowest_s = 0.5
    serve(radio, sync, 10.0)
    assert sync.best == quick


def test_it_asks_quickly_first_and_then_seldom() -> None:
    radio = Radio(1)
    sync = synchronised(radio, 2.0)
    assert 8 <= radio.requests <= 14
    before = radio.requests
    serve(radio, sync, 20.0)
    assert radio.requests - before == pytest.approx(10, abs=1)


def test_a_rebooted_robot_is_noticed_at_its_first_answer() -> None:
    radio = Radio(2)
    sync = synchronised(radio, 5.0)
    radio.offset_s = -2004.5
    serve(radio, sync, 3.0)
    assert sync.restarts == 1
    assert sync.robot_time_us(radio.now_s) * 1e-6 == pytest.approx(radio.robot_s(radio.now_s), abs=0.06)


def test_without_an_answer_of_its_own_it_knows_nothing() -> None:
    radio = Radio(3)
    radio.foreign = True
    sync = synchronised(radio, 2.0)
    assert not sync.synchronised
    assert sync.best is None
    with pytest.raises(ValueError, match="TIMESYNC"):
        sync.robot_time_us(1.0)
    sync.close()
