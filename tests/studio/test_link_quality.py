# SPDX-License-Identifier: MIT
"""What the page says of a link: losses, round trips, the budget, and whether a simulation keeps real time."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from omni.studio.link_quality import ASK_S, OVER_S, LinkQuality
from omniwheel.connection import Connection
from omniwheel.dialect import mavlink

USB, RADIO = "tcp:127.0.0.1:5760", "/dev/ttyUSB0,9600"
KNOWN = {"LINK1_BUDGET": 200000.0, "LINK2_BUDGET": 10000.0, "LINK2_BAUD": 9600.0}


class Bench:
    """A connection without a link: frames are put in, and what is sent is kept."""

    def __init__(self, url: str = USB) -> None:
        self.now_s = 100.0
        self.sent: list[Any] = []
        self.connection = Connection(self, clock=lambda: self.now_s, heartbeat=False)  # type: ignore[arg-type]
        parameters = SimpleNamespace(known=dict(KNOWN))
        robot: Any = SimpleNamespace(url=url, connection=self.connection, parameters=parameters)
        self.quality = LinkQuality(robot)
        self._robot = mavlink.MAVLink(None, 1, 1)
        self._reader = mavlink.MAVLink(None)

    def write(self, data: bytes) -> None:
        self.sent += self._reader.parse_buffer(data) or []

    def hear(self, numbers: Sequence[int], message: Any = None) -> None:
        for number in numbers:
            self._robot.seq = number % 256
            packed = (message or mavlink.MAVLink_heartbeat_message(10, 0, 0, 0, 3, 3)).pack(self._robot)
            self.connection.feed(bytes(packed))

    def pass_time(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.1)):
            self.now_s += 0.1
            self.quality.serve()

    def answer(self, delay_s: float) -> None:
        """Answer the newest question for the time."""
        asked = self.sent[-1]
        self.now_s += delay_s
        self.hear([0], mavlink.MAVLink_timesync_message(5_000_000_000, asked.ts1))


def test_losses_are_a_share_of_the_frames_of_the_last_seconds() -> None:
    bench = Bench()
    bench.quality.serve()
    assert bench.quality.state()["lost"] is None
    bench.hear([n for n in range(250, 350) if n % 10])  # over the wrap of the numbers
    assert bench.quality.state()["lost"] == pytest.approx(9 / 99, abs=1e-3)  # the first one is not missed
    bench.pass_time(OVER_S + 2.0)
    bench.hear(range(350, 450))
    assert bench.quality.state()["lost"] == 0.0


def test_a_robot_that_restarts_and_a_radios_own_frames_are_no_loss() -> None:
    bench = Bench()
    bench.quality.serve()
    bench.hear(range(20))
    bench.hear([77], mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7))
    bench.hear(range(20, 40))
    bench.hear(range(20))  # restarted
    bench.hear([19])  # twice
    assert bench.quality.state()["lost"] == 0.0


def test_round_trips_are_measured_and_forgotten_when_nothing_answers() -> None:
    bench = Bench()
    bench.quality.serve()
    assert bench.quality.state()["round_trip_ms"] is None
    bench.answer(0.012)
    assert bench.quality.state()["round_trip_ms"] == pytest.approx(12.0, abs=0.1)
    bench.pass_time(5.0 * ASK_S)
    assert bench.quality.state()["round_trip_ms"] is None
    assert bench.quality.state()["asking"]
    bench.now_s += 5.0
    assert not bench.quality.state()["asking"]


@pytest.mark.parametrize(("url", "budget", "radio"), [(USB, 200000.0, False), (RADIO, 480.0, True)])
def test_the_budget_is_that_of_usb_or_of_the_radios_line(url: str, budget: float, radio: bool) -> None:
    state = Bench(url).quality.state()
    assert (state["budget_B_s"], state["radio"]) == (budget, radio)


def test_a_radio_is_asked_rarely() -> None:
    """Each question and its answer are 56 bytes of a line that carries 480 per second each way."""
    bench = Bench(RADIO)
    for _ in range(12):
        bench.pass_time(0.1)
        if bench.sent:
            bench.answer(0.0)
    before = len(bench.sent)
    bench.pass_time(40.0)
    assert len(bench.sent) - before <= 10


def test_a_slow_simulation_is_told_by_its_clock() -> None:
    bench = Bench()
    zeros = [0.0] * 3
    for step in range(60):
        tracking = mavlink.MAVLink_omni_tracking_message(1000 + 50 * step, zeros, zeros, zeros, zeros, 0.0, 0)
        bench.hear([step], tracking)
        bench.pass_time(0.1)
    assert bench.quality.state()["pace"] == pytest.approx(0.5, abs=0.02)
