# SPDX-License-Identifier: MIT
"""Plays a scenario's events on a closed loop of robot and world, the same way in process and over a link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil_sim.metrics import PHASE_DONE, PHASE_PATH, STATE_ARMED
from hil_sim.scenario import MAX_DURATION_S, Event, Scenario
from omniwheel.errors import OmniError

TICKS_PER_S = 1000
CHUNK_TICKS = 200
"""The record is looked at this often; both loops use it, so that they find the path's start at the same tick."""
AFTER_TICKS = 500
"""How long a run goes on after the trajectory is done or the robot stopped by itself."""
DISARMED_TICKS = 100
"""How long it goes on after the final disarm, to show that the motors are off."""
START_TICKS = 2000
"""A robot that is not armed this long after the last timed event will not start."""

Progress = Callable[[float, float | None], None]
"""Called with the simulated time and the expected end of the run [s], None while that is not known."""


class RunError(OmniError):
    """A run cannot start or go on; the message says why."""


class Loop(Protocol):
    """Robot and world, closed. Time starts at zero and advances in ticks of a millisecond."""

    @property
    def ticks(self) -> int:
        """Ticks run so far."""

    def advance(self, ticks: int) -> NDArray[Any]:
        """Run this many ticks and return their samples."""

    def place(self) -> None:
        """Tell the robot where it stands."""

    def apply(self, event: Event) -> None:
        """Do to the robot what the event says, before the next tick; RunError if the robot refuses."""

    def path_ticks(self, share: float) -> int:
        """Return the ticks from the path's start until this share of it is driven."""


@dataclass(frozen=True)
class Applied:
    """An event of the scenario and the simulated time [s] at which it happened."""

    time_s: float
    event: Event


@dataclass(frozen=True)
class Played:
    """What came of a timeline: samples, events as they happened, and whether the trajectory was driven to its end."""

    record: NDArray[Any]
    applied: tuple[Applied, ...]
    ticks: int
    done: bool


class _Watch:
    """Looks for the moments that the timeline depends on, in the samples as they come."""

    def __init__(self) -> None:
        self.armed = False
        self.path_start: int | None = None
        self.done: int | None = None
        self.stopped: int | None = None

    def look(self, samples: NDArray[Any]) -> None:
        ticks = np.rint(samples["time_s"] * TICKS_PER_S).astype(np.int64)
        armed = samples["state"] == STATE_ARMED
        if self.path_start is None:
            self.path_start = _first(ticks, armed & (samples["phase"] == PHASE_PATH))
        if self.done is None:
            self.done = _first(ticks, armed & (samples["phase"] == PHASE_DONE))
        if self.stopped is None:
            was_armed = np.concatenate(([self.armed], np.logical_or.accumulate(armed)[:-1] | self.armed))
            self.stopped = _first(ticks, was_armed & ~armed)
        self.armed = self.armed or bool(np.any(armed))


def _first(ticks: NDArray[np.int64], where: NDArray[np.bool_]) -> int | None:
    found = np.flatnonzero(where)
    return int(ticks[found[0]]) if len(found) else None


class _Timeline:
    """The scenario's events and its end, in ticks as far as they are known."""

    def __init__(self, scenario: Scenario, loop: Loop) -> None:
        self.loop = loop
        self.watch = _Watch()
        self.timed = sorted(
            ((round(event.at_s * TICKS_PER_S), event) for event in scenario.events if event.at_s is not None),
            key=lambda entry: entry[0],
        )
        self.on_path = [event for event in scenario.events if event.at_progress is not None]
        self.fixed_end = None if scenario.duration_s is None else round(scenario.duration_s * TICKS_PER_S)
        self.start_limit = (self.timed[-1][0] if self.timed else 0) + START_TICKS
        self.applied: list[Applied] = []

    def resolve(self) -> None:
        """Turn shares of the path into ticks once the path's start is known."""
        if self.watch.path_start is None or not self.on_path:
            return
        for event in self.on_path:
            share = event.at_progress or 0.0
            self.timed.append((self.watch.path_start + self.loop.path_ticks(share), event))
        self.on_path = []
        self.timed.sort(key=lambda entry: entry[0])

    def apply_due(self) -> None:
        while self.timed and self.timed[0][0] <= self.loop.ticks:
            _, event = self.timed.pop(0)
            self.loop.apply(event)
            self.applied.append(Applied(self.loop.ticks / TICKS_PER_S, event))

    def end(self) -> int:
        """Return the tick at which the run ends as far as is known now."""
        if self.fixed_end is not None:
            return self.fixed_end
        ends = [moment + AFTER_TICKS for moment in (self.watch.done, self.watch.stopped) if moment is not None]
        if not self.watch.armed:
            ends.append(self.start_limit)
        return min([*ends, round(MAX_DURATION_S * TICKS_PER_S)])

    def expected_end_s(self) -> float | None:
        """Return when the run will probably end [s], None if that is not known yet."""
        if self.fixed_end is not None:
            return (self.fixed_end + DISARMED_TICKS) / TICKS_PER_S
        if self.watch.path_start is None:
            return None
        return (self.watch.path_start + self.loop.path_ticks(1.0) + AFTER_TICKS + DISARMED_TICKS) / TICKS_PER_S

    def next_stop(self) -> int:
        chunk_end = (self.loop.ticks // CHUNK_TICKS + 1) * CHUNK_TICKS
        events = [self.timed[0][0]] if self.timed else []
        return min([chunk_end, self.end(), *events])


def play(scenario: Scenario, loop: Loop, progress: Progress | None = None) -> Played:
    """Run the scenario to its end, disarm, and return what happened."""
    timeline = _Timeline(scenario, loop)
    chunks = [loop.advance(1)]
    loop.place()
    while loop.ticks < timeline.end():
        timeline.apply_due()
        chunks.append(loop.advance(max(timeline.next_stop() - loop.ticks, 1)))
        timeline.watch.look(chunks[-1])
        timeline.resolve()
        if progress is not None:
            progress(loop.ticks / TICKS_PER_S, timeline.expected_end_s())
    loop.apply(Event(at_s=loop.ticks / TICKS_PER_S, command="disarm"))
    chunks.append(loop.advance(DISARMED_TICKS))
    return Played(np.concatenate(chunks), tuple(timeline.applied), loop.ticks, timeline.watch.done is not None)
