# SPDX-License-Identifier: MIT
"""A scenario as the C code plays it: ``hil_scenario_t`` of player.h."""

from __future__ import annotations

from typing import Any

from hil_sim import core
from hil_sim.c_events import end_tick, event_table
from hil_sim.dispersion import check_extremes, dispersion_table, drawn_values
from hil_sim.scenario import Scenario
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel._core import ffi, lib


def scenario_world(scenario: Scenario) -> Any:
    """Return a new ``hil_world_config_t *`` of the scenario and its seed. Raises WorldError, SchemaError."""
    config = _middle_world(scenario)
    entries = scenario.dispersion
    lib.hil_apply_dispersion(config, dispersion_table(entries, config.wheels), len(entries), scenario.seed)
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
        patches=scenario.patches,
        **scenario.world,
        **scenario.wheel_numbers,
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
        self._events = event_table(scenario)
        self.c: Any = ffi.new("hil_scenario_t *")
        self.c.world, self.c.robot, self.c.values = self._world, self._config, self._values
        self.c.events, self.c.event_count, self.c.settings = self._events, len(scenario.events), self._settings
        self.c.dispersion, self.c.dispersion_count = self._dispersion, len(scenario.dispersion)
        self.c.end_tick = end_tick(scenario)

    def _setting_rows(self) -> list[tuple[int, float]]:
        settings = [event.settings or {} for event in self.scenario.events]
        return [(self._index[name], value) for entry in settings for name, value in entry.items()]
