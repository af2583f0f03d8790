# SPDX-License-Identifier: MIT
"""Sliding mode and feedback-linearised controllers on an integrator plant, and the robot's original law."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import signal

from omniwheel._core import ffi, lib

Array = NDArray[np.float64]
STEP_S = 1e-3
ZERO = np.zeros(3)
SIGN, BOUNDARY, TWISTING = (
    lib.OMNI_ISMC_SWITCH_SIGN,
    lib.OMNI_ISMC_SWITCH_BOUNDARY,
    lib.OMNI_ISMC_SWITCH_SUPER_TWISTING,
)


def vector(twist: Any) -> Array:
    return np.array([twist.vx, twist.vy, twist.wz])


def axes(values: Any) -> Array:
    return np.array([values[i] for i in range(3)])


class Ismc:
    def __init__(self, **options: Any) -> None:
        self.config = ffi.new("omni_ismc_config_t *")
        values = {
            "lambda": [12.0, 12.0, 9.0],
            "k": [0.05, 0.05, 0.2],
            "phi": [0.01, 0.01, 0.03],
            "integral_limit": [1.0, 1.0, 1.0],
            "switching": BOUNDARY,
            "step_s": STEP_S,
        }
        for name, value in (values | options).items():
            setattr(self.config, name, value)
        self.state = ffi.new("omni_ismc_state_t *")
        lib.omni_ismc_reset(self.state)
        self.terms = ffi.new("omni_control_terms_t *")

    def step(self, pose: Any, reference: Any = ZERO, rate: Any = ZERO, hold: bool = False) -> Array:
        twist = lib.omni_ismc_step(
            self.state,
            self.config,
            ffi.new("omni_pose_t *", tuple(pose)),
            ffi.new("omni_pose_t *", tuple(reference)),
            ffi.new("omni_twist_t *", tuple(rate)),
            hold,
            self.terms,
        )
        return vector(twist)


class Fl:
    def __init__(self, kp: float = 6.0, kd: float = 0.0, ki: float = 0.0, limit: float = 10.0) -> None:
        self.config = ffi.new("omni_fl_config_t *")
        self.config.kp = [kp] * 3
        self.config.kd = [kd] * 3
        self.config.ki = [ki] * 3
        self.config.integral_limit = [limit] * 3
        self.config.step_s = STEP_S
        self.state = ffi.new("omni_fl_state_t *")
        lib.omni_fl_reset(self.state)
        self.terms = ffi.new("omni_control_terms_t *")

    def step(
        self, pose: Any, measured: Any = ZERO, reference: Any = ZERO, rate: Any = ZERO, hold: bool = False
    ) -> Array:
        twist = lib.omni_fl_step(
            self.state,
            self.config,
            ffi.new("omni_pose_t *", tuple(pose)),
            ffi.new("omni_twist_t *", tuple(measured)),
            ffi.new("omni_pose_t *", tuple(reference)),
            ffi.new("omni_twist_t *", tuple(rate)),
            hold,
            self.terms,
        )
        return vector(twist)


def simulate(controller: Ismc, start: Any, disturbance: Callable[[float], Any], seconds: float) -> tuple[Array, Array]:
    """Pose' = u + d; return poses and wanted twists."""
    pose = np.array(start, float)
    poses, twists = [], []
    for tick in range(int(seconds / STEP_S)):
        twist = controller.step(pose)
        pose = pose + STEP_S * (twist + np.asarray(disturbance(tick * STEP_S)))
        poses.append(pose)
        twists.append(twist)
    return np.array(poses), np.array(twists)


def test_on_the_surface_the_error_decays_at_lambda_and_s_stays_zero() -> None:
    ismc = Ismc(integral_limit=[10.0] * 3)
    start = np.array([0.02, -0.03, 0.05])
    rates = np.array([12.0, 12.0, 9.0])
    ismc.state.integral = list(-start / rates)  # s = e + lambda integral = 0
    pose = start.copy()
    for tick in range(1000):
        np.testing.assert_allclose(pose, start * (1 - rates * STEP_S) ** tick, atol=1e-6)
        pose = pose + STEP_S * ismc.step(pose)
        assert np.abs(axes(ismc.terms.surface)).max() < 1e-6


