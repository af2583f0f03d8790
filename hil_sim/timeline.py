# SPDX-License-Identifier: MIT
"""Plays a scenario's events on a closed loop of robot and world, over a link or any other :class:`Loop`.

What is to be done when, the C code says (timeline.h), the same one that plays runs in this process.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hil_sim.c_events import NEVER, TICKS_PER_S, end_tick, event_table
from hil_sim.scenario import Event, Scenario
from omniwheel._core import ffi, lib
from omniwheel.errors import OmniError

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


class _Timeline:
    """The scenario's events and its end: ``hil_timeline_t``."""

    def __init__(self, scenario: Scenario) -> None:
        self._events, count = event_table(scenario), len(scenario.events)
        self.moments = ffi.new("hil_moment_t[]", count)
        self._seen = ffi.new("hil_milestones_t *")
        self.c: Any = ffi.new("hil_timeline_t *")
        lib.hil_milestones_init(self._seen)
        lib.hil_timeline_init(self.c, self._events, count, end_tick(scenario), self.moments)

    def next(self, ticks: int) -> Any:
        """Return what is to be done next, a ``hil_step_t``."""
        return lib.hil_timeline_next(self.c, ticks)

    def look(self, samples: NDArray[Any]) -> None:
        """Look at what the ticks brought."""
        rows = np.ascontiguousarray(samples)
        lib.hil_milestones_from_record(self._seen, ffi.from_buffer("hil_sample_t[]", rows), len(rows))
        lib.hil_timeline_update(self.c, self._seen)

    def expected_end_s(self, loop: Loop) -> float | None:
        """Return when the run will probably end [s], None if that is not known yet."""
        path_ticks = loop.path_ticks(1.0) if self.c.end_tick == NEVER and self.c.path_start != NEVER else NEVER
        end = lib.hil_timeline_expected_end(self.c, path_ticks)
        return None if end == NEVER else end / TICKS_PER_S

    def applied(self, scenario: Scenario) -> tuple[Applied, ...]:
        """Return the events that have happened, in their order."""
        done = self.moments[0 : self.c.applied]
        return tuple(Applied(moment.applied_tick / TICKS_PER_S, scenario.events[moment.event]) for moment in done)


def play(scenario: Scenario, loop: Loop, progress: Progress | None = None) -> Played:
    """Run the scenario to its end, disarm, and return what happened."""
    timeline = _Timeline(scenario)
    chunks = []
    while (step := timeline.next(loop.ticks)).kind != lib.HIL_STEP_OVER:
        if step.kind == lib.HIL_STEP_RUN:
            chunks.append(loop.advance(step.ticks))
            timeline.look(chunks[-1])
            if progress is not None:
                progress(loop.ticks / TICKS_PER_S, timeline.expected_end_s(loop))
        else:
            _do(scenario, loop, timeline, step)
    return Played(np.concatenate(chunks), timeline.applied(scenario), loop.ticks, timeline.c.done != NEVER)


def _do(scenario: Scenario, loop: Loop, timeline: _Timeline, step: Any) -> None:
    if step.kind == lib.HIL_STEP_PLACE:
        loop.place()
    elif step.kind == lib.HIL_STEP_APPLY:
        loop.apply(scenario.events[step.event])
    elif step.kind == lib.HIL_STEP_LOCATE:
        lib.hil_timeline_set_offset(timeline.c, loop.path_ticks(scenario.events[step.event].at_progress or 0.0))
    else:
        loop.apply(Event(at_s=loop.ticks / TICKS_PER_S, command="disarm"))
