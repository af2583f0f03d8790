# SPDX-License-Identifier: MIT
"""A robot in its world that moves along x while its parameters are changed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from hil_sim import core
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel._core import ffi, lib
from omniwheel.errors import CoreError

ROBOTS = {"demo": 0.1, "four_wheel": 0.1, "fast": 0.8}
"""Scenarios of the robots, and a speed that each reaches [m/s]."""
CONTROLLERS = range(lib.OMNI_CTL_MODE_COUNT)
FRESH_TICKS = 20
"""Ticks from one setpoint to the next: less than the shortest SAFE_CMD_TO."""
FIX_TICKS = 700
"""Fixes have told by then where the robot is."""
START_S = 1.0
"""A robot has its speed by then."""
STOP_S = 1.5
"""A robot that is too fast has stopped by then, whatever was changed."""
EXCESS = 1.2
"""Times its setpoint: a robot may be so fast."""
EXCESS_OF_ORIGINAL = 1.6
"""The same with the original law. It drives the wheels to and fro, so they slip; odometry alone does not see it."""


class Moving:
    """An armed robot that is asked to move along the x axis."""

    def __init__(self, scenario: str, kind: int, speed: float, **parameters: float) -> None:
        loaded = load_scenario(scenario)
        self._table = loaded.robot.table
        self._values = {**loaded.parameter_values(), **parameters}
        self.kind, self.speed, self.wheels = kind, speed, loaded.robot.wheels
        self._run = ffi.new("hil_run_t *")
        self._world = new_world(loaded)
        why = ffi.new("char[]", 160)
        config = core.robot_config(self._values, self._table, 0)
        world = ffi.addressof(self._world.c, "config")
        assert lib.hil_run_init(self._run, world, config, why, 160) == lib.HIL_OK
        lib.hil_run_advance(self._run, FIX_TICKS)
        self.event(lib.OMNI_EVENT_ARM)
        self._begin()

    @property
    def outputs(self) -> Any:
        """What the last tick gave."""
        return self._run.outputs

    @property
    def config(self) -> Any:
        """The configuration in use."""
        return lib.hil_run_config(self._run)

    def wheel_rad_s(self) -> list[float]:
        """Return the true speeds of the wheels."""
        return list(self._run.world.wheel_rad_s)[: self.wheels]

    def arming_faults(self) -> int:
        """Return what the robot would not be armed for."""
        return int(lib.omni_robot_arming_faults(ffi.addressof(self._run, "robot")))

    def event(self, event: int) -> None:
        """Run a tick with an event."""
        self._run.inputs.events |= event
        lib.hil_run_advance(self._run, 1)

    def pause(self, duration_s: float) -> None:
        """Let time pass without a new setpoint."""
        lib.hil_run_advance(self._run, round(duration_s * 1000))

    def change(self, values: Mapping[str, float]) -> bool:
        """Set parameters in motion, past all locks; False: the set is refused."""
        try:
            config = core.robot_config({**self._values, **values}, self._table, 1)
        except CoreError:
            return False
        lib.hil_run_set_config(self._run, config)
        return True

    def turn_to_speed(self, speed: float) -> None:
        """Ask for another speed from now on."""
        self._begin()
        self.speed = speed

    def move(self, duration_s: float) -> float:
        """Give setpoints for that long; return how far the robot gets [m]."""
        begin = list(self._run.world.pose)
        for _ in range(round(duration_s * 1000 / FRESH_TICKS)):
            self._ask()
            lib.hil_run_advance(self._run, FRESH_TICKS)
        end = self._run.world.pose
        return math.hypot(end[0] - begin[0], end[1] - begin[1])

    def _begin(self) -> None:
        pose = self._run.outputs.pose
        self._from = (pose.x, pose.y, pose.theta)
        self._from_us = self._run.world.time_us

    def _ask(self) -> None:
        now_us = self._run.world.time_us
        setpoint = self._run.inputs.setpoint
        setpoint.kind, setpoint.time_us = self.kind, now_us
        setpoint.twist.vx = self.speed
        setpoint.pose.x = self._from[0] + self.speed * (now_us - self._from_us) * 1e-6
        setpoint.pose.y, setpoint.pose.theta = self._from[1:]


def runs_away(scenario: str, kind: int, controller: int, values: Mapping[str, float]) -> bool:
    """Whether these parameters, set in motion, leave the robot armed and faster than EXCESS times what is asked."""
    speed = 0.5 * ROBOTS[scenario]
    excess = EXCESS_OF_ORIGINAL if controller == lib.OMNI_CTL_MODE_ORIGINAL else EXCESS
    robot = Moving(scenario, kind, speed, CTL_MODE=controller)
    robot.move(START_S)
    if not robot.change({"CTL_MODE": controller, **values}):
        return False
    robot.move(STOP_S)
    moved = robot.move(1.0)
    return moved > excess * speed and robot.outputs.state == lib.OMNI_STATE_ARMED