@pytest.mark.parametrize("switching", [SIGN, BOUNDARY])
def test_s_shrinks_by_k_until_it_is_reached(switching: int) -> None:
    ismc = Ismc(switching=switching)
    pose = np.array([0.05, -0.05, 0.2])
    surfaces = []
    for _ in range(400):
        pose = pose + STEP_S * ismc.step(pose)
        surfaces.append(axes(ismc.terms.surface))
    falls = np.diff(np.abs(np.array(surfaces)), axis=0)
    outside = np.abs(np.array(surfaces))[:-1] > np.array([0.01, 0.01, 0.03])
    k = np.broadcast_to([0.05, 0.05, 0.2], falls.shape)
    assert outside.sum() > 500
    np.testing.assert_allclose(falls[outside], -STEP_S * k[outside], rtol=2e-2)


@pytest.mark.parametrize("switching", [SIGN, BOUNDARY, TWISTING])
def test_a_disturbance_below_k_is_rejected(switching: int) -> None:
    """Slip of half the switching gain leaves (almost) no error; without switching the error stays at d / lambda."""

    def disturbance(t: float) -> Array:
        return np.array([0.025, 0.025 * math.sin(0.5 * t), -0.1])

    poses, _ = simulate(Ismc(switching=switching), ZERO, disturbance, 8.0)
    unaided, _ = simulate(Ismc(k=[0.0] * 3, integral_limit=[0.0] * 3), ZERO, disturbance, 8.0)
    last = slice(-1000, None)
    assert np.abs(poses[last]).max() < 0.12 * np.abs(unaided[last]).max()


def test_a_disturbance_beyond_k_is_not() -> None:
    ismc = Ismc(switching=SIGN, integral_limit=[0.0] * 3)
    poses, _ = simulate(ismc, ZERO, lambda _t: [0.1, 0.0, 0.0], 4.0)
    assert poses[-1, 0] == pytest.approx((0.1 - 0.05) / 12.0, rel=2e-2)


def test_super_twisting_is_continuous_where_the_sign_chatters() -> None:
    def disturbance(_t: float) -> Array:
        return np.array([0.02, -0.02, 0.05])

    _, sign = simulate(Ismc(switching=SIGN), (0.02, 0.0, 0.0), disturbance, 4.0)
    _, smooth = simulate(Ismc(switching=TWISTING), (0.02, 0.0, 0.0), disturbance, 4.0)
    jumps = np.abs(np.diff(sign[2000:, :2], axis=0)).max()
    assert jumps > 0.09
    assert np.abs(np.diff(smooth[2000:, :2], axis=0)).max() < 0.05 * jumps
    np.testing.assert_allclose(smooth[-1], -disturbance(0.0), atol=2e-3)


@given(st.floats(-1.0, 1.0, width=32), st.floats(-3.0, 3.0, width=32))
def test_switching_term_never_exceeds_k_and_opposes_s(error: float, heading: float) -> None:
    for switching in (SIGN, BOUNDARY):
        ismc = Ismc(switching=switching)
        ismc.step((error, -error, heading))
        switched, surface = axes(ismc.terms.switching), axes(ismc.terms.surface)
        assert np.all(np.abs(switched) <= np.array([0.05, 0.05, 0.2], np.float32))
        assert np.all(switched * surface <= 0.0)


def test_terms_add_up_and_are_the_published_ones() -> None:
    ismc = Ismc()
    ismc.state.integral = [0.001, -0.002, 0.003]
    rate = np.array([0.1, 0.2, 0.3])
    twist = ismc.step((0.11, 0.18, 0.5), (0.1, 0.2, 0.45), rate)
    t = ismc.terms
    np.testing.assert_allclose(axes(t.error), [0.01, -0.02, 0.05], atol=1e-7)
    np.testing.assert_allclose(axes(t.surface), [0.022, -0.044, 0.077], atol=1e-6)
    np.testing.assert_allclose(axes(t.equivalent), rate - [0.12, -0.24, 0.45], atol=1e-6)
    np.testing.assert_allclose(axes(t.switching), [-0.05, 0.05, -0.2], atol=1e-6)
    np.testing.assert_allclose(twist, axes(t.equivalent) + axes(t.switching), atol=1e-7)


