# SPDX-License-Identifier: MIT
"""The core's estimate, limit and watch of the motors' currents, in the simulated world, which knows the true ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from hil_sim import core
from hil_sim.runs import new_world, run_in_process
from hil_sim.scenario import Scenario, load_scenario
from omniwheel._core import ffi, lib

ERROR_SHARE = 0.02
"""Of the stall current: the largest error of the estimate (RMS) that the page states."""


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


@pytest.mark.parametrize("name", ["demo", "four_wheel", "fast"])
def test_the_estimate_is_near_the_true_current(name: str) -> None:
    """Over starts, reversals, turns and a stop, on real wheels, with encoders that count."""
    drive = Drive(load_scenario(name), SAFE_I=900.0)
    speed = 0.6 * float(drive.config.limits.speed_m_s if name == "fast" else 0.15)
    errors, truths = [], []
    for twist in ((speed, 0.0, 0.0), (-speed, 0.0, 0.0), (0.0, speed, 0.5), (0.0, 0.0, 0.0)):
        for run in drive.ticks(600, twist):
            true_A = np.array(drive.true_A())
            errors.append(np.array(list(run.outputs.current_A)[: drive.wheels]) - true_A)
            truths.append(true_A)
    assert run.outputs.state == lib.OMNI_STATE_ARMED
    error_A, true_A = float(np.sqrt(np.mean(np.square(errors)))), float(np.sqrt(np.mean(np.square(truths))))
    print(name, error_A, true_A, drive.stall_A)
    assert error_A < ERROR_SHARE * drive.stall_A
    assert true_A > 0.02 * drive.stall_A, "there was something to estimate"


LIMIT_A = 1.2
NOTICED_TICKS = 10
"""So long the robot takes a wheel that stops dead for one that turns: no count has been due yet."""


def block(run: Any, wheel: int) -> None:
    """From now on this wheel stands."""
    fault = run.world.config.fault[0]
    fault.kind, fault.wheel, fault.start_s, fault.stop_s = lib.HIL_FAULT_MOTOR_STALLED, wheel, 0.0, 1e9
    run.world.config.fault_count = 1


@pytest.mark.parametrize("name", ["demo", "fast"])
def test_a_wheel_that_gets_blocked_has_no_more_than_the_limit_and_is_named(name: str) -> None:
    wheel, peaks = 1, {}
    for limit_A in (0.0, LIMIT_A):
        drive = Drive(load_scenario(name), LIM_I=limit_A)
        limits, k = drive.config.limits, drive.config.kinematics
        turn = 0.8 * limits.wheel_rad_s * k.radius_m[0] / drive.run.world.config.wheel_distance_m[0]
        for run in drive.ticks(800, (0.0, 0.0, turn)):
            assert run.outputs.state == lib.OMNI_STATE_ARMED
        block(run, wheel)
        seen = []
        for run in drive.ticks(2000, (0.0, 0.0, turn)):
            if run.outputs.state != lib.OMNI_STATE_ARMED:
                break
            seen.append(abs(drive.true_A()[wheel]))
        peaks[limit_A] = max(seen[NOTICED_TICKS:])
        assert run.outputs.fault_history == lib.OMNI_FAULT_STALL
        assert run.outputs.stop.wheel == wheel + 1
    print(name, peaks)
    assert peaks[LIMIT_A] < 1.05 * LIMIT_A
    assert peaks[0.0] > 2.0 * LIMIT_A


def stopping(**parameters: float) -> tuple[list[float], list[float], float]:
    """Return speed and cut from the moment on at which a fast robot is told to stand, and how far it gets."""
    drive = Drive(load_scenario("fast"), LIM_A=3.0, **parameters)
    speed = 0.6 * float(drive.config.limits.speed_m_s)
    speeds, cuts = [], []
    for run in drive.ticks(1500, (speed, 0.0, 0.0)):
        pass
    x_m = run.world.pose[0]
    for run in drive.ticks(500, (0.0, 0.0, 0.0)):
        speeds.append(float(np.hypot(run.world.twist[0], run.world.twist[1])))
        cuts.append(float(run.outputs.current_cut))
    return speeds, cuts, float(run.world.pose[0] - x_m)


def test_a_robot_that_brakes_stops_where_it_would_without_the_limit() -> None:
    """With a limit far below what the brakes take."""
    (plain, _, way_m), (limited, cuts, limited_m) = stopping(), stopping(LIM_I=0.5)
    print(way_m, limited_m, max(cuts))
    assert limited_m <= way_m + 2e-3
    still = [next(n for n, v in enumerate(speeds) if v < 0.02) for speeds in (plain, limited)]
    assert still[1] <= still[0] + 5


@pytest.mark.parametrize("name", ["demo", "four_wheel"])
def test_a_limit_and_a_watch_that_never_act_change_no_bit_of_a_run(name: str) -> None:
    scenario = load_scenario(name).with_parameters({"TRJ_PERIOD": 2.0, "TRJ_PETALS": 2.0, "TRJ_SIZE": 0.05})
    plain, watched = (
        run_in_process(one).record for one in (scenario, scenario.with_parameters({"LIM_I": 900.0, "SAFE_I": 900.0}))
    )
    assert plain.tobytes() == watched.tobytes()
