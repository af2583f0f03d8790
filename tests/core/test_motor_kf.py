# SPDX-License-Identifier: MIT
"""The wheel's Kalman filter against FilterPy, and what it is for: a quiet, fast speed from coarse counts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from filterpy.kalman import KalmanFilter

from omniwheel._core import ffi, lib

Array = npt.NDArray[np.float64]
OFF, SPEED, ANGLE = lib.OMNI_KF_MODE_OFF, lib.OMNI_KF_MODE_SPEED, lib.OMNI_KF_MODE_ANGLE
STEP_S = 1e-3
RAD_PER_COUNT = 2 * math.pi / 10000
MOTOR = (0.01, 1.0, 1.05, 2.7, 0.0014)


class Filter:
    """The core's filter for one wheel of the three-wheel platform."""

    def __init__(self, mode: int, step_s: float = STEP_S, **changes: float) -> None:
        self.config = ffi.new("omni_motor_kf_config_t *", {"mode": mode, "step_s": step_s})
        self.config.rad_per_count = RAD_PER_COUNT
        self.config.q_speed = 2.0**2 * step_s
        self.config.q_current = 4.0**2 * step_s
        self.config.r_speed = 0.316**2
        self.config.r_angle = (0.5 * RAD_PER_COUNT) ** 2
        for name, value in changes.items():
            setattr(self.config, name, value)
        model = ffi.addressof(self.config, "model")
        motor = ffi.new("omni_motor_config_t *", list(MOTOR))
        assert lib.omni_motor_discretise(motor, step_s, model) == lib.OMNI_OK
        self.state = ffi.new("omni_motor_kf_state_t *")
        lib.omni_motor_kf_reset(self.state, self.config)

    def step(self, volts: float, counts: int, valid: bool = True) -> float:
        return float(lib.omni_motor_kf_step(self.state, self.config, volts, counts, valid))

    @property
    def x(self) -> Array:
        return np.array(list(self.state.x))

    @property
    def p(self) -> Array:
        return np.array([list(row) for row in self.state.p])


def reference_filter(core: Filter, first: int) -> Any:
    """Return FilterPy's filter over the states from ``first`` on, with the core's own numbers in double precision."""
    config = core.config
    states = slice(first, 3)
    kf = KalmanFilter(dim_x=3 - first, dim_z=1, dim_u=1)
    kf.x = np.zeros((3 - first, 1))
    kf.P = core.p[states, states]
    kf.F = np.array([list(row) for row in config.model.a])[states, states]
    kf.B = np.array(list(config.model.b))[states].reshape(-1, 1)
    kf.H = np.eye(1, 3 - first)
    kf.Q = np.diag([0.0, config.q_speed, config.q_current])[states, states]
    kf.R = np.array([[config.r_speed if first == 1 else config.r_angle]])
    return kf


def motor_run(steps: int, volts_at: Callable[[float], float], step_s: float = STEP_S) -> tuple[Array, Array, Array]:
    """Return applied volts, encoder count after and true speed after each step of a motor driven open loop."""
    core = Filter(OFF, step_s)
    a = np.array([list(row) for row in core.config.model.a])
    b = np.array(list(core.config.model.b))
    x = np.array([0.3 * RAD_PER_COUNT, 0.0, 0.0])
    volts, counts, speeds = [], [], []
    for k in range(steps):
        volts.append(float(np.float32(volts_at(k * step_s))))
        x = a @ x + b * volts[-1]
        counts.append(math.floor(x[0] / RAD_PER_COUNT))
        speeds.append(x[1])
    return np.array(volts), np.array(counts), np.array(speeds)


