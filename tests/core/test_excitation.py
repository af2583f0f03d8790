# SPDX-License-Identifier: MIT
"""Excitations: what is added where, for how long, within which limits, and what ends them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench

WHEEL, VOLTAGE, POSE = lib.OMNI_EXCITATION_WHEEL, lib.OMNI_EXCITATION_VOLTAGE, lib.OMNI_EXCITATION_POSE
ALL = lib.OMNI_MAX_WHEELS
VELOCITY, HOLD, AT_POSE = lib.OMNI_SETPOINT_VELOCITY_BODY, lib.OMNI_SETPOINT_NONE, lib.OMNI_SETPOINT_POSE


def set_kind(bench: Bench, kind: int) -> None:
    bench.inputs.setpoint.kind = kind
    bench.inputs.setpoint.time_us = bench.time_us + 1000


def started(
    place: int, index: int = 0, kind: int = VELOCITY, amplitude: float = 1.0, ticks: int = 50, **more: float
) -> Bench:
    """Return an armed robot that begins with an excitation in its next tick."""
    bench = Bench()
    bench.arm()
    set_kind(bench, kind)
    bench.tick(count=5)
    assert start(bench, place, index, amplitude, ticks, **more) == lib.OMNI_OK
    return bench


def start(bench: Bench, place: int, index: int, amplitude: float, ticks: int, **more: float) -> int:
    plan = ffi.new("omni_excitation_t *", {"place": place, "index": index, "ticks": ticks, "amplitude": amplitude})
    for name, value in more.items():
        setattr(plan, name, value)
    exciter = ffi.addressof(bench.robot, "excitation")
    return int(lib.omni_excitation_start(exciter, plan, bench.wheels))


def wanted(bench: Bench, ticks: int) -> np.ndarray[Any, Any]:
    return np.array([list(bench.tick().wheel_reference[0:3]) for _ in range(ticks)])


def test_a_step_of_a_wheels_speed_lasts_its_ticks_and_touches_no_other_wheel() -> None:
    seen = wanted(started(WHEEL, 1, ticks=20), 30)
    assert np.array_equal(seen[:, 1], [1.0] * 20 + [0.0] * 10)
    assert np.all(seen[:, [0, 2]] == 0.0)


def test_all_wheels_alike_turn_the_robot_on_the_spot() -> None:
    bench = started(WHEEL, ALL, ticks=200)
    out = bench.tick(count=200)
    assert np.allclose(bench.speed[:3], 1.0, atol=0.1)
    assert abs(out.rate.vx) < 1e-3
    assert out.rate.wz > 0.1


def test_a_sweep_is_a_sine_of_rising_frequency() -> None:
    first, rise, ticks = 0.01, 5e-4, 400
    seen = wanted(started(WHEEL, 0, ticks=ticks, amplitude=0.8, step_rad=first, phase_acceleration_rad=rise), ticks)[
        :, 0
    ]
    n = np.arange(ticks)
    assert np.allclose(seen, 0.8 * np.sin(n * first + 0.5 * rise * n * (n - 1)), atol=1e-3)


def test_speeds_stay_within_lim_wheel_and_duties_within_lim_duty() -> None:
    assert np.max(wanted(started(WHEEL, 0, amplitude=50.0, ticks=10), 12)) == pytest.approx(3.0)
    bench = started(VOLTAGE, 0, amplitude=100.0)
    configured(bench, LIM_DUTY=0.5)
    duties = [bench.tick().duty[0] for _ in range(10)]
    assert max(duties) == pytest.approx(0.5)


def test_a_push_of_the_voltage_is_added_to_what_the_loop_gives() -> None:
    bench = started(VOLTAGE, 2, amplitude=1.5, ticks=3)
    before = bench.outputs.voltage_V[2]
    out = bench.tick()
    assert out.voltage_V[2] - before == pytest.approx(1.5, abs=0.05)
    assert out.voltage_V[0] == pytest.approx(0.0, abs=0.05)
    assert out.wheel_reference[2] == 0.0


@pytest.mark.parametrize("kind", [HOLD, AT_POSE])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_step_of_the_pose_passes_the_ramps(kind: int, axis: int) -> None:
    bench = started(POSE, axis, kind=kind, amplitude=0.01, ticks=100)
    out = bench.tick()
    pose = (out.reference.pose.x, out.reference.pose.y, out.reference.pose.theta)
    assert pose[axis] == pytest.approx(0.01, abs=1e-6)
    assert out.reference.rate.vx == out.reference.rate.vy == out.reference.rate.wz == 0.0
    bench.tick(count=100)
    assert bench.outputs.reference.pose.x == pytest.approx(0.0, abs=1e-6)


def configured(bench: Bench, **parameters: float) -> None:
    """Give the robot another configuration. The bench keeps it: the robot has only its address."""
    bench.config = bench.configure(**parameters)
    bench.robot.config = bench.config


def disarm(bench: Bench) -> None:
    bench.tick(lib.OMNI_EVENT_DISARM)


def estop(bench: Bench) -> None:
    bench.tick(lib.OMNI_EVENT_ESTOP)


def hold(bench: Bench) -> None:
    bench.tick(lib.OMNI_EVENT_TRAJECTORY_STOP)


def fault(bench: Bench) -> None:
    bench.inputs.faults = lib.OMNI_FAULT_OVERRUN
    bench.tick()
    bench.inputs.faults = 0


def other_setpoint(bench: Bench) -> None:
    set_kind(bench, AT_POSE if bench.inputs.setpoint.kind == VELOCITY else VELOCITY)
    bench.tick()


def other_controller(bench: Bench) -> None:
    configured(bench, CTL_MODE=2.0)
    bench.tick()


ENDS = (disarm, estop, hold, fault, other_setpoint, other_controller)


@pytest.mark.parametrize("end", ENDS, ids=lambda end: end.__name__)
@pytest.mark.parametrize(
    ("place", "kind"), [(WHEEL, VELOCITY), (VOLTAGE, VELOCITY), (VOLTAGE, AT_POSE), (POSE, HOLD), (POSE, AT_POSE)]
)
def test_it_ends_in_the_tick_of_a_stop_and_stays_ended(place: int, kind: int, end: Callable[[Bench], None]) -> None:
    bench = started(place, kind=kind, amplitude=0.05, ticks=100000)
    bench.tick(count=10)
    assert bench.robot.excitation.ticks_left > 0
    end(bench)
    assert bench.robot.excitation.ticks_left == 0
    if end in (disarm, estop, fault):
        assert not any(bench.outputs.duty)
    bench.tick(lib.OMNI_EVENT_DISARM)
    bench.tick(lib.OMNI_EVENT_ESTOP_CLEAR, count=300)  # its wheels come to rest
    bench.arm()
    set_kind(bench, kind)
    bench.tick(count=10)
    assert bench.robot.excitation.ticks_left == 0
    if place == WHEEL:
        assert not any(bench.outputs.wheel_reference)


@pytest.mark.parametrize(("place", "kind"), [(WHEEL, HOLD), (VOLTAGE, lib.OMNI_SETPOINT_DUTY), (POSE, VELOCITY)])
def test_none_begins_where_it_does_not_fit(place: int, kind: int) -> None:
    bench = started(place, kind=kind)
    bench.tick()
    assert bench.robot.excitation.ticks_left == 0
    assert not any(bench.outputs.duty)


@pytest.mark.parametrize(
    ("place", "index", "amplitude", "ticks"),
    [
        (0, 0, 1.0, 10),
        (4, 0, 1.0, 10),
        (WHEEL, 3, 1.0, 10),
        (WHEEL, 5, 1.0, 10),
        (POSE, 3, 1.0, 10),
        (WHEEL, 0, 1.0, 0),
        (WHEEL, 0, 1.0, 120001),
        (WHEEL, 0, math.nan, 10),
        (VOLTAGE, 0, math.inf, 10),
    ],
)
def test_a_bad_plan_is_refused_and_ends_the_one_before(place: int, index: int, amplitude: float, ticks: int) -> None:
    bench = started(WHEEL)
    assert start(bench, place, index, amplitude, ticks) != lib.OMNI_OK
    assert bench.robot.excitation.ticks_left == 0
    assert not any(bench.tick().wheel_reference)
