# SPDX-License-Identifier: MIT
"""A scenario's events as the C code has them: ``hil_event_t`` of timeline.h."""

from __future__ import annotations

from typing import Any

from hil_sim.scenario import Event, Scenario
from omniwheel._core import ffi, lib

TICKS_PER_S = 1000
NEVER: int = 2**64 - 1
"""A tick that does not come."""

_ACTIONS = {
    "arm": lib.HIL_ACTION_ARM,
    "disarm": lib.HIL_ACTION_DISARM,
    "estop": lib.HIL_ACTION_ESTOP,
    "trajectory_start": lib.HIL_ACTION_TRAJECTORY_START,
    "trajectory_stop": lib.HIL_ACTION_TRAJECTORY_STOP,
}


def event_table(scenario: Scenario) -> Any:
    """Return the events as ``hil_event_t[]``; their settings follow one another in the events' order."""
    table = ffi.new("hil_event_t[]", len(scenario.events))
    first_setting = 0
    for slot, event in zip(table, scenario.events, strict=True):
        slot.on_path = event.at_progress is not None
        slot.share = event.at_progress or 0.0
        slot.tick = round((event.at_s or 0.0) * TICKS_PER_S)
        slot.first_setting, slot.setting_count = first_setting, len(event.settings or {})
        first_setting += slot.setting_count
        slot.action = _action(event)
        slot.value = tuple(event.velocity or event.duty or ())
    return table


def end_tick(scenario: Scenario) -> int:
    """Return the tick at which the run ends, NEVER if the robot decides."""
    return NEVER if scenario.duration_s is None else round(scenario.duration_s * TICKS_PER_S)


def _action(event: Event) -> int:
    if event.settings is not None:
        return int(lib.HIL_ACTION_SET)
    if event.velocity is not None:
        return int(lib.HIL_ACTION_VELOCITY)
    return int(lib.HIL_ACTION_DUTY if event.duty is not None else _ACTIONS[str(event.command)])
