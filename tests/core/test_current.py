# SPDX-License-Identifier: MIT
"""The motors' currents: estimate, limit and heat beside closed forms; the limit weakens no brake and delays no stop."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel._core import ffi, lib
from tests.core.test_robot import Bench

STEP_S = 1e-3
K, R, L = 1.05, 2.7, 1.4e-3
WHEELS = 4
COUNTING = ffi.new("omni_int_t[4]", [1] * 4)
BRAKE_SHARE = 0.05
"""Of the limit's voltage: back-EMF from which a wheel counts as braked."""


def configured(
    limit_A: float = 0.0, continuous_A: float = 0.0, heat_s: float = 10.0, ohm: float = R, henry: float = L
) -> Any:
    config = ffi.new("omni_current_config_t *")
    lib.omni_current_configure(config, limit_A, continuous_A, heat_s, K, ohm, henry, 1e-3, STEP_S)
    return config


def follow(state: Any, config: Any, volts: float, turns: float, driven: bool = True, steps: int = 1) -> None:
    """Let the estimate of one motor go on; its encoder counts."""
    lib.omni_current_estimate(
        state, config, 1, ffi.new("float[4]", [volts]), ffi.new("float[4]", [turns]), COUNTING, driven, steps
    )


def heat_of(currents_A: list[float], continuous_A: float, heat_s: float) -> float:
    """Return the heat after these currents, a tick each, of a motor whose current follows at once."""
    config, state = configured(0.0, continuous_A, heat_s, henry=1e-6), ffi.new("omni_current_state_t *")
    for current_A in currents_A:
        follow(state, config, current_A * R, 0.0)
    return float(state.heat[0])


@pytest.mark.parametrize("henry", [1e-5, 1.4e-3, 0.02, 1.0])
@pytest.mark.parametrize("heat_s", [0.5, 3.0, 100.0])
def test_the_constants_of_a_tick_are_the_exponentials(henry: float, heat_s: float) -> None:
    config = configured(1.0, 1.0, heat_s, henry=henry)
    assert config.current_decay == pytest.approx(math.exp(-R / henry * STEP_S), rel=2e-6, abs=1e-12)
    assert config.heat_gain == pytest.approx(-math.expm1(-STEP_S / heat_s), rel=1e-6)


@pytest.mark.parametrize("heat_s", [0.5, 5.0, 100.0])
@pytest.mark.parametrize("share", [0.7, 1.5, 3.0])
def test_a_steady_current_heats_by_the_exact_exponential(share: float, heat_s: float) -> None:
    ticks = 2000
    exact = share**2 * -math.expm1(-ticks * STEP_S / heat_s)
    assert heat_of([share * 2.0] * ticks, 2.0, heat_s) == pytest.approx(exact, rel=2e-3)


def test_a_pulse_and_the_rest_after_it_are_those_of_the_analytic_pulse() -> None:
    """5 A for 0.6 s on a motor for 2 A, then 1 s of nothing, then the same again."""
    heat_s, on, off = 2.0, 600, 1000
    up, down = math.exp(-on * STEP_S / heat_s), math.exp(-off * STEP_S / heat_s)
    once = 2.5**2 * (1.0 - up)
    twice = once * down * up + once
    pulse = [5.0] * on
    assert heat_of(pulse, 2.0, heat_s) == pytest.approx(once, rel=1e-3)
    assert heat_of([*pulse, *([0.0] * off), *pulse], 2.0, heat_s) == pytest.approx(twice, rel=1e-3)


@pytest.mark.parametrize("henry", [1e-5, 1.4e-3, 0.02])
def test_the_estimate_is_the_winding_s_equation(henry: float) -> None:
    config, state = configured(1.0, henry=henry), ffi.new("omni_current_state_t *")
    volts, turns, ticks = 7.0, 3.0, 3
    for _ in range(ticks):
        follow(state, config, volts, turns)
    exact = (volts - K * turns) / R * -math.expm1(-ticks * STEP_S * R / henry)
    assert state.current_A[0] == pytest.approx(exact, rel=1e-5)
    missed = ffi.new("omni_current_state_t *")
    follow(missed, config, volts, turns, steps=3)
    assert missed.current_A[0] == state.current_A[0], "ticks that were missed count, too"
    follow(state, config, volts, turns, driven=False)
    assert state.current_A[0] == 0.0, "a bridge that coasts"


volt = st.floats(-24.0, 24.0, width=32)
speed = st.floats(-20.0, 20.0, width=32)


