# SPDX-License-Identifier: MIT
from __future__ import annotations

import random
from itertools import islice
from typing import Any

import pytest

from hil_sim.lockstep import LockstepLink
from omniwheel.bringup import check_radio
from omniwheel.bringup.radio import PING_BYTES, SHARE, judge_radio, watch_radio
from omniwheel.dialect import mavlink
from tests.host.bringup.conftest import MakeBench

HEADER, CHECKSUM = 10, 2


def frames(data: bytes) -> list[bytes]:
    """Split unsigned MAVLink 2 frames."""
    found = []
    while data:
        length = HEADER + data[1] + CHECKSUM
        found.append(data[:length])
        data = data[length:]
    return found


class Radio:
    """Loses frames of both directions by chance, and delivers the robot's late. Kind until ``loss`` is set."""

    def __init__(self, base: LockstepLink) -> None:
        self.url = "radio"
        self.loss = 0.0
        self.delay_s = 0.0
        self.written = 0
        self.extra = b""
        self._base = base
        self._random = random.Random(1)
        self._late: list[tuple[float, bytes]] = []

    def read(self, timeout_s: float) -> bytes:
        now_s = self._base.clock_s()
        for frame in frames(self._base.read(timeout_s)):
            if self._random.random() >= self.loss:
                self._late.append((now_s + self.delay_s, frame))
        due = [frame for due_s, frame in self._late if due_s <= self._base.clock_s()]
        self._late = [entry for entry in self._late if entry[0] > self._base.clock_s()]
        extra, self.extra = self.extra, b""
        return extra + b"".join(due)

    def write(self, data: bytes) -> None:
        self.written += len(data)
        if self._random.random() >= self.loss:
            self._base.write(data)

    def close(self) -> None:
        self._base.close()


def radio_of(make_bench: MakeBench) -> tuple[Any, Radio]:
    made: list[Radio] = []

    def wrap(link: LockstepLink) -> Radio:
        made.append(Radio(link))
        return made[0]

    return make_bench(wrap=wrap).robot, made[0]


def test_a_clean_link_passes_within_its_share_of_bytes(make_bench: MakeBench) -> None:
    robot, radio = radio_of(make_bench)
    before = radio.written
    result = check_radio(robot, duration_s=10.0, baud=9600)
    assert result.ok, result.advice
    assert result.measured["sent"] >= 90
    heartbeats = 21 * 13
    assert radio.written - before <= SHARE * 960 * 10 + 2 * PING_BYTES + heartbeats


def test_the_pings_slow_down_on_a_slower_link(make_bench: MakeBench) -> None:
    robot, _ = radio_of(make_bench)
    assert check_radio(robot, duration_s=10.0, baud=2400).measured["sent"] <= 0.3 * 240 * 10 / PING_BYTES + 3


def test_losses_are_measured_both_ways_and_advised_on(make_bench: MakeBench) -> None:
    robot, radio = radio_of(make_bench)
    radio.loss = 0.2
    result = check_radio(robot, duration_s=20.0)
    assert not result.ok
    assert result.measured["loss"] == pytest.approx(1 - 0.8**2, abs=0.12)
    assert result.measured["down_loss"] == pytest.approx(0.2, abs=0.06)
    assert "antenna" in result.advice[0]


def test_a_slow_link_is_told_from_a_lossy_one(make_bench: MakeBench) -> None:
    robot, radio = radio_of(make_bench)
    radio.delay_s = 0.7
    result = check_radio(robot, duration_s=5.0)
    assert [finding.name for finding in result.findings if not finding.ok] == ["round trip"]
    assert result.measured["round_trip_median_s"] == pytest.approx(0.7, abs=0.05)
    assert "LINKn_BUDGET" in result.advice[0]


def test_a_silent_link_is_all_loss(make_bench: MakeBench) -> None:
    robot, radio = radio_of(make_bench)
    radio.loss = 1.0
    result = check_radio(robot, duration_s=2.0)
    assert not result.ok
    assert result.measured["answered"] == 0


def test_signal_strength_where_the_radio_tells_it(make_bench: MakeBench) -> None:
    robot, radio = radio_of(make_bench)
    modem = mavlink.MAVLink(None, robot.connection.target_system, 68)
    radio.extra = bytes(mavlink.MAVLink_radio_status_message(180, 170, 100, 20, 20, 0, 0).pack(modem))
    result = check_radio(robot, duration_s=2.0)
    assert (result.measured["rssi"], result.measured["remote_rssi"]) == (180, 170)
    assert result.ok


def test_a_walk_out_of_range_shows_window_by_window(make_bench: MakeBench) -> None:
    robot, radio = radio_of(make_bench)
    windows = watch_radio(robot)
    near = next(windows)
    radio.loss = 1.0
    far = list(islice(windows, 2))[-1]
    radio.loss = 0.0
    back = list(islice(windows, 2))[-1]
    assert (near.loss, far.loss, back.loss) == (0.0, 1.0, 0.0)
    assert judge_radio(back, 0.05, 0.5).findings[0].ok