@pytest.mark.parametrize("step_s", [1e-3, 0.02])
@pytest.mark.parametrize("mode", [SPEED, ANGLE])
def test_agrees_with_filterpy(mode: int, step_s: float) -> None:
    volts, counts, _ = motor_run(600, lambda t: 6 + 4 * math.sin(9 * t), step_s)
    core = Filter(mode, step_s)
    first = 1 if mode == SPEED else 0
    kf = reference_filter(core, first)
    last = 0
    got_x, got_p, expected_x, expected_p = [], [], [], []
    for k, (v, count) in enumerate(zip(volts, counts, strict=True)):
        # the reference knows the absolute angle; the core is told increments, and none for a while now and then
        valid = mode == SPEED or k % 50 < 47
        angle = int(count) * core.config.rad_per_count
        speed = (int(count) - last) * core.config.rad_per_count / core.config.step_s
        core.step(v, int(count) - last if valid else 0, valid)
        kf.predict(u=np.array([[v]]))
        if valid:
            kf.update(speed if mode == SPEED else angle)
            last = int(count)
        origin = last * core.config.rad_per_count * (np.arange(first, 3) == 0)
        got_x.append(core.x[first:])
        got_p.append(core.p[first:, first:])
        expected_x.append(kf.x[:, 0] - origin)
        expected_p.append(kf.P.copy())
    assert_close(np.array(got_x), np.array(expected_x), np.abs(expected_x).max(axis=0))
    deviations = np.sqrt(np.diagonal(expected_p, axis1=1, axis2=2))
    assert_close(np.array(got_p), np.array(expected_p), deviations[:, :, None] * deviations[:, None, :])


def test_a_measured_speed_is_as_good_as_the_counts_it_comes_from() -> None:
    volts, counts, _ = motor_run(200, lambda t: 6 + 4 * math.sin(9 * t))
    by_counts, by_speed = Filter(SPEED), Filter(SPEED)
    for v, delta in zip(volts, np.diff(counts, prepend=0), strict=True):
        moved = np.float32(delta) * np.float32(by_counts.config.rad_per_count)
        speed = moved / np.float32(by_counts.config.step_s)
        by_counts.step(v, int(delta))
        got = lib.omni_motor_kf_step_speed(by_speed.state, by_speed.config, v, speed)
        assert got == by_counts.x[1]
    np.testing.assert_array_equal(by_speed.p, by_counts.p)


@pytest.mark.parametrize("speed", [math.nan, math.inf])
def test_a_speed_that_is_no_number_only_predicts(speed: float) -> None:
    core, predicted = Filter(SPEED), Filter(SPEED)
    lib.omni_motor_kf_step_speed(core.state, core.config, 6.0, speed)
    predicted.step(6.0, 0, valid=False)
    np.testing.assert_array_equal(core.x, predicted.x)
    np.testing.assert_array_equal(core.p, predicted.p)
    assert core.state.missed == 1


def assert_close(got: Array, expected: Array, scale: Array) -> None:
    """Compare to 1e-5 of the size of each state, and for covariances of the product of their deviations."""
    assert np.max(np.abs(got - expected) / scale) < 1e-5


def errors_after_convergence(mode: int, volts_at: Callable[[float], float], steps: int = 3000) -> float:
    volts, counts, speeds = motor_run(steps, volts_at)
    deltas = np.diff(counts, prepend=0)
    core = Filter(mode)
    estimates = np.array([core.step(float(v), int(d)) for v, d in zip(volts, deltas, strict=True)])
    return float(np.sqrt(np.mean((estimates - speeds)[1000:] ** 2)))


@pytest.mark.parametrize(
    ("volts_at", "share"),
    [
        (lambda t: 7.3, 0.1),
        (lambda t: 0.0311, 0.3),  # a count now and then: differencing is mostly zero, and nearly right
        (lambda t: 4.0 * t - 6.0, 0.1),
        (lambda t: 6.0 * math.sin(2 * t), 0.1),
    ],
    ids=["constant", "crawling", "ramp", "sine"],
)
def test_measuring_the_angle_beats_differencing_by_far(volts_at: Callable[[float], float], share: float) -> None:
    differenced = errors_after_convergence(OFF, volts_at)
    filtered = errors_after_convergence(ANGLE, volts_at)
    assert filtered < 0.03
    assert filtered < share * differenced


def test_a_sagging_battery_biases_the_speed_less_than_the_voltage() -> None:
    volts, counts, speeds = motor_run(4000, lambda t: 5.0)
    core = Filter(ANGLE)
    deltas = np.diff(counts, prepend=0)
    estimates = [core.step(1.1 * float(v), int(d)) for v, d in zip(volts, deltas, strict=True)]
    assert np.mean(estimates[2000:]) == pytest.approx(speeds[-1], rel=0.04)