@given(st.lists(st.tuples(volt, speed), min_size=WHEELS, max_size=WHEELS), st.floats(0.125, 10.0, width=32))
def test_what_drives_is_limited_by_one_factor_and_what_brakes_is_left_alone(
    wheels: list[tuple[float, float]], limit_A: float
) -> None:
    given_V = ffi.new("float[4]", [volts for volts, _ in wheels])
    factor = lib.omni_current_limit(
        configured(limit_A), WHEELS, ffi.new("float[4]", [turns for _, turns in wheels]), given_V
    )
    assert 0.0 < factor <= 1.0
    most_A, edges, brake_V = 0.0, 0, BRAKE_SHARE * R * limit_A
    for (volts, turns), after in zip(wheels, given_V, strict=True):
        emf, push = K * turns, volts - K * turns
        edge = 0.0 < abs(push * emf) < 1e-3 or abs(abs(emf) - brake_V) < 1e-3
        edges += edge
        if not edge and push * emf < 0.0 and abs(emf) > brake_V:
            assert after == volts, "a brake keeps its voltage"
        elif not edge:
            assert after - emf == pytest.approx(factor * push, abs=2e-4)
            most_A = max(most_A, abs(after - emf) / R)
        assert abs(after) <= max(abs(volts), brake_V) + 1e-4
    assert most_A <= limit_A * (1.0 + 1e-4) + 1e-4
    if factor < 1.0 and edges == 0:
        assert most_A == pytest.approx(limit_A, rel=1e-3, abs=1e-3), "no more is taken away than needed"
    if factor == 1.0:
        assert list(given_V) == [volts for volts, _ in wheels]


def blocked(wheel: int, seconds: float, duty: float = 0.9, **parameters: float) -> tuple[Bench, list[float]]:
    """Return the bench and the largest true current of each tick: one wheel held, all driven."""
    bench = Bench("three_wheel", **parameters)
    bench.arm()
    currents = []
    for _ in range(round(seconds / STEP_S)):
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(duty,) * 3 + (0.0,))
        bench.speed[wheel] = 0.0
        angle = bench.angle[wheel]
        out = bench.tick()
        bench.angle[wheel] = angle
        currents.append(abs(out.voltage_V[wheel]) / R)
        if out.state != lib.OMNI_STATE_ARMED:
            break
    return bench, currents


@pytest.mark.parametrize("wheel", [0, 2])
@pytest.mark.parametrize("limit_A", [0.7, 1.5, 3.0])
def test_a_blocked_wheel_has_no_more_than_the_limit_and_is_named(wheel: int, limit_A: float) -> None:
    """At 0.7 A it gets 1.9 V, less than SAFE_STALL_V; it is found all the same."""
    bench, currents = blocked(wheel, 1.0, LIM_I=limit_A)
    count_A = K / R * bench.config.current.one_count_rad_s
    assert max(currents) <= limit_A + 0.25 * count_A, "less than a count in four ticks is what the wheel may turn"
    assert max(currents) > 0.9 * limit_A
    assert bench.outputs.fault_history == lib.OMNI_FAULT_STALL
    assert bench.outputs.stop.wheel == wheel + 1
    assert bench.outputs.stop.current_A == pytest.approx(limit_A, rel=0.05)


def test_without_the_limit_the_same_wheel_gets_what_it_is_asked_to() -> None:
    bench, currents = blocked(1, 1.0)
    assert max(currents) == pytest.approx(0.9 * 12.0 / R, rel=1e-3)
    assert bench.outputs.fault_history == lib.OMNI_FAULT_STALL
    assert bench.outputs.stop.current_A == 0.0
    assert list(bench.outputs.motor_heat) == [0.0] * 4


def test_a_motor_that_is_overloaded_warns_then_stops_and_may_start_again_when_it_has_cooled() -> None:
    """2.2 A into a motor for 1 A: after -T log(1 - 1 / 2.2^2) it is too hot."""
    heat_s, asked_A = 1.0, 2.2
    bench, _ = blocked(1, 5.0, asked_A * R / 12.0, SAFE_I=1.0, SAFE_I_TC=heat_s, SAFE_STALL_T=10.0)
    out = bench.outputs
    due_s = -heat_s * math.log1p(-1.0 / asked_A**2)
    assert bench.time_us * 1e-6 == pytest.approx(due_s, abs=0.02)
    assert out.fault_history == lib.OMNI_FAULT_MOTOR_HEAT
    assert out.faults & lib.OMNI_WARN_MOTOR_WARM
    assert (out.stop.wheel, out.motor_heat[1]) == (2, pytest.approx(1.0, abs=0.01))
    assert out.stop.current_A == pytest.approx(asked_A, rel=0.05)
    bench.tick(lib.OMNI_EVENT_DISARM)
    assert bench.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_DISARMED, "hot"
    bench.tick(count=round(heat_s * math.log(1.0 / 0.8) / STEP_S) + 10)
    assert bench.outputs.current_A[1] == 0.0
    assert bench.tick(lib.OMNI_EVENT_ARM).state == lib.OMNI_STATE_ARMED, "cool enough"


