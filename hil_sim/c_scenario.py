# SPDX-License-Identifier: MIT
"""A scenario as the C code plays it: ``hil_scenario_t`` of timeline.h."""

from __future__ import annotations

from typing import Any

from hil_sim import core
from hil_sim.dispersion import check_extremes, dispersion_table, drawn_values
from hil_sim.scenario import Event, Scenario
from hil_sim.timeline import TICKS_PER_S
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel._core import ffi, lib

NEVER: int = 2**64 - 1
_ACTIONS = {
    "arm": lib.HIL_ACTION_ARM,
    "disarm": lib.HIL_ACTION_DISARM,
    "estop": lib.HIL_ACTION_ESTOP,
    "trajectory_start": lib.HIL_ACTION_TRAJECTORY_START,
    "trajectory_stop": lib.HIL_ACTION_TRAJECTORY_STOP,
}


def scenario_world(scenario: Scenario) -> Any:
    """Return a new ``hil_world_config_t *`` of the scenario and its seed. Raises WorldError, SchemaError."""
    config = _middle_world(scenario)
    entries = scenario.dispersion
    lib.hil_disperse(config, dispersion_table(entries, config.wheels), len(entries), scenario.seed)
    return config


def drawn_world(scenario: Scenario) -> dict[str, float | list[float]]:
    """Return the quantities that differ from run to run as they are with this scenario's seed; SI units."""
    return drawn_values(scenario.dispersion, scenario_world(scenario)) if scenario.dispersion else {}


def _middle_world(scenario: Scenario) -> Any:
    config = world_config(
        scenario.world_robot or scenario.robot,
        plant=scenario.plant,
        seed=scenario.seed,
        pose_sensor=NO_POSE_SENSOR,
        start_pose=scenario.start_pose,
        faults=scenario.faults,
        **scenario.world,
    )
    check_extremes(scenario.source, scenario.dispersion, config)
    return config


class CScenario:
    """Owns a ``hil_scenario_t`` and all that it points to; constant after building, so threads may share it.

    Raises CoreError for parameters and WorldError for a world that are refused.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        table = scenario.robot.table
        values = scenario.parameter_values()
        self._world = _middle_world(scenario)
        World(self._world)
        self._dispersion = dispersion_table(scenario.dispersion, self._world.wheels)
        self._config = core.robot_config(values, table, 0)
        self._values = ffi.new("omni_real_t[]", [values[parameter.name] for parameter in table.parameters])
        self._index = {parameter.name: number for number, parameter in enumerate(table.parameters)}
        self._settings = ffi.new("hil_setting_t[]", self._setting_rows())
        self._events = ffi.new("hil_event_t[]", len(scenario.events))
        self._fill_events()
        self.c: Any = ffi.new("hil_scenario_t *")
        self.c.world, self.c.robot, self.c.values = self._world, self._config, self._values
        self.c.events, self.c.event_count, self.c.settings = self._events, len(scenario.events), self._settings
        self.c.dispersion, self.c.dispersion_count = self._dispersion, len(scenario.dispersion)
        ends = scenario.duration_s is not None
        self.c.end_tick = round((scenario.duration_s or 0.0) * TICKS_PER_S) if ends else NEVER

    def _setting_rows(self) -> list[tuple[int, float]]:
        settings = [event.settings or {} for event in self.scenario.events]
        return [(self._index[name], value) for entry in settings for name, value in entry.items()]

    def _fill_events(self) -> None:
        first_setting = 0
        for slot, event in zip(self._events, self.scenario.events, strict=True):
            slot.on_path = event.at_progress is not None
            slot.share = event.at_progress or 0.0
            slot.tick = round((event.at_s or 0.0) * TICKS_PER_S)
            slot.first_setting, slot.setting_count = first_setting, len(event.settings or {})
            first_setting += slot.setting_count
            slot.action = _action(event)
            slot.value = tuple(event.velocity or event.duty or ())


def _action(event: Event) -> int:
    if event.settings is not None:
        return int(lib.HIL_ACTION_SET)
    if event.velocity is not None:
        return int(lib.HIL_ACTION_VELOCITY)
    return int(lib.HIL_ACTION_DUTY if event.duty is not None else _ACTIONS[str(event.command)])
