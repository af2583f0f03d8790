# SPDX-License-Identifier: MIT
"""A robot in its world, driven by velocities tick by tick, for what compares its currents with the true ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hil_sim import core
from hil_sim.runs import new_world
from hil_sim.scenario import Scenario, load_scenario
from omniwheel._core import ffi, lib

__all__ = ["Drive", "load_scenario"]


class Drive:
    """A robot in its world, driven by velocities."""

    def __init__(self, scenario: Scenario, **parameters: float) -> None:
        values = {**scenario.parameter_values(), **parameters}
        self.wheels = scenario.robot.wheels
        self.stall_A = values["BAT_V_NOM"] / values["MOT_R"]
        self.run = ffi.new("hil_run_t *")
        self.world = new_world(scenario)
        why = ffi.new("char[]", 160)
        self.config = core.robot_config(values, scenario.robot.table, 0)
        assert lib.hil_run_init(self.run, ffi.addressof(self.world.c, "config"), self.config, why, 160) == lib.HIL_OK
        lib.hil_run_advance(self.run, 50)
        self.run.inputs.events |= lib.OMNI_EVENT_ARM

    def ticks(self, count: int, twist: tuple[float, float, float]) -> Iterator[Any]:
        """Ask for a body velocity; yield after every tick."""
        for _ in range(count):
            setpoint = self.run.inputs.setpoint
            setpoint.kind = lib.OMNI_SETPOINT_VELOCITY_BODY
            setpoint.time_us = self.run.world.time_us
            setpoint.twist.vx, setpoint.twist.vy, setpoint.twist.wz = twist
            lib.hil_run_advance(self.run, 1)
            yield self.run

    def true_A(self) -> list[float]:
        return list(self.run.world.current_A)[: self.wheels]
