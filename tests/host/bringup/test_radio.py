# SPDX-License-Identifier: MIT
from __future__ import annotations

from itertools import islice

import pytest

from omniwheel import Robot
from omniwheel.bringup import check_radio
from omniwheel.bringup.radio import PING_BYTES, SHARE, judge_radio, watch_radio
from omniwheel.dialect import mavlink
from tests.host.bringup.conftest import RadioLink

Radio = tuple[Robot, RadioLink]


def test_a_clean_link_passes_within_its_share_of_bytes(radio: Radio) -> None:
    robot, link = radio
    before = link.written
    result = check_radio(robot, duration_s=10.0, baud=9600)
    assert result.ok, result.advice
    assert result.measured["sent"] >= 90
    heartbeats = 21 * 13
    assert link.written - before <= SHARE * 960 * 10 + 2 * PING_BYTES + heartbeats


def test_the_pings_slow_down_on_a_slower_link(radio: Radio) -> None:
    robot, _ = radio
    assert check_radio(robot, duration_s=10.0, baud=2400).measured["sent"] <= 0.3 * 240 * 10 / PING_BYTES + 3


@pytest.mark.full
def test_losses_are_measured_both_ways_and_advised_on(radio: Radio) -> None:
    robot, link = radio
    link.loss = 0.2
    result = check_radio(robot, duration_s=20.0)
    assert not result.ok
    assert result.measured["loss"] == pytest.approx(1 - 0.8**2, abs=0.12)
    assert result.measured["down_loss"] == pytest.approx(0.2, abs=0.06)
    assert "antenna" in result.advice[0]


def test_a_slow_link_is_told_from_a_lossy_one(radio: Radio) -> None:
    robot, link = radio
    link.delay_s = 0.7
    result = check_radio(robot, duration_s=5.0)
    assert [finding.name for finding in result.findings if not finding.ok] == ["round trip"]
    assert result.measured["round_trip_median_s"] == pytest.approx(0.7, abs=0.05)
    assert "LINKn_BUDGET" in result.advice[0]


def test_a_silent_link_is_all_loss(radio: Radio) -> None:
    robot, link = radio
    link.loss = 1.0
    result = check_radio(robot, duration_s=2.0)
    assert not result.ok
    assert result.measured["answered"] == 0


def test_signal_strength_where_the_radio_tells_it(radio: Radio) -> None:
    robot, link = radio
    modem = mavlink.MAVLink(None, robot.connection.target_system, 68)
    link.extra = bytes(mavlink.MAVLink_radio_status_message(180, 170, 100, 20, 20, 0, 0).pack(modem))
    result = check_radio(robot, duration_s=2.0)
    assert (result.measured["rssi"], result.measured["remote_rssi"]) == (180, 170)
    assert result.ok


@pytest.mark.full
def test_a_walk_out_of_range_shows_window_by_window(radio: Radio) -> None:
    robot, link = radio
    windows = watch_radio(robot)
    near = next(windows)
    link.loss = 1.0
    far = list(islice(windows, 2))[-1]
    link.loss = 0.0
    back = list(islice(windows, 2))[-1]
    assert (near.loss, far.loss, back.loss) == (0.0, 1.0, 0.0)
    assert judge_radio(back, 0.05, 0.5).findings[0].ok
