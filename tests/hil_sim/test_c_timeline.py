# SPDX-License-Identifier: MIT
"""Runs in this process and over a link do what the one timeline says exactly alike."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hil_sim import core
from hil_sim.c_events import TICKS_PER_S
from hil_sim.core import CoreError
from hil_sim.limits import MAX_DURATION_S
from hil_sim.record import Record
from hil_sim.runs import new_world, run_in_process
from hil_sim.scenario import Event, Scenario, load_scenario, scenario_names
from hil_sim.timeline import Played, RunError, play
from omniwheel._core import ffi, lib

BITS = {
    "arm": lib.OMNI_EVENT_ARM,
    "disarm": lib.OMNI_EVENT_DISARM,
    "estop": lib.OMNI_EVENT_ESTOP,
    "trajectory_start": lib.OMNI_EVENT_TRAJECTORY_START,
    "trajectory_stop": lib.OMNI_EVENT_TRAJECTORY_STOP,
}
ARM = Event(at_s=0.5, command="arm")
DRIVE = (Event(at_s=0.5, command="trajectory_start"), ARM)
TO_THE_END = ("demo", "fault_encoder_stuck")
SHORT = {"TRJ_SIZE": 0.02, "TRJ_PERIOD": 2.0, "TRJ_PETALS": 2.0}


class PythonLoop:
    """World and core closed in this process, for timeline.play."""

    def __init__(self, scenario: Scenario) -> None:
        self.ticks = 0
        self._table = scenario.robot.table
        self._values = scenario.parameter_values()
        self._start_pose = scenario.start_pose
        self._world = new_world(scenario)
        self._robot, self._inputs = ffi.new("omni_robot_t *"), ffi.new("omni_inputs_t *")
        self._outputs = ffi.new("omni_outputs_t *")
        self._sequence = 0
        self._config = core.robot_config(self._values, self._table, 0)
        self._plan: Any = None
        lib.omni_robot_init(self._robot, self._config)

    def advance(self, ticks: int) -> NDArray[Any]:
        record = Record(ticks)
        lib.hil_run_in_process(self._world.c, self._robot, self._inputs, self._outputs, ticks, record.c)
        self.ticks += ticks
        return record.samples

    def place(self) -> None:
        self._inputs.pose = self._start_pose
        self._inputs.events |= lib.OMNI_EVENT_SET_POSE

    def apply(self, event: Event) -> None:
        setpoint = self._inputs.setpoint
        if event.settings is not None:
            self._values.update(event.settings)
            self._sequence += 1
            self._config = core.robot_config(self._values, self._table, self._sequence)
            lib.omni_robot_set_config(self._robot, self._config)
        elif event.velocity is not None:
            setpoint.kind, setpoint.twist = lib.OMNI_SETPOINT_VELOCITY_BODY, event.velocity
        elif event.duty is not None:
            setpoint.kind, setpoint.duty = lib.OMNI_SETPOINT_DUTY, (*event.duty, 0.0)[: lib.OMNI_MAX_WHEELS]
        else:
            self._command(str(event.command))

    def path_ticks(self, share: float) -> int:
        return core.path_ticks(self._config, share)

    def _command(self, command: str) -> None:
        if command == "arm" and lib.omni_robot_arming_faults(self._robot):
            raise RunError("refused")
        if command == "trajectory_start":
            self._plan = core.plan_trajectory(self._config, ffi.addressof(self._outputs, "pose"))
            self._inputs.trajectory = self._plan
            self._inputs.setpoint.kind = lib.OMNI_SETPOINT_TRAJECTORY
        if command == "trajectory_stop":
            self._inputs.setpoint.kind = lib.OMNI_SETPOINT_NONE
        self._inputs.events |= BITS[command]


def assert_same(scenario: Scenario) -> Played:
    ours, theirs = run_in_process(scenario), play(scenario, PythonLoop(scenario))
    assert (ours.ticks, ours.done, ours.applied) == (theirs.ticks, theirs.done, theirs.applied)
    assert ours.record.tobytes() == theirs.record.tobytes()
    return theirs


def scenario(*events: Event, name: str = "demo", duration_s: float | None = None, **parameters: float) -> Scenario:
    base = replace(load_scenario(name), events=events, duration_s=duration_s, start_pose=(0.02, 0.0, 0.0))
    return base.with_parameters({**SHORT, **parameters})


@pytest.mark.parametrize("name", scenario_names())
def test_every_scenario_is_played_alike(name: str) -> None:
    loaded = load_scenario(name)
    assert_same(loaded if name in TO_THE_END else replace(loaded, duration_s=6.0))


@pytest.mark.full
def test_events_at_one_tick_keep_their_order() -> None:
    half = [Event(at_progress=0.5, settings={"WS_P": value}) for value in (5.0, 6.0)]
    start_s = next(e.time_s for e in assert_same(scenario(*DRIVE, half[0])).applied if e.event == half[0])
    same_tick = Event(at_s=round(start_s, 3), settings={"WS_P": 7.0})
    played = assert_same(scenario(*half, same_tick, *DRIVE))
    assert [entry.event for entry in played.applied[2:]] == [same_tick, *half]


def test_every_action_is_done_alike() -> None:
    events = (
        Event(at_s=0.0, settings={"WS_P": 4.0}),
        Event(at_s=0.2, command="arm"),
        Event(at_s=0.3, velocity=(0.1, 0.05, 0.2)),
        Event(at_s=0.7, duty=(0.2, -0.1, 0.3)),
        Event(at_s=1.0, command="trajectory_start"),
        Event(at_s=1.0, command="trajectory_start"),
        Event(at_s=1.3, settings={"ISMC_LAM_XY": 6.0}),
        Event(at_s=1.3, settings={"ISMC_LAM_XY": 5.0, "ISMC_LAM_TH": 3.0}),
        Event(at_s=1.6, command="trajectory_stop"),
        Event(at_s=1.8, command="disarm"),
        Event(at_s=1.9, command="arm"),
        Event(at_s=2.0, command="estop"),
    )
    assert len(assert_same(scenario(*events, duration_s=2.5)).applied) == len(events)


@pytest.mark.parametrize("share", [0.0, 0.37, 1.0])
def test_shares_of_the_path_are_met_alike(share: float) -> None:
    played = assert_same(scenario(Event(at_progress=share, settings={"WS_P": 6.0}), *DRIVE))
    assert len(played.applied) == 3


@pytest.mark.parametrize("events", [(), (Event(at_s=0.2, command="trajectory_start"),)])
def test_a_robot_that_is_never_armed_ends_alike(events: tuple[Event, ...]) -> None:
    played = assert_same(scenario(*events))
    assert not played.done
    assert played.ticks == (200 if events else 0) + lib.HIL_START_TICKS + lib.HIL_DISARMED_TICKS


def test_late_ticks_are_counted_alike() -> None:
    slow = load_scenario("fault_pose_jump").faults[0]
    late = replace(slow, name="tick_late", start_s=0.6, stop_s=0.9, value=0.0015)
    assert_same(replace(scenario(*DRIVE), faults=(late,)))


def test_a_change_that_the_core_refuses_is_named() -> None:
    with pytest.raises(CoreError, match="W1_ENC_DIR = 0 cannot be used"):
        run_in_process(scenario(*DRIVE, Event(at_s=0.8, settings={"W1_ENC_DIR": 0.0})))


def test_a_share_of_a_path_without_end_is_refused() -> None:
    with pytest.raises(CoreError, match="TRJ_LAPS = 0"):
        run_in_process(scenario(*DRIVE, Event(at_progress=0.5, settings={"WS_P": 6.0}), TRJ_LAPS=0.0))


def test_the_longest_run_is_the_same_in_c_and_python() -> None:
    assert lib.HIL_MAX_TICKS == MAX_DURATION_S * TICKS_PER_S


def test_progress_is_told_with_the_expected_end() -> None:
    told: list[tuple[float, float | None]] = []
    done = run_in_process(scenario(*DRIVE, TRJ_PERIOD=10.0), progress=lambda now, end: told.append((now, end)))
    assert [now for now, _ in told] == sorted(now for now, _ in told)
    assert told[-1] == pytest.approx((done.ticks * 1e-3, done.ticks * 1e-3), abs=0.1)
    assert np.isfinite([end for _, end in told if end is not None]).all()
