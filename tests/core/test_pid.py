# SPDX-License-Identifier: MIT
"""The PID: its terms, its limits, and that it does not wind up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from omniwheel._core import ffi, lib

STEP_S = 1e-3
number = st.floats(-1000, 1000, width=32)


class Pid:
    def __init__(self, **config: float) -> None:
        defaults = {
            "kp": 0.0,
            "ki": 0.0,
            "kd": 0.0,
            "derivative_time_s": 0.01,
            "integral_limit": 100.0,
            "step_s": STEP_S,
        }
        self.config = ffi.new("omni_pid_config_t *", {**defaults, **config})
        self.state = ffi.new("omni_pid_state_t *")
        lib.omni_pid_reset(self.state)

    def step(self, reference: float, measurement: float, feed_forward: float = 0.0) -> float:
        return float(lib.omni_pid_step(self.state, self.config, reference, measurement, feed_forward))

    def limited(self, wanted: float, applied: float) -> None:
        lib.omni_pid_limited(self.state, self.config, wanted, applied)

    def snapshot(self) -> tuple[Any, ...]:
        return self.state.integral, self.state.derivative, self.state.last_measurement, self.state.primed


@given(number, number, number)
def test_proportional_term_and_feed_forward(reference: float, measurement: float, feed_forward: float) -> None:
    got = Pid(kp=2.5).step(reference, measurement, feed_forward)
    assert got == pytest.approx(2.5 * (reference - measurement) + feed_forward, rel=1e-6, abs=1e-2)


def test_integral_is_the_sum_of_the_errors() -> None:
    pid = Pid(ki=3.0)
    errors = np.random.default_rng(5).uniform(-1, 1, 1000)
    got = [pid.step(float(e), 0.0) for e in errors]
    np.testing.assert_allclose(got, 3.0 * STEP_S * np.cumsum(errors), rtol=0, atol=1e-5)


def test_derivative_is_the_low_pass_filtered_rate_of_the_measurement() -> None:
    pid = Pid(kd=0.7, derivative_time_s=0.02)
    y = np.cumsum(np.random.default_rng(6).uniform(-0.01, 0.01, 500))
    got = [pid.step(0.0, float(v)) for v in y]
    pole = 0.02 / (0.02 + STEP_S)
    rate = lfilter([1 - pole], [1, -pole], np.diff(y, prepend=y[0]) / STEP_S)
    np.testing.assert_allclose(got, -0.7 * rate, rtol=0, atol=1e-4)


def test_a_step_of_the_reference_gives_no_derivative_kick() -> None:
    pid = Pid(kd=1.0)
    pid.step(0.0, 2.0)
    assert pid.step(100.0, 2.0) == 0.0


def test_the_first_measurement_gives_no_derivative_kick() -> None:
    assert Pid(kd=1.0).step(0.0, 50.0) == 0.0


@pytest.mark.full
@given(st.lists(number, min_size=1, max_size=50), st.floats(0, 10, width=32))
def test_the_integral_stays_within_its_limit(errors: list[float], limit: float) -> None:
    pid = Pid(ki=500.0, integral_limit=limit)
    for error in errors:
        pid.step(error, 0.0)
        assert abs(pid.state.integral) <= limit


def release_from_limit(tell: bool) -> tuple[float, float]:
    """Ask a first-order plant for too much for two seconds, then for little.

    Return the integral held at the limit and the speed 0.2 s after the release.
    """
    pid = Pid(kp=4.0, ki=120.0)
    speed, limit, held = 0.0, 6.0, 0.0
    for k in range(2200):
        wanted = pid.step(3.0 if k < 2000 else 0.5, speed)
        applied = min(max(wanted, -limit), limit)
        if tell:
            pid.limited(wanted, applied)
        if k < 2000:
            held = pid.state.integral
        speed += STEP_S * (applied / 3.6 - speed) / 0.05
    return held, speed


def test_back_calculation_prevents_windup() -> None:
    held, speed = release_from_limit(tell=True)
    assert held == pytest.approx(6.0, abs=0.3)
    assert speed == pytest.approx(0.5, abs=0.03)


def test_without_it_the_integral_would_run_to_its_limit() -> None:
    held, speed = release_from_limit(tell=False)
    assert held == pytest.approx(100.0, abs=1.0)
    assert speed == pytest.approx(6.0 / 3.6, abs=0.03)


@given(number, number, st.floats(-1, 1, width=32))
def test_what_was_applied_in_full_changes_nothing(reference: float, measurement: float, feed_forward: float) -> None:
    pid = Pid(kp=1.0, ki=10.0)
    wanted = pid.step(reference, measurement, feed_forward)
    before = pid.snapshot()
    pid.limited(wanted, wanted)
    assert pid.snapshot() == before


def test_without_proportional_gain_the_cut_is_taken_back_at_once() -> None:
    pid = Pid(ki=1000.0)
    assert pid.step(5.0, 0.0) == pytest.approx(5.0)
    pid.limited(5.0, 3.0)
    assert pid.state.integral == pytest.approx(3.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("slot", range(3))
def test_no_number_gives_no_output_and_leaves_the_state(bad: float, slot: int) -> None:
    pid = Pid(kp=1.0, ki=1.0, kd=0.1)
    pid.step(1.0, 0.5)
    pid.step(1.0, 0.6)
    before = pid.snapshot()
    arguments = [1.0, 0.7, 0.0]
    arguments[slot] = bad
    assert pid.step(*arguments) == 0.0
    pid.limited(bad, 1.0)
    pid.limited(1.0, bad)
    assert pid.snapshot() == before


@given(st.lists(st.tuples(*[st.floats(width=32)] * 3), max_size=20))
def test_nothing_poisons_the_state(steps: list[tuple[float, float, float]]) -> None:
    pid = Pid(kp=5.0, ki=50.0, kd=0.5)
    for arguments in steps:
        wanted = pid.step(*arguments)
        assert math.isfinite(wanted)
        pid.limited(wanted, min(max(wanted, -12.0), 12.0))
        assert all(math.isfinite(value) for value in pid.snapshot())


def test_reset_forgets_everything() -> None:
    pid = Pid(kp=1.0, ki=1.0, kd=1.0)
    pid.step(1.0, 0.0)
    pid.step(1.0, 0.3)
    lib.omni_pid_reset(pid.state)
    assert pid.snapshot() == (0.0, 0.0, 0.0, False)
