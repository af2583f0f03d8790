# SPDX-License-Identifier: MIT
"""A wheel that is blocked stops the motors; one that turns does not, however few counts its encoder gives."""

from __future__ import annotations

import math

import pytest

from omniwheel._core import ffi, lib
from omniwheel.capability.drive_model import model_from_parameters
from omniwheel.robots import parameter_table
from tests.core.test_robot import TICK_US, Bench

COUNTS_PER_TURN = [4, 12, 48, 200, 1024, 10_000]
FINE = [48, 200, 1024, 10_000]
"""Encoders that show a wheel of the fast robot slow down."""
STALL_T = 0.2
LOAD = 1 / 3
"""A wheel that pushes the robot up a slope turns at a third of its free speed."""


def driven(counts_per_turn: int, duty: float, seconds: float, turning: float = 1.0) -> Bench:
    """Return the bench after all wheels got this duty for so long, or until the robot stopped."""
    bench = Bench(ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T)
    bench.arm()
    bench.turning = turning
    drive_on(bench, duty, seconds)
    return bench


def drive_on(bench: Bench, duty: float, seconds: float) -> float:
    """Go on with this duty; return after how long the robot stopped [s], or the seconds it was to drive."""
    for tick in range(round(seconds * 1e6 / TICK_US)):
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(duty,) * 4)
        if bench.tick().state != lib.OMNI_STATE_ARMED:
            return tick * TICK_US * 1e-6
    return seconds


def volts(bench: Bench, duty: float) -> float:
    """Return what the wheels get once the duty is there."""
    return abs(duty) * float(bench.outputs.supply_V)


