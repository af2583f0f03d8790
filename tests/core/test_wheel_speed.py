# SPDX-License-Identifier: MIT
"""The wheel speed loops together: feed-forward, control, one common limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import null_space

from omniwheel._core import ffi, lib

STEP_S = 1e-3
MOTOR = (0.01, 1.0, 1.05, 2.7, 0.0014)
ZERO = [0.0] * 4


def speed_gain() -> float:
    return float(lib.omni_motor_speed_gain(ffi.new("omni_motor_config_t *", list(MOTOR))))


class Loops:
    def __init__(
        self, wheels: int = 3, duty_limit: float = 1.0, kp: float = 4.0, ki: float = 120.0, **config: float
    ) -> None:
        self.config = ffi.new("omni_wheel_speed_config_t *", {"wheels": wheels, "duty_limit": duty_limit, **config})
        self.config.pid.kp = kp
        self.config.pid.ki = ki
        self.config.pid.derivative_time_s = 0.005
        self.config.pid.integral_limit = 8.0
        self.config.pid.step_s = STEP_S
        self.state = ffi.new("omni_wheel_speed_state_t *")
        lib.omni_wheel_speed_reset(self.state)
        self.duty = ffi.new("float[4]", [9.0] * 4)
        self.voltage = ffi.new("float[4]", [9.0] * 4)

    def step(
        self,
        reference: Sequence[float],
        measured: Sequence[float] = ZERO,
        acceleration: Sequence[float] = ZERO,
        supply: float = 12.0,
    ) -> float:
        arrays: list[Any] = [ffi.new("float[4]", list(a)) for a in (reference, acceleration, measured)]
        return float(lib.omni_wheel_speed_step(self.state, self.config, *arrays, supply, self.duty, self.voltage))

    @property
    def integrals(self) -> list[float]:
        return [self.state.pid[i].integral for i in range(4)]

    def snapshot(self) -> bytes:
        return bytes(ffi.buffer(self.state))


def test_feed_forward_is_the_motor_model_solved_for_the_voltage() -> None:
    loops = Loops(kp=0.0, ki=0.0, ff_speed_V_s=3.6, ff_acceleration_V_s2=0.026, ff_static_V=0.4)
    loops.step([1.0, -0.5, 0.0, 0.0], acceleration=[10.0, 0.0, -20.0, 0.0])
    np.testing.assert_allclose(list(loops.voltage), [3.6 + 0.26 + 0.4, -1.8 - 0.4, -0.52, 0.0], rtol=1e-6)
    np.testing.assert_allclose(list(loops.duty), np.array(list(loops.voltage)) / 12.0, rtol=1e-6)


@given(st.floats(-3, 3, width=32))
def test_coulomb_feed_forward_fades_around_standstill(reference: float) -> None:
    loops = Loops(kp=0.0, ki=0.0, ff_static_V=0.5)
    loops.step([reference, 0, 0, 0])
    assert loops.voltage[0] == pytest.approx(0.5 * min(max(reference / 0.05, -1.0), 1.0), abs=1e-6)


speeds = st.lists(st.floats(-50, 50, width=32), min_size=4, max_size=4)


@given(speeds, speeds, st.sampled_from([3, 4]), st.floats(0.125, 1.0, width=32), st.floats(3, 30, width=32))
def test_duty_keeps_limit_and_direction(
    reference: list[float], measured: list[float], wheels: int, limit: float, supply: float
) -> None:
    loops = Loops(wheels, limit, ff_speed_V_s=3.6)
    error = np.array(reference) - measured
    wanted = 3.6 * np.array(reference) + 4.0 * error + np.clip(0.12 * error, -8.0, 8.0)
    factor = loops.step(reference, measured, supply=supply)
    duty = np.array(list(loops.duty))
    assert 0 < factor <= 1
    assert np.max(np.abs(duty)) <= np.float32(limit)
    assert not duty[wheels:].any()
    tolerance = 1e-4 * max(1.0, float(np.abs(wanted[:wheels]).max()))
    np.testing.assert_allclose(duty[:wheels] * supply, wanted[:wheels] * factor, rtol=1e-3, atol=2.0 * tolerance)
    np.testing.assert_allclose(list(loops.voltage), duty * supply, rtol=1e-5, atol=1e-6)


def test_the_motor_settles_at_the_reference_without_steady_error() -> None:
    loops = Loops(3, ff_speed_V_s=0.8 * speed_gain(), ff_acceleration_V_s2=0.02)
    model = ffi.new("omni_motor_discrete_t *")
    lib.omni_motor_discretise(ffi.new("omni_motor_config_t *", list(MOTOR)), STEP_S, model)
    a = np.array([list(row) for row in model.a])
    b = np.array(list(model.b))
    x = np.zeros((3, 3))
    reference = np.array([2.0, -1.0, 0.5])
    for _ in range(1000):
        loops.step([*reference, 0.0], [*x[1], 0.0])
        x = a @ x + np.outer(b, list(loops.voltage)[:3])
    np.testing.assert_allclose(x[1], reference, rtol=1e-3)


def test_a_reference_out_of_reach_does_not_wind_up() -> None:
    loops = Loops(3, ff_speed_V_s=speed_gain())
    top = 12.0 / speed_gain()
    for _ in range(3000):
        factor = loops.step([2 * top, 0, 0, 0], [top, 0, 0, 0])
    assert factor < 1.0
    assert loops.duty[0] == 1.0
    # feed-forward asks for 24 V: the integral has taken back what the supply cannot give
    assert loops.integrals[0] < 0.0
    loops.step([0.5 * top, 0, 0, 0], [top, 0, 0, 0])
    assert loops.duty[0] < 0.5


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("array", ["reference", "measured", "acceleration"])
@pytest.mark.parametrize("wheel", range(3))
def test_no_number_anywhere_gives_no_duty_and_leaves_the_state(bad: float, array: str, wheel: int) -> None:
    loops = Loops(3, ff_speed_V_s=3.6)
    loops.step([1.0, 0.5, -1.0, 0.0], [0.9, 0.4, -1.1, 0.0])
    before = loops.snapshot()
    values = {"reference": [1.0, 0.5, -1.0, 0.0], "measured": list(ZERO), "acceleration": list(ZERO)}
    values[array][wheel] = bad
    assert loops.step(**values) == 0.0  # type: ignore[arg-type]
    assert list(loops.duty) == ZERO
    assert list(loops.voltage) == ZERO
    assert loops.snapshot() == before


@pytest.mark.parametrize("supply", [0.0, -12.0, math.nan, math.inf])
def test_without_a_supply_there_is_no_duty(supply: float) -> None:
    loops = Loops(3)
    before = loops.snapshot()
    assert loops.step([1.0, 1.0, 1.0, 0.0], supply=supply) == 0.0
    assert list(loops.duty) == ZERO
    assert loops.snapshot() == before


@pytest.mark.parametrize("limit", [0.0, -1.0, math.nan])
def test_a_duty_limit_of_zero_allows_nothing(limit: float) -> None:
    loops = Loops(3, limit)
    assert loops.step([1.0, 1.0, 1.0, 0.0]) == 0.0
    assert list(loops.duty) == ZERO


def test_unused_wheels_are_ignored() -> None:
    loops = Loops(3, ff_speed_V_s=1.0)
    assert loops.step([1.0, 1.0, 1.0, math.nan], [0.0, 0.0, 0.0, math.nan]) == 1.0
    assert loops.duty[3] == 0.0


def test_reset_forgets_every_wheel() -> None:
    loops = Loops(4)
    loops.step([1.0, 2.0, 3.0, 4.0])
    assert all(loops.integrals)
    lib.omni_wheel_speed_reset(loops.state)
    assert loops.integrals == ZERO


def layout_of_four(radii: Sequence[float]) -> NDArray[np.float64]:
    """Return wheel speeds per body rate (4 x 3), of four wheels at 45 deg that are 0.1 m from the centre."""
    angles = np.radians([45.0, 135.0, 225.0, 315.0])
    rows = np.stack([-np.sin(angles), np.cos(angles), np.full(4, 0.1)], axis=1)
    return np.asarray(rows / np.array(radii)[:, None])


radii_of_four = st.lists(st.floats(0.03125, 0.125, width=32), min_size=4, max_size=4)
integrals_of_four = st.lists(st.floats(-8, 8, width=32), min_size=4, max_size=4)


def balanced(radii: Sequence[float], integrals: Sequence[float], limit: float = 100.0, wheels: int = 4) -> list[float]:
    loops = Loops(wheels)
    loops.config.pid.integral_limit = limit
    if wheels == 4:
        loops.config.null_direction = list(null_space(layout_of_four(radii).T)[:, 0])
    for i in range(4):
        loops.state.pid[i].integral = integrals[i]
    lib.omni_wheel_speed_balance(loops.state, loops.config)
    return loops.integrals


@given(radii_of_four, integrals_of_four)
def test_balanced_integrals_push_the_body_as_before_and_no_wheel_against_another(
    radii: list[float], integrals: list[float]
) -> None:
    layout = layout_of_four(radii)
    found = np.array(balanced(radii, integrals))
    np.testing.assert_allclose(layout.T @ found, layout.T @ integrals, rtol=0, atol=2e-5 * np.abs(layout).max() * 8)
    assert null_space(layout.T)[:, 0] @ found == pytest.approx(0.0, abs=2e-5)


@given(radii_of_four, integrals_of_four)
def test_balanced_integrals_keep_their_limit(radii: list[float], integrals: list[float]) -> None:
    assert np.max(np.abs(balanced(radii, integrals, limit=8.0))) <= 8.0


def test_three_wheels_have_nothing_to_balance() -> None:
    assert balanced([], [1.0, -2.0, 3.0, 0.0], wheels=3) == [1.0, -2.0, 3.0, 0.0]


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_integrals_that_are_no_numbers_are_left_alone(bad: float) -> None:
    found = balanced([0.05] * 4, [1.0, bad, 0.0, 0.0])
    assert found[0] == 1.0
    assert found[2:] == [0.0, 0.0]