def test_no_precision_is_lost_after_a_billion_counts() -> None:
    volts, counts, _ = motor_run(2000, lambda t: 5.0 + math.sin(5 * t))
    deltas = np.diff(counts, prepend=0)
    fresh, travelled = Filter(ANGLE), Filter(ANGLE)
    for _ in range(100000):
        travelled.step(12.0, 10000)
    results = np.array([(fresh.step(v, int(d)), travelled.step(v, int(d))) for v, d in zip(volts, deltas, strict=True)])
    assert travelled.x[0] == pytest.approx(fresh.x[0], abs=0.01 * RAD_PER_COUNT)
    np.testing.assert_allclose(results[-500:, 0], results[-500:, 1], rtol=1e-4)


@pytest.mark.parametrize("mode", [SPEED, ANGLE])
def test_the_covariance_stays_symmetric_and_positive(mode: int) -> None:
    core = Filter(mode)
    first = 1 if mode == SPEED else 0
    rng = np.random.default_rng(4)
    for _ in range(5000):
        core.step(float(rng.uniform(-12, 12)), int(rng.integers(-20, 20)), bool(rng.random() < 0.7))
        p = core.p[first:, first:]
        scale = np.sqrt(np.diag(p))
        np.testing.assert_array_equal(p, p.T)
        assert np.linalg.eigvalsh(p / np.outer(scale, scale)).min() > -1e-5


@pytest.mark.parametrize("mode", [OFF, SPEED, ANGLE])
def test_starts_at_rest(mode: int) -> None:
    core = Filter(mode)
    for _ in range(100):
        assert core.step(0.0, 0) == 0.0
    assert not core.x.any()


def test_at_first_the_angle_is_as_sure_as_one_reading_of_the_counter() -> None:
    assert Filter(ANGLE).p[0, 0] == np.float32((0.5 * RAD_PER_COUNT) ** 2)
    assert Filter(SPEED).p[0, 0] == 0.0


def test_off_is_differenced_counts_and_holds_over_a_gap() -> None:
    core = Filter(OFF)
    assert core.step(9.0, 7) == pytest.approx(7 * RAD_PER_COUNT / STEP_S, rel=1e-6)
    assert core.step(9.0, 0, valid=False) == pytest.approx(7 * RAD_PER_COUNT / STEP_S, rel=1e-6)
    assert core.step(9.0, -3) == pytest.approx(-3 * RAD_PER_COUNT / (2 * STEP_S), rel=1e-6)
    assert core.step(9.0, -3) == pytest.approx(-3 * RAD_PER_COUNT / STEP_S, rel=1e-6)


def test_counts_after_a_gap_are_spread_over_the_gap() -> None:
    core = Filter(SPEED, q_speed=0.0, q_current=0.0)
    turning = [core.step(0.0, 5) for _ in range(20)]
    for _ in range(3):
        core.step(0.0, 0, valid=False)
    core.step(0.0, 20)
    assert turning[-1] > 0
    assert core.state.innovation == pytest.approx(5 * RAD_PER_COUNT / STEP_S, rel=0.2)


@pytest.mark.parametrize("mode", [SPEED, ANGLE])
def test_without_counts_the_model_runs_on(mode: int) -> None:
    core = Filter(mode)
    for _ in range(500):
        core.step(6.0, 0, valid=False)
    motor = ffi.new("omni_motor_config_t *", list(MOTOR))
    assert core.x[1] == pytest.approx(6.0 / lib.omni_motor_speed_gain(motor), rel=1e-4)


@pytest.mark.parametrize("mode", [OFF, SPEED, ANGLE])
@pytest.mark.parametrize("volts", [math.nan, math.inf, -math.inf])
def test_a_voltage_that_is_not_finite_counts_as_none(mode: int, volts: float) -> None:
    bad, none = Filter(mode), Filter(mode)
    for _ in range(50):
        assert bad.step(volts, 3) == none.step(0.0, 3)
    assert np.all(np.isfinite(bad.x))
    np.testing.assert_array_equal(bad.p, none.p)


def test_a_perfect_measurement_of_a_known_state_is_no_division_by_zero() -> None:
    core = Filter(SPEED, r_speed=0.0, q_speed=0.0, q_current=0.0)
    for row in core.state.p:
        for c in range(3):
            row[c] = 0.0
    assert core.step(0.0, 1) == 0.0
    assert np.all(np.isfinite(core.x))
