# SPDX-License-Identifier: MIT
"""Runs of scenarios: what they all give, and those without a link, around ``omni_robot_tick`` in this process."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.metrics import STATE_ARMED
from hil_sim.record import Record
from hil_sim.scenario import Event, Scenario
from hil_sim.timeline import Applied, Played, Progress, RunError, play
from hil_sim.world import NO_POSE_SENSOR, World, world_config
from omniwheel._core import ffi, lib

Measure = TypeVar("Measure")

EVENTS = {
    "arm": "OMNI_EVENT_ARM",
    "disarm": "OMNI_EVENT_DISARM",
    "estop": "OMNI_EVENT_ESTOP",
    "trajectory_start": "OMNI_EVENT_TRAJECTORY_START",
    "trajectory_stop": "OMNI_EVENT_TRAJECTORY_STOP",
}


_WORLD_FIELDS = {"coulomb_friction_N_m": "motor_coulomb_N_m"}
"""Keys of a scenario's [world] that ``hil_world_config_t`` names differently."""


@dataclass(frozen=True)
class Run:
    """What a run leaves: the scenario, the world's record (one row of hil_sample_t per tick), and how it came about.

    ``way`` is "in-process" or "hil". ``parameters`` are those the run ended with. ``tick_us`` holds the mean and
    the longest time of a tick that the firmware measured [us], empty in process. ``wall_s`` is the time that the
    ticks took.
    """

    scenario: Scenario
    way: str
    record: NDArray[Any]
    applied: tuple[Applied, ...]
    ticks: int
    done: bool
    wall_s: float
    parameters: dict[str, float]
    firmware_version: str
    tick_us: dict[str, float] = field(default_factory=dict)
    messages: tuple[str, ...] = ()

    @property
    def realtime_factor(self) -> float:
        """Simulated time divided by wall time."""
        return self.ticks * 1e-3 / self.wall_s if self.wall_s > 0.0 else float("inf")


def new_world(scenario: Scenario) -> World:
    """Return the scenario's world at time zero."""
    numbers = {_WORLD_FIELDS.get(name, name): value for name, value in scenario.world.items()}
    return World(
        world_config(
            scenario.world_robot or scenario.robot,
            plant=scenario.plant,
            seed=scenario.seed,
            pose_sensor=NO_POSE_SENSOR,
            start_pose=scenario.start_pose,
            faults=scenario.faults,
            **numbers,
        )
    )


class InProcessLoop:
    """The world around ``omni_robot_tick``, with the set-points and events a link would bring."""

    def __init__(self, scenario: Scenario) -> None:
        self._table = scenario.robot.table
        self.values = scenario.parameter_values()
        self.world = new_world(scenario)
        self._robot = ffi.new("omni_robot_t *")
        self._inputs = ffi.new("omni_inputs_t *")
        self._outputs = ffi.new("omni_outputs_t *")
        self._ticks = 0
        self._sequence = 0
        self._config = core.robot_config(self.values, self._table, 0)
        self._plan: Any = None
        lib.omni_robot_init(self._robot, self._config)
        self._start_pose = scenario.start_pose

    @property
    def ticks(self) -> int:
        """Ticks run so far."""
        return self._ticks

    def advance(self, ticks: int) -> NDArray[Any]:
        """Run ticks in C and return their samples."""
        record = Record(ticks)
        lib.hil_run_in_process(self.world.c, self._robot, self._inputs, self._outputs, ticks, record.c)
        self._ticks += ticks
        return record.samples

    def place(self) -> None:
        """Restart the pose estimate where the robot stands."""
        self._inputs.pose.x, self._inputs.pose.y, self._inputs.pose.theta = self._start_pose
        self._inputs.events |= lib.OMNI_EVENT_SET_POSE

    def apply(self, event: Event) -> None:
        """Hand an event to the next tick."""
        if event.settings is not None:
            self._set(event)
        elif event.velocity is not None:
            self._inputs.setpoint.kind = lib.OMNI_SETPOINT_VELOCITY_BODY
            twist = self._inputs.setpoint.twist
            twist.vx, twist.vy, twist.wz = event.velocity
        elif event.duty is not None:
            self._inputs.setpoint.kind = lib.OMNI_SETPOINT_DUTY
            for wheel, duty in enumerate(event.duty):
                self._inputs.setpoint.duty[wheel] = duty
        else:
            self._command(str(event.command))

    def path_ticks(self, share: float) -> int:
        """Return the ticks from the path's start until this share of it is driven."""
        return core.path_ticks(self._config, share)

    def _set(self, event: Event) -> None:
        self.values.update(event.settings or {})
        self._sequence += 1
        self._config = core.robot_config(self.values, self._table, self._sequence)
        lib.omni_robot_set_config(self._robot, self._config)

    def _command(self, command: str) -> None:
        if command == "arm":
            faults = lib.omni_robot_arming_faults(self._robot, self._outputs)
            if faults:
                raise RunError(f"the robot refuses to arm: {', '.join(core.fault_names(faults))}")
        if command == "trajectory_start":
            self._plan = core.plan_trajectory(self._config, ffi.addressof(self._outputs, "pose"))
            self._inputs.trajectory = self._plan
            self._inputs.setpoint.kind = lib.OMNI_SETPOINT_TRAJECTORY
        if command == "trajectory_stop":
            self._inputs.setpoint.kind = lib.OMNI_SETPOINT_NONE
        self._inputs.events |= getattr(lib, EVENTS[command])


def run_in_process(scenario: Scenario, seed: int | None = None, progress: Progress | None = None) -> Run:
    """Run a scenario in this process."""
    scenario = scenario.with_seed(seed)
    loop = InProcessLoop(scenario)
    start = time.perf_counter()
    played = play(scenario, loop, progress)
    return finish(scenario, "in-process", played, time.perf_counter() - start, loop.values, "in-process")


def run_seeds(scenario: Scenario, seeds: Iterable[int], measure: Callable[[Run], Measure]) -> Iterator[Measure]:
    """Run a scenario with several seeds on all processors; yield what ``measure`` says of each, in their order."""
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        yield from pool.map(lambda seed: measure(run_in_process(scenario, seed)), seeds)


def finish(
    scenario: Scenario, way: str, played: Played, wall_s: float, parameters: dict[str, float], firmware_version: str
) -> Run:
    """Return the run that a played timeline makes."""
    return Run(
        scenario=scenario,
        way=way,
        record=played.record,
        applied=played.applied,
        ticks=played.ticks,
        done=played.done,
        wall_s=wall_s,
        parameters=dict(parameters),
        firmware_version=firmware_version,
    )


def faults_seen(run: Run) -> tuple[list[str], list[str]]:
    """Return the names of the stop faults and of the warnings that were present at any time after arming."""
    armed = np.flatnonzero(run.record["state"] == STATE_ARMED)
    since_arming = run.record["faults"][armed[0] :] if len(armed) else run.record["faults"]
    bits = int(np.bitwise_or.reduce(since_arming)) if len(since_arming) else 0
    return core.fault_names(bits), core.warning_names(bits)