def test_heading_error_takes_the_short_way() -> None:
    for controller in (Ismc(), Fl()):
        twist = controller.step((0, 0, 3.1), reference=(0, 0, -3.1))
        assert controller.terms.error[2] == pytest.approx(6.2 - 2 * math.pi, abs=1e-6)
        assert twist[2] > 0.0


def test_integral_is_limited_and_held_but_may_shrink() -> None:
    for controller in (Ismc(integral_limit=[0.002] * 3), Fl(ki=4.0, limit=0.002)):
        for _ in range(100):
            controller.step((0.1, -0.1, 0.1))
        np.testing.assert_allclose(axes(controller.state.integral), [0.002, -0.002, 0.002])
        controller.step((-0.1, 0.1, -0.1), hold=True)
        np.testing.assert_allclose(axes(controller.state.integral), [0.0019, -0.0019, 0.0019], rtol=1e-5)
        controller.step((0.1, -0.1, 0.1), hold=True)
        np.testing.assert_allclose(axes(controller.state.integral), [0.0019, -0.0019, 0.0019], rtol=1e-5)


def test_the_integral_that_is_told_is_the_one_of_the_errors_before() -> None:
    ismc = Ismc()
    for step in range(5):
        ismc.step((0.1, -0.2, 0.3))
        np.testing.assert_allclose(axes(ismc.terms.integral), np.array([0.1, -0.2, 0.3]) * step * STEP_S, rtol=1e-5)


def test_a_held_integral_that_changes_its_side_has_not_grown() -> None:
    ismc = Ismc(step_s=0.25, integral_limit=[8.0] * 3)
    ismc.step((2.0, -2.0, 0.0))
    ismc.step((-4.0, 4.0, 0.0), hold=True)
    np.testing.assert_array_equal(axes(ismc.state.integral), [-0.5, 0.5, 0.0])


def test_input_that_is_not_finite_asks_for_no_motion_and_leaves_the_state() -> None:
    for controller in (Ismc(), Fl(ki=4.0)):
        controller.step((0.1, 0.1, 0.1))
        before = axes(controller.state.integral)
        for bad in (math.nan, math.inf):
            np.testing.assert_array_equal(controller.step((bad, 0, 0)), ZERO)
            np.testing.assert_array_equal(controller.step(ZERO, rate=(0, bad, 0)), ZERO)
            np.testing.assert_array_equal(controller.step(ZERO, reference=(0, 0, bad)), ZERO)
        np.testing.assert_array_equal(axes(controller.state.integral), before)


def test_gain_margin_of_condition_44() -> None:
    margin = ffi.new("float[3]")
    lib.omni_ismc_gain_margin(Ismc().config, ffi.new("omni_twist_t *", (0.02, -0.06, -0.2)), margin)
    np.testing.assert_allclose(axes(margin), [0.03, -0.01, 0.0], atol=1e-7)


@pytest.mark.parametrize(("kp", "kd", "ki"), [(6.0, 0.0, 0.0), (6.0, 0.2, 0.0), (6.0, 0.05, 4.0), (3.0, 0.0, 8.0)])
def test_feedback_linearised_step_response_is_the_closed_form(kp: float, kd: float, ki: float) -> None:
    """Pose' = u with rate measured: (1 + kd) e' + kp e + ki integral(e) = 0, to a step of the reference."""
    fl = Fl(kp, kd, ki)
    pose, rate = ZERO.copy(), ZERO.copy()
    poses = []
    for _ in range(3000):
        # u = -kp e - kd u_measured: on this plant the measured rate is the wanted one; iterate to it.
        state = list(fl.state.integral)
        for _ in range(12):
            fl.state.integral = state
            rate = fl.step(pose, rate, reference=(1, 1, 1))
        poses.append(pose[0])
        pose = pose + STEP_S * rate
    times = np.arange(3000) * STEP_S
    system = signal.TransferFunction([kp, ki], [1 + kd, kp, ki])
    _, expected = signal.step(system, T=times)
    np.testing.assert_allclose(poses, expected, atol=4e-3)