def test_a_warning_comes_before_the_fault() -> None:
    bench = Bench(SAFE_I=1.0, SAFE_I_TC=1.0, SAFE_STALL_T=10.0)
    bench.arm()
    bench.turning = 0.0
    seen = []
    for _ in range(1000):
        bench.speed = [0.0] * 4
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(0.5, 0.0, 0.0, 0.0))
        seen.append(bench.tick().faults & (lib.OMNI_WARN_MOTOR_WARM | lib.OMNI_FAULT_MOTOR_HEAT))
    firsts = [seen.index(lib.OMNI_WARN_MOTOR_WARM), seen.index(lib.OMNI_WARN_MOTOR_WARM | lib.OMNI_FAULT_MOTOR_HEAT)]
    assert firsts == sorted(firsts)
    assert seen[firsts[0] : firsts[1]] == [lib.OMNI_WARN_MOTOR_WARM] * (firsts[1] - firsts[0])


def duties_of_a_stop(brake: float, **parameters: float) -> list[list[float]]:
    """Return the duties from speed until the wheels as good as stand."""
    bench = Bench("three_wheel", **parameters)
    bench.arm()
    for duty, ticks in ((0.1, 100), (0.2, 200), (0.3, 300), (0.4, 400)):
        for _ in range(ticks):
            bench.command(lib.OMNI_SETPOINT_DUTY, duty=(duty, -duty, duty, 0.0))
            bench.tick()
    seen = []
    while bench.outputs.wheel_rad_s[0] > 0.5:
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(brake, -brake, brake, 0.0))
        out = bench.tick()
        seen.append([out.duty[i] for i in range(3)])
    return seen


@pytest.mark.parametrize("brake", [0.0, -0.3, -1.0])
def test_braking_is_the_same_bit_by_bit_with_the_limit(brake: float) -> None:
    """Full voltage against a turning wheel is far more than LIM_I leaves to what drives."""
    plain, limited = duties_of_a_stop(brake), duties_of_a_stop(brake, LIM_I=1.8)
    assert plain == limited
    assert len(plain) >= 3


@pytest.mark.parametrize("event", ["DISARM", "ESTOP"])
def test_a_stop_takes_its_tick_however_hard_the_limit_binds(event: str) -> None:
    bench = Bench(LIM_I=0.5, SAFE_I=0.2)
    bench.arm()
    for _ in range(5):
        bench.command(lib.OMNI_SETPOINT_DUTY, duty=(1.0, -1.0, 1.0, 0.0))
        out = bench.tick()
    assert out.drive
    assert out.current_reduction > 0.3
    out = bench.tick(getattr(lib, f"OMNI_EVENT_{event}"))
    assert not out.drive
    assert [out.duty[i] for i in range(4)] == [0.0] * 4
    assert out.current_reduction == 0.0


def test_the_controller_is_told_and_does_not_wind_up() -> None:
    """The wheel loops' integrals settle although the error stays, as they do at the duty limit."""
    bench = Bench(LIM_I=0.6, SAFE_STALL_T=60.0, WS_I=50.0, WS_I_MAX=60.0)
    bench.arm()
    sums = []
    for _ in range(1000):
        bench.speed = [0.0] * 4
        bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.0, 0.0, 0.3))
        out = bench.tick()
        sums.append(abs(bench.robot.control.wheel_speed.pid[0].integral))
    assert out.faults & lib.OMNI_WARN_SATURATED
    assert 0.0 < out.current_reduction < 1.0
    assert out.duty_scale == 1.0, "only the current limit binds"
    assert sums[-1] == pytest.approx(sums[-100], rel=0.01)
    assert sums[-1] < 0.1 * 50.0 * 1.5 * 1.0, "far below what it would have summed up: 50 V/rad times 1.5 rad/s and 1 s"


def test_a_limit_that_is_never_reached_changes_no_duty() -> None:
    seen = []
    for parameters in ({}, {"LIM_I": 900.0}, {"SAFE_I": 900.0}):
        bench = Bench("three_wheel", **parameters)
        bench.arm()
        duties = []
        for number in range(600):
            bench.command(lib.OMNI_SETPOINT_VELOCITY_BODY, twist=(0.1, -0.1 if number < 300 else 0.1, 0.4))
            out = bench.tick()
            duties.append([out.duty[i] for i in range(4)])
        seen.append(duties)
    assert seen[0] == seen[1] == seen[2]


def test_switched_off_while_driving_nothing_of_it_is_left() -> None:
    bench, _ = blocked(1, 0.05, LIM_I=1.0, SAFE_I=0.5)
    assert bench.outputs.motor_heat[1] > 0.0
    bench.config = bench.configure(LIM_I=0.0, SAFE_I=0.0)
    lib.omni_robot_set_config(bench.robot, bench.config)
    out = bench.tick()
    assert list(out.motor_heat) == [0.0] * 4
    assert out.current_reduction == 0.0
    bench.config = bench.configure(SAFE_I=0.5)
    lib.omni_robot_set_config(bench.robot, bench.config)
    assert max(bench.tick().motor_heat) < 0.05, "it starts cold"
