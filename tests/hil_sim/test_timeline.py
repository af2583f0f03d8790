# SPDX-License-Identifier: MIT
from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.record import sample_dtype
from hil_sim.scenario import Event, Scenario, load_scenario
from hil_sim.timeline import play
from omniwheel._core import lib

AFTER_TICKS = lib.HIL_AFTER_TICKS
DISARMED_TICKS = lib.HIL_DISARMED_TICKS
START_TICKS = lib.HIL_START_TICKS


class ScriptedLoop:
    """A robot that is armed when told, is on its path from tick 300 to 1300 and writes down what is done to it."""

    def __init__(self, *, path: tuple[int, int] = (300, 1300), stops_at: int = 10**9) -> None:
        self.ticks = 0
        self.seen: list[tuple[int, Event]] = []
        self.placed_at = -1
        self._path, self._stops_at = path, stops_at
        self._armed = False

    def advance(self, ticks: int) -> NDArray[Any]:
        samples = np.zeros(ticks, dtype=sample_dtype())
        number = self.ticks + np.arange(ticks)
        samples["time_s"] = number * 1e-3
        samples["state"] = np.where(self._armed & (number < self._stops_at), metrics.STATE_ARMED, 1)
        start, stop = self._path
        phase = np.select([number >= stop, number >= start], [metrics.PHASE_DONE, metrics.PHASE_PATH], 0)
        samples["phase"] = np.where(samples["state"] == metrics.STATE_ARMED, phase, 0)
        self.ticks += ticks
        return samples

    def place(self) -> None:
        self.placed_at = self.ticks

    def apply(self, event: Event) -> None:
        self.seen.append((self.ticks, event))
        self._armed = {"arm": True, "disarm": False}.get(str(event.command), self._armed)

    def path_ticks(self, share: float) -> int:
        return round(share * (self._path[1] - self._path[0]))


def scenario(*events: Event, duration_s: float | None = None) -> Scenario:
    return replace(load_scenario("demo"), events=events, duration_s=duration_s)


ARM = Event(at_s=0.1, command="arm")


def test_events_happen_at_their_ticks_in_the_order_of_time() -> None:
    loop = ScriptedLoop()
    late, half = Event(at_s=0.9, settings={"WS_P": 1.0}), Event(at_progress=0.5, settings={"WS_P": 2.0})
    played = play(scenario(late, half, ARM), loop)
    assert [(tick, event) for tick, event in loop.seen[:-1]] == [(100, ARM), (800, half), (900, late)]
    assert [entry.time_s for entry in played.applied] == pytest.approx([0.1, 0.8, 0.9])
    assert loop.placed_at == 1


def test_a_run_until_done_goes_on_for_half_a_second_and_disarms() -> None:
    loop = ScriptedLoop()
    played = play(scenario(ARM), loop)
    assert played.done
    assert loop.seen[-1][0] == 1300 + AFTER_TICKS
    assert loop.seen[-1][1].command == "disarm"
    assert len(played.record) == played.ticks == 1300 + AFTER_TICKS + DISARMED_TICKS
    assert np.all(played.record["state"][-DISARMED_TICKS:] == 1)


def test_a_robot_that_stops_by_itself_ends_the_run() -> None:
    loop = ScriptedLoop(stops_at=750)
    played = play(scenario(ARM), loop)
    assert not played.done
    assert loop.seen[-1][0] == 750 + AFTER_TICKS


def test_a_robot_that_does_not_arm_ends_the_run() -> None:
    loop = ScriptedLoop()
    played = play(scenario(Event(at_s=0.1, command="trajectory_start")), loop)
    assert not played.done
    assert loop.seen[-1][0] == 100 + START_TICKS


def test_a_duration_is_kept() -> None:
    loop = ScriptedLoop()
    never = Event(at_s=0.7, settings={"WS_P": 1.0})
    played = play(scenario(ARM, never, duration_s=0.65), loop)
    assert played.ticks == 650 + DISARMED_TICKS
    assert never not in [event for _, event in loop.seen]


def test_progress_is_told_with_the_expected_end() -> None:
    told: list[tuple[float, float | None]] = []
    played = play(scenario(ARM), ScriptedLoop(), lambda now, end: told.append((now, end)))
    assert [now for now, _ in told] == sorted(now for now, _ in told)
    assert told[0][1] is None
    assert told[-1][1] == pytest.approx(played.ticks * 1e-3)