def test_pid_removes_a_constant_disturbance() -> None:
    def settle(ki: float) -> float:
        fl = Fl(6.0, 0.0, ki)
        pose = ZERO.copy()
        for _ in range(8000):
            pose = pose + STEP_S * (fl.step(pose) + 0.06)
        return float(pose[0])

    assert settle(0.0) == pytest.approx(0.01, rel=1e-3)
    assert abs(settle(9.0)) < 1e-5


# ---------------------------------------------------------------- the robot's original law


class Original:
    """The law on three wheels, and the same law written anew in float64."""

    def __init__(self) -> None:
        geometry = ffi.new("omni_kinematics_config_t *")
        geometry.wheels = 3
        for i in range(3):
            geometry.radius_m[i], geometry.distance_m[i] = 0.0508, 0.2632
            geometry.angle_rad[i] = 2 * math.pi * i / 3
        self.k = ffi.new("omni_kinematics_t *")
        assert lib.omni_kinematics_init(self.k, geometry) == lib.OMNI_OK
        self.rad_per_count = 2 * math.pi / 10_000
        self.config = ffi.new("omni_original_config_t *", lib.omni_original_defaults(STEP_S, self.rad_per_count))
        self.state = ffi.new("omni_original_state_t *")
        lib.omni_original_reset(self.state)

    def step(self, counts: Any, pose: Any, reference: Any = ZERO, rate: Any = ZERO, supply: float = 12.0) -> Array:
        lib.omni_original_step(
            self.state,
            self.config,
            self.k,
            ffi.new("int32_t[4]", [int(c) for c in counts]),
            ffi.new("omni_pose_t *", tuple(pose)),
            ffi.new("omni_pose_t *", tuple(reference)),
            ffi.new("omni_twist_t *", tuple(rate)),
            supply,
        )
        return axes(self.state.voltage_V)


def test_original_constants() -> None:
    c = Original().config
    assert (c.period_ticks, c.motor_p, c.motor_i, c.wheel_limit) == (20, 10.0, 30.0, 4.0)
    assert (c.period_s, c.k, getattr(c, "lambda")) == pytest.approx((0.02, 0.01, 14.0))


def test_original_law_holds_its_output_for_a_period_and_matches_its_description() -> None:
    law = Original()
    rng = np.random.default_rng(5)
    bearings = 2 * np.pi * np.arange(3) / 3
    windows = [deque([0.0] * 100, maxlen=100) for _ in range(6)]
    for period in range(250):
        pose, rate = rng.normal(0, [0.01, 0.01, 0.05]), rng.normal(0, 0.05, 3)
        counts = rng.integers(-5, 6, (20, 3))
        held = axes(law.state.voltage_V)
        for tick in range(20):
            volts = law.step(counts[tick], pose, rate=rate)
            if tick < 19:
                np.testing.assert_array_equal(volts, held)
        twist = np.zeros(3)
        for axis in range(3):
            windows[axis].append(pose[axis])
            surface = pose[axis] + 14 * sum(windows[axis]) / 100
            twist[axis] = -14 * pose[axis] + rate[axis] - 0.01 * np.sign(surface)
        angle = pose[2] + bearings
        wheels = (-np.sin(angle) * twist[0] + np.cos(angle) * twist[1] + 0.2632 * twist[2]) / 0.0508
        wheels *= min(1.0, 4.0 / np.abs(wheels).max())
        errors = wheels - counts.sum(axis=0) * law.rad_per_count / 0.02
        expected = np.zeros(3)
        for i in range(3):
            windows[3 + i].append(errors[i])
            expected[i] = 10 * errors[i] + 30 * sum(windows[3 + i]) / 100
        expected *= min(1.0, 12.0 / np.abs(expected).max())
        np.testing.assert_allclose(volts, expected, atol=2e-3, err_msg=str(period))


def test_original_law_stays_silent_on_input_that_is_not_finite() -> None:
    law = Original()
    for _ in range(20):
        law.step((5, 5, 5), (0.1, 0.1, 0.1))
    assert np.abs(axes(law.state.voltage_V)).max() > 0.0
    for _ in range(20):
        volts = law.step((5, 5, 5), (math.nan, 0.1, 0.1))
    np.testing.assert_array_equal(volts, ZERO)
