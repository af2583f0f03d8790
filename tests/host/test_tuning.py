# SPDX-License-Identifier: MIT
from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omniwheel.tuning import Trace, step_figures, step_response, tracking_figures

TIME_S = np.arange(0.0, 10.0, 1e-3)


@given(tau=st.floats(0.05, 1.0), start=st.floats(-2.0, 2.0), size=st.sampled_from([-0.5, 0.1, 1.0]))
def test_a_first_order_lag_has_the_figures_of_the_textbook(tau: float, start: float, size: float) -> None:
    value = start + size * (1.0 - np.exp(-TIME_S / tau))
    rise_s, overshoot, settling_s = step_response(TIME_S, value, start, start + size)
    assert rise_s == pytest.approx(tau * math.log(9.0), abs=2e-3)
    assert overshoot == pytest.approx(0.0, abs=1e-9)
    assert settling_s == pytest.approx(tau * math.log(20.0), abs=2e-3)


@given(zeta=st.floats(0.2, 0.8))
def test_an_oscillator_overshoots_as_its_damping_says(zeta: float) -> None:
    damped = math.sqrt(1.0 - zeta**2)
    wave = np.cos(damped * 5.0 * TIME_S) + zeta / damped * np.sin(damped * 5.0 * TIME_S)
    _, overshoot, settling_s = step_response(TIME_S, 1.0 - np.exp(-zeta * 5.0 * TIME_S) * wave, 0.0, 1.0)
    assert overshoot == pytest.approx(math.exp(-math.pi * zeta / damped), abs=1e-4)
    assert 0.0 < settling_s <= -math.log(0.05 * damped) / (zeta * 5.0) + 2e-3


def test_an_answer_that_never_gets_there_has_no_times() -> None:
    rise_s, overshoot, settling_s = step_response(TIME_S, np.full_like(TIME_S, 0.5), 0.0, 1.0)
    assert math.isnan(rise_s)
    assert overshoot == 0.0
    assert math.isnan(settling_s)


def trace(pose: list[list[float]], reference: list[list[float]]) -> Trace:
    return Trace(0.02 * np.arange(len(pose), dtype=np.float64), np.array(reference), np.array(pose))


def test_tracking_errors_are_root_mean_squares_with_the_heading_wrapped() -> None:
    figures = tracking_figures(
        trace([[0.003, 0.0, math.pi - 0.01], [0.0, 0.004, 0.0]], [[0.0, 0.0, -math.pi], [0.0] * 3])
    )
    assert figures.position_m == pytest.approx(math.sqrt((0.003**2 + 0.004**2) / 2))
    assert figures.theta_rad == pytest.approx(0.01 / math.sqrt(2))
    assert math.isnan(figures.rise_s)


def test_a_heading_step_may_cross_half_a_turn() -> None:
    theta = np.linspace(3.0, 3.4, 50)
    wrapped = (theta + math.pi) % (2 * math.pi) - math.pi
    pose = np.column_stack([np.zeros((50, 2)), wrapped])
    figures = step_figures(trace(pose.tolist(), pose.tolist()), 2, 3.0, 0.4)
    assert figures.overshoot == pytest.approx(0.0, abs=1e-9)
    assert figures.rise_s == pytest.approx(0.8 * 49 * 0.02, abs=0.05)