def count_due_s(bench: Bench, duty: float) -> float:
    """Return how long a wheel at a tenth of its speed takes for a count."""
    speed = 0.1 * volts(bench, duty) / lib.omni_motor_speed_gain(ffi.addressof(bench.config, "motor"))
    return 2 * math.pi / float(bench.values[lib.OMNI_PARAM_ENC_CPR]) / float(speed)


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
@pytest.mark.parametrize("duty", [0.35, -0.6, 1.0])
@pytest.mark.parametrize("turning", [1.0, LOAD])
def test_a_wheel_that_turns_is_let_through(counts_per_turn: int, duty: float, turning: float) -> None:
    bench = driven(counts_per_turn, duty, 4.0, turning)
    assert volts(bench, duty) > bench.values[lib.OMNI_PARAM_SAFE_STALL_V], "supervised at all"
    assert bench.outputs.state == lib.OMNI_STATE_ARMED


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
@pytest.mark.parametrize("duty", [0.35, 1.0])
def test_a_blocked_wheel_stops_the_motors_in_time(counts_per_turn: int, duty: float) -> None:
    bench = Bench(ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T)
    bench.arm()
    bench.turning = False
    stopped_s = drive_on(bench, duty, 20.0)
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert stopped_s + 2e-3 >= STALL_T
    assert stopped_s <= STALL_T + count_due_s(bench, duty) + 0.05, "its voltage needs some ticks to rise"


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
@pytest.mark.parametrize("every", [1, 3, 10, 70])
def test_an_encoder_on_an_edge_does_not_hide_a_blocked_wheel(counts_per_turn: int, every: int) -> None:
    bench = Bench(ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T)
    bench.arm()
    bench.turning = False
    for tick in range(10_000):
        bench.angle = [math.pi / counts_per_turn * (1 if tick // every % 2 else -1)] * 4
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(1.0,) * 4)
        if bench.tick().state != lib.OMNI_STATE_ARMED:
            break
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert tick * TICK_US * 1e-6 <= STALL_T + 2 * count_due_s(bench, 1.0) + 0.05


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
def test_a_reversal_at_full_speed_is_legal(counts_per_turn: int) -> None:
    bench = driven(counts_per_turn, 1.0, 1.0)
    assert drive_on(bench, -1.0, 1.0) == 1.0
    assert drive_on(bench, 1.0, 1.0) == 1.0


def heavy(counts_per_turn: int, time_constant_s: float) -> Bench:
    """Return a fast robot whose wheels take so long to 63 % of a new speed."""
    light = Bench("fast_three_wheel")
    constant, resistance = (float(light.values[index]) for index in (lib.OMNI_PARAM_MOT_K, lib.OMNI_PARAM_MOT_R))
    speed_gain = float(lib.omni_motor_speed_gain(ffi.addressof(light.config, "motor")))
    inertia = time_constant_s * speed_gain * constant / resistance
    bench = Bench("fast_three_wheel", ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T, MOT_J=inertia)
    bench.arm()
    return bench


@pytest.mark.parametrize("counts_per_turn", FINE)
@pytest.mark.parametrize(("time_constant_s", "duty"), [(0.3, 0.4), (0.5, 0.4), (0.5, 1.0), (1.0, 0.7), (1.3, 1.0)])
def test_weak_motors_may_take_their_time_to_brake_a_heavy_robot(
    counts_per_turn: int, time_constant_s: float, duty: float
) -> None:
    bench = heavy(counts_per_turn, time_constant_s)
    assert drive_on(bench, 1.0, 4.0 * time_constant_s) == 4.0 * time_constant_s
    at_speed = bench.speed[0]
    assert drive_on(bench, -duty, 4.0 * time_constant_s) == 4.0 * time_constant_s
    assert at_speed > 0.0 > bench.speed[0]


@pytest.mark.parametrize("counts_per_turn", FINE[1:])
@pytest.mark.parametrize("share", [0.1, 0.2, 0.5])
def test_a_heavy_robot_may_be_braked_from_any_speed(counts_per_turn: int, share: float) -> None:
    bench = heavy(counts_per_turn, 1.0)
    bench.speed = [speed * share for speed in at_full_speed(bench)]
    assert drive_on(bench, -1.0, 2.0) == 2.0
    assert bench.speed[0] < 0.0


def at_full_speed(bench: Bench) -> list[float]:
    """Drive until the wheels are as quick as they get, then let go; return their speeds."""
    drive_on(bench, 1.0, 5.0)
    speeds = list(bench.speed)
    bench.speed = [0.0] * 4
    drive_on(bench, 0.0, 0.1)
    return speeds


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
@pytest.mark.parametrize("time_constant_s", [0.3, 1.0])
def test_an_encoder_that_counts_backwards_at_full_speed_stops_the_motors(
    counts_per_turn: int, time_constant_s: float
) -> None:
    bench = heavy(counts_per_turn, time_constant_s)
    drive_on(bench, 1.0, 5.0 * time_constant_s)
    bench.angle = [0.0] * 4  # so that the swap itself is no jump of the counts
    bench.tick(0)
    bench.crossed = 1
    stopped_s = drive_on(bench, 1.0, 10.0)
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert STALL_T / 2 <= stopped_s + 2e-3 <= STALL_T + 2 * count_due_s(bench, 1.0) + 0.05


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
def test_a_wheel_that_is_driven_backwards_by_the_others_stops_the_motors(counts_per_turn: int) -> None:
    bench = driven(counts_per_turn, 1.0, 1.0)
    bench.turning = -LOAD
    stopped_s = drive_on(bench, 1.0, 10.0)
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert STALL_T / 2 <= stopped_s + 2e-3 <= STALL_T + 2 * count_due_s(bench, 1.0) + 0.05


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
@pytest.mark.parametrize("turning", [1.0, LOAD, 0.2])
def test_a_reversed_encoder_is_found_also_under_load(counts_per_turn: int, turning: float) -> None:
    bench = Bench("fast_three_wheel", ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T)
    bench.arm()
    bench.crossed = 1
    bench.turning = turning
    stopped_s = drive_on(bench, 1.0, 10.0)
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert stopped_s <= 2 * STALL_T + 2 * count_due_s(bench, 1.0) + 0.05


@pytest.mark.parametrize("counts_per_turn", FINE)
@pytest.mark.parametrize("counts", [2, 5, 9])
@pytest.mark.parametrize("steady", [True, False])
def test_a_blocked_wheel_that_rocks_is_found(counts_per_turn: int, counts: int, steady: bool) -> None:
    """It rocks by some counts, each way for as long as a judgement takes; with a voltage that does so, or a steady one.

    More than a tenth of the voltage's speed would count as turning, so it rocks by less.
    """
    bench = Bench("fast_three_wheel", ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T)
    bench.arm()
    bench.turning = 0.0
    bench.command(lib.OMNI_SETPOINT_DUTY, duty=(1.0,) * 4)
    bench.tick(count=20)
    swing = max(2, round(2.2 * counts * count_due_s(bench, 1.0) * 1e6 / TICK_US))
    for tick in range(20_000):
        onward = tick // swing % 2 == 0
        bench.angle = [counts * math.pi / counts_per_turn * (1 if onward else -1)] * 4
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(1.0 if steady or tick // 400 % 2 == 0 else -1.0,) * 4)
        if bench.tick().state != lib.OMNI_STATE_ARMED:
            break
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert tick * TICK_US * 1e-6 <= 6 * STALL_T + 4 * swing * TICK_US * 1e-6


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
def test_a_wheel_that_counts_backwards_stops_the_motors(counts_per_turn: int) -> None:
    bench = Bench(ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T)
    bench.arm()
    bench.crossed = 1
    stopped_s = drive_on(bench, 0.8, 10.0)
    assert bench.outputs.fault_history & lib.OMNI_FAULT_STALL
    assert STALL_T / 2 <= stopped_s <= STALL_T + count_due_s(bench, 0.8) + 0.05


@pytest.mark.parametrize("counts_per_turn", COUNTS_PER_TURN)
def test_the_card_tells_how_long_a_blocked_wheel_gets_its_voltage(counts_per_turn: int) -> None:
    bench = Bench(ENC_CPR=float(counts_per_turn), SAFE_STALL_T=STALL_T, SAFE_STALL_V=4.0)
    bench.arm()
    bench.turning = False
    stopped_s = drive_on(bench, 4.001 / bench.values[lib.OMNI_PARAM_BAT_V_NOM], 20.0)
    table = parameter_table()
    values = {name: bench.values[index] for index, name in enumerate(table)}
    assert stopped_s == pytest.approx(model_from_parameters(values, {}).blocked_s, abs=0.05)
