# SPDX-License-Identifier: MIT
"""The pose filter against FilterPy and a float64 filter that replays; gating, refusals, precision, consistency."""

from __future__ import annotations

import importlib.util
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from numpy.typing import NDArray
from scipy import stats

from omniwheel._core import ffi, lib

_SPEC = importlib.util.spec_from_file_location("pose_ekf_reference", Path(__file__).with_name("pose_ekf_reference.py"))
assert _SPEC is not None
assert _SPEC.loader is not None
reference = importlib.util.module_from_spec(_SPEC)
sys.modules["pose_ekf_reference"] = reference
_SPEC.loader.exec_module(reference)

Array = NDArray[np.float64]
POSE, SLIP, ODOMETRY = lib.OMNI_EKF_MODE_POSE, lib.OMNI_EKF_MODE_SLIP, lib.OMNI_EKF_MODE_ODOMETRY
GEOMETRY = {
    3: reference.Geometry(0.0508, 0.2632, np.deg2rad([0.0, 120.0, 240.0])),
    4: reference.Geometry(0.03175, 0.195, np.deg2rad([45.0, 135.0, 225.0, 315.0])),
}
TICK_US = 1000


class Ekf:
    """The core's filter."""

    def __init__(
        self,
        wheels: int = 3,
        mode: int = POSE,
        noise: Any = None,
        pose: Any = (0, 0, 0),
        sd: Any = (0.01, 0.01),
        **options: Any,
    ) -> None:
        geometry = GEOMETRY[wheels]
        kinematics = ffi.new("omni_kinematics_config_t *")
        kinematics.wheels = wheels
        for i in range(wheels):
            kinematics.radius_m[i] = geometry.radius_m
            kinematics.distance_m[i] = geometry.distance_m
            kinematics.angle_rad[i] = geometry.bearings[i]
        self.k = ffi.new("omni_kinematics_t *")
        assert lib.omni_kinematics_init(self.k, kinematics) == lib.OMNI_OK
        self.config = ffi.new("omni_pose_ekf_config_t *")
        values = {"mode": mode, "p_slip": 0.0064, "gate": 0.0, "gate_restart": 25, "step_s": 1e-3}
        for name, value in (values | vars(noise or reference.Noise()) | options).items():
            setattr(self.config, name, value)
        self.wheels = wheels
        self.s = ffi.new("omni_pose_ekf_state_t *")
        lib.omni_pose_ekf_reset(self.s, self.config, ffi.new("omni_pose_t *", pose), *sd)
        self.time_us = 0
        self.turned = ffi.new("float[4]")

    def predict(self, turned: Any, count: int = 1) -> None:
        for i in range(self.wheels):
            self.turned[i] = turned[i]
        for _ in range(count):
            self.time_us += TICK_US
            lib.omni_pose_ekf_predict(self.s, self.config, self.k, self.turned, self.time_us)

    def correct(self, pose: Any, age_us: int = 0, sd: Any = (0.0, 0.0)) -> int:
        fix = ffi.new("omni_pose_fix_t *")
        fix.time_us = self.time_us - age_us
        fix.pose.x, fix.pose.y, fix.pose.theta = pose
        fix.sd_xy, fix.sd_theta = sd
        return int(lib.omni_pose_ekf_correct(self.s, self.config, self.k, fix))

    @property
    def states(self) -> int:
        return 3 + (self.wheels if self.config.mode == SLIP else 0)

    @property
    def x(self) -> Array:
        s = self.s
        return np.array([s.pose.x, s.pose.y, s.pose.theta, *(s.error_state[i] for i in range(self.wheels))])[
            : self.states
        ]

    def settled(self) -> Any:
        """Return a copy of the state whose covariance is that of now."""
        copy = ffi.new("omni_pose_ekf_state_t *", self.s[0])
        lib.omni_pose_ekf_propagate_covariance(copy, self.config, self.k)
        return copy

    @property
    def p(self) -> Array:
        p = self.settled().p
        return np.array([[p[a][b] for b in range(self.states)] for a in range(self.states)])

    def snapshot(self) -> bytes:
        """All bytes but counters and diagnostics."""
        copy = self.settled()
        copy.refused = copy.consecutive_refusals = 0
        copy.nis = 0.0
        copy.innovation = [0.0] * 3
        copy.first_refused_fix = copy.first_refused_estimate = ffi.new("omni_pose_t *")[0]
        copy.first_refused_distance_m = 0.0
        return bytes(ffi.buffer(copy))


def float32(values: Any) -> Array:
    return np.asarray(values, np.float32).astype(np.float64)


def drive(wheels: int, ticks: int, seed: int, speed: float = 3.0) -> Array:
    """Return smooth wheel increments that roll (no null component), rounded to float32."""
    rng = np.random.default_rng(seed)
    t = np.arange(ticks)[:, None] * 1e-3
    waves = sum(
        rng.uniform(-1, 1, 3) * np.sin(2 * np.pi * rng.uniform(0.2, 1.0, 3) * t + rng.uniform(0, 6, 3))
        for _ in range(4)
    )
    body = waves * np.array([0.06, 0.06, 0.2]) * speed / 3.0
    return float32(body @ GEOMETRY[wheels].matrix.T / GEOMETRY[wheels].radius_m * 1e-3)


def assert_same(ekf: Ekf, other: Any, mean_sd: float, relative: float) -> None:
    sd = np.sqrt(np.diag(other.p))
    error: Array = ekf.x - other.x
    error[2] = reference.wrap(error[2])
    assert np.abs(error / sd).max() <= mean_sd
    assert np.abs((ekf.p - other.p) / np.outer(sd, sd)).max() <= relative


def make_reference(ekf: Ekf) -> Any:
    x = np.zeros(ekf.states)
    p = np.diag([1e-4, 1e-4, 1e-4, *[0.0064] * (ekf.states - 3)])
    return reference.Filter(GEOMETRY[ekf.wheels], reference.Noise(), x, p)


def assert_late_fix_is_exact(
    ekf: Ekf, motion: Sequence[Any], carry: Callable[[Any, Sequence[Any]], None], age_ticks: int
) -> None:
    """Use a fix that is so old. A float64 filter, which ``carry`` takes along ticks of ``motion``, gets it in time."""
    other = make_reference(ekf)
    split = len(motion) - age_ticks
    carry(other, motion[:split])
    fix = float32(other.x[:3] + np.array([0.004, -0.003, 0.005]))
    assert ekf.correct(fix, age_ticks * TICK_US) == lib.OMNI_OK
    other.update(fix)
    carry(other, motion[split:])
    assert_same(ekf, other, mean_sd=5e-3, relative=5e-3)


MODES = pytest.mark.parametrize(("wheels", "mode"), [(3, POSE), (4, POSE), (3, SLIP), (4, SLIP)])


@MODES
def test_equals_filterpy_without_delay(wheels: int, mode: int) -> None:
    ekf = Ekf(wheels, mode)
    n = ekf.states
    noise = reference.Noise()

    class Ours(ExtendedKalmanFilter):  # type: ignore[misc]
        def predict_x(self, u: Any = 0) -> None:
            self.x: Array = reference.move(GEOMETRY[wheels], self.x, u)

    kf = Ours(n, 3)
    kf.x = np.zeros(n)
    kf.P = np.diag([1e-4, 1e-4, 1e-4, *[0.0064] * (n - 3)])
    kf.R = np.diag([noise.r_xy, noise.r_xy, noise.r_theta])
    kf.Q = np.diag([noise.q_xy, noise.q_xy, noise.q_theta, *[noise.q_slip] * (n - 3)])
    rng = np.random.default_rng(1)
    motion = drive(wheels, 1200, 2)
    truth = np.concatenate([np.zeros(3), np.full(n - 3, 0.03)])
    for tick, turned in enumerate(motion):
        truth = reference.move(GEOMETRY[wheels], truth, turned)
        kf.F = reference.jacobian(GEOMETRY[wheels], kf.x, turned)
        kf.Q[3:, 3:] *= 0 if tick == 0 else 1
        kf.predict(u=turned)
        kf.Q[3:, 3:] = np.eye(n - 3) * noise.q_slip
        ekf.predict(turned)
        ekf.config.p_slip = 0.25
        if tick % 20 == 19:
            fix = float32(truth[:3] + rng.normal(0, 0.005, 3))
            kf.update(fix, lambda x: np.eye(3, n), lambda x: x[:3])
            assert ekf.correct(fix) == lib.OMNI_OK
            kf.p = kf.P
            assert_same(ekf, kf, mean_sd=1e-4, relative=1e-5)
            np.testing.assert_allclose(ekf.s.nis, kf.y @ np.linalg.solve(kf.S, kf.y), rtol=2e-3, atol=1e-4)


@pytest.mark.full
@MODES
@pytest.mark.reference
@pytest.mark.parametrize("delay", [(0, 1), (4, 5), (20, 21), (13, 60), (180, 250)])
def test_late_fixes_equal_a_filter_that_replays(wheels: int, mode: int, delay: tuple[int, int]) -> None:
    ekf = Ekf(wheels, mode)
    replay = reference.Replay(make_reference(ekf))
    quiet = reference.Noise(q_slip=0.0)
    rng = np.random.default_rng(3)
    motion = drive(wheels, 1500, 4)
    truth = np.concatenate([np.zeros(3), rng.normal(0, 0.04, ekf.states - 3)])
    arrivals: dict[int, tuple[Array, int]] = {}
    last = 0
    for tick, turned in enumerate(motion):
        truth = reference.move(GEOMETRY[wheels], truth, turned)
        ekf.predict(turned)
        ekf.config.p_slip = 0.25
        if tick == 0:
            replay.past.noise = quiet
            replay.past.predict(turned)
            replay.past.noise = reference.Noise()
        else:
            replay.predict(turned)
        if tick % 20 == 10:
            last = max(last + 1, tick + int(rng.integers(*delay)))
            arrivals[last] = float32(truth[:3] + rng.normal(0, 0.005, 3)), tick
        if tick in arrivals:
            fix, taken = arrivals.pop(tick)
            assert ekf.correct(fix, (tick - taken) * TICK_US) == lib.OMNI_OK
            replay.update(fix, tick - taken)
            # Both linearise, at slightly different states; that grows with the motion since the fix.
            tolerance = 1e-3 if delay[1] < 100 else 5e-3
            assert_same(ekf, replay.now(), mean_sd=tolerance, relative=tolerance)
    assert ekf.s.accepted > 50
    assert ekf.s.refused == 0


def test_fix_between_ticks_is_interpolated() -> None:
    ekf, other = Ekf(), Ekf()
    turned = drive(3, 200, 5)
    for row in turned:
        ekf.predict(row)
        other.predict(row)
    fix = (0.01, 0.02, 0.03)
    assert ekf.correct(fix, 20_500) == lib.OMNI_OK
    low, high = Ekf(), Ekf()
    for row in turned:
        low.predict(row)
        high.predict(row)
    low.correct(fix, 20_000)
    high.correct(fix, 21_000)
    np.testing.assert_allclose(ekf.x, (low.x + high.x) / 2, atol=2e-7)


def test_heading_innovation_is_wrapped() -> None:
    ekf = Ekf(gate=25.0, pose=(0, 0, 3.1))
    spin = np.full(3, 0.2632 / 0.0508) * 1e-3
    heading = 3.1
    for tick in range(6500):
        ekf.predict(spin)
        heading += 1e-3
        if tick % 20 == 0:
            shown = heading + (2 * math.pi * (tick % 3 - 1))
            assert ekf.correct((0, 0, shown)) == lib.OMNI_OK
            assert ekf.s.nis < 0.1
    assert -math.pi <= ekf.s.pose.theta < math.pi
    assert reference.wrap(ekf.s.pose.theta - heading) == pytest.approx(0.0, abs=1e-5)


def test_outliers_are_refused_and_persistent_ones_restart() -> None:
    ekf = Ekf(3, SLIP, gate=25.0, gate_restart=5)
    for row in drive(3, 400, 6):
        ekf.predict(row)
    assert ekf.correct(ekf.x[:3]) == lib.OMNI_OK
    ekf.predict([0.001] * 3)
    before = ekf.snapshot()
    assert ekf.correct((5.0, 0, 0)) == lib.OMNI_ERR_RANGE
    assert ekf.s.nis > 25.0
    assert ekf.snapshot() == before
    assert ekf.correct(ekf.x[:3]) == lib.OMNI_OK
    assert ekf.s.consecutive_refusals == 0
    for attempt in range(5):
        ekf.predict([0.001] * 3, 20)
        here = (5.0, 1.0, 2.0 + 0.02 * 0.0508 / 0.2632 * attempt)
        result = ekf.correct(here)
        assert result == (lib.OMNI_OK if attempt == 4 else lib.OMNI_ERR_RANGE)
    assert ekf.s.restarts == 1
    np.testing.assert_allclose(ekf.x[:3], here, atol=1e-5)
    np.testing.assert_array_equal(ekf.x[3:], 0.0)
    assert ekf.p[0, 0] == pytest.approx(25e-6, rel=1e-3)
    assert ekf.p[3, 3] == pytest.approx(0.0064)


def test_restart_from_a_late_fix_carries_it_to_now() -> None:
    ekf = Ekf(gate=25.0, gate_restart=1)
    forward = np.array(GEOMETRY[3].matrix @ [0.5, 0, 0]) / 0.0508 * 1e-3
    ekf.predict(forward, 400)
    assert ekf.correct((3.0, 0.0, math.pi / 2), 100_000) == lib.OMNI_OK
    np.testing.assert_allclose(ekf.x, [3.0, 0.05, math.pi / 2], atol=1e-5)


def test_unusable_fixes_change_nothing() -> None:
    ekf = Ekf(gate=25.0)
    assert ekf.correct((0, 0, 0)) == lib.OMNI_ERR_TIME
    ekf.predict([0.001, 0.002, -0.001], 500)
    here = tuple(ekf.x)
    before = ekf.snapshot()
    assert ekf.correct((math.nan, 0, 0)) == lib.OMNI_ERR_NOT_FINITE
    assert ekf.correct((0, math.inf, 0)) == lib.OMNI_ERR_NOT_FINITE
    assert ekf.correct(here, sd=(math.nan, 0.0)) == lib.OMNI_ERR_NOT_FINITE
    assert ekf.correct((3e38, 0, 0)) == lib.OMNI_ERR_NOT_FINITE  # its distance squared overflows
    assert ekf.correct(here, -6_000) == lib.OMNI_ERR_TIME
    assert ekf.correct(here, 300_000) == lib.OMNI_ERR_TIME
    assert ekf.snapshot() == before
    assert ekf.s.refused == 7
    assert ekf.s.consecutive_refusals == 0
    assert ekf.correct(here, -4_000) == lib.OMNI_OK
    assert ekf.correct(here) == lib.OMNI_ERR_TIME  # not newer than the last one
    assert (ekf.s.accepted, ekf.s.refused) == (1, 8)


def test_fix_brings_its_own_accuracy() -> None:
    sharp, blunt = Ekf(), Ekf()
    for ekf, sd in ((sharp, (0.001, 0.002)), (blunt, (0.1, 0.2))):
        ekf.predict([0.0] * 3)
        assert ekf.correct((0.01, 0.0, 0.01), sd=sd) == lib.OMNI_OK
    assert sharp.x[0] == pytest.approx(0.01 * 1e-4 / (1e-4 + 1e-6), rel=1e-3)
    assert blunt.x[2] == pytest.approx(0.01 * 1e-4 / (1e-4 + 0.04), rel=1e-3)


def test_dead_reckoning_loses_nothing_in_a_long_run() -> None:
    ekf = Ekf(mode=ODOMETRY)
    body = np.array([0.05, 0.0, 0.02]) * 1e-3
    turned = float32(GEOMETRY[3].matrix @ body / 0.0508)
    ticks = 300_000
    ekf.predict(turned, ticks)
    exact = GEOMETRY[3].inverse @ (0.0508 * turned)
    chord = math.sin(exact[2] / 2) / (exact[2] / 2)
    heading = exact[2] * ticks
    travelled = exact[0] * chord / exact[2]
    assert reference.wrap(ekf.s.pose.theta - heading) == pytest.approx(0.0, abs=3e-6)
    assert ekf.s.pose.x == pytest.approx(travelled * math.sin(heading), abs=2e-5)
    assert ekf.s.pose.y == pytest.approx(travelled * (1 - math.cos(heading)), abs=2e-5)
    assert ekf.correct((1, 1, 1)) == lib.OMNI_ERR_LOCKED
    assert ekf.p[2, 2] == pytest.approx(1e-4 + ticks * 1.6e-8, rel=2e-2)


@pytest.mark.parametrize("mode", [POSE, SLIP])
@pytest.mark.parametrize("delay", [0, 20, 100])
def test_innovations_are_as_large_as_the_filter_says(mode: int, delay: int) -> None:
    """Mean NIS over many fixes lies in the 95 % band of its chi-square distribution."""
    noise = reference.Noise()
    rng = np.random.default_rng(11)
    ekf = Ekf(3, mode, noise)
    n = ekf.states
    start_sd = np.sqrt([1e-4, 1e-4, 1e-4, *[0.0064] * (n - 3)])
    truth = rng.normal(0, 1, n) * start_sd * np.array([1, 1, 1, *[0.5] * (n - 3)])
    step_sd = np.sqrt([noise.q_xy, noise.q_xy, noise.q_theta, *[noise.q_slip * 0.0] * (n - 3)])
    ekf.config.q_slip = 0.0
    poses = []
    nis = []
    for tick, turned in enumerate(drive(3, 12_000, 12)):
        truth = reference.move(GEOMETRY[3], truth, turned) + rng.normal(0, 1, n) * step_sd
        poses.append(truth[:3])
        ekf.predict(turned)
        if tick % 20 == 19 and tick >= delay:
            fix = poses[tick - delay] + rng.normal(0, 0.005, 3)
            assert ekf.correct(fix, delay * TICK_US) == lib.OMNI_OK
            nis.append(ekf.s.nis)
    low, high = stats.chi2.ppf([0.025, 0.975], 3 * len(nis)) / len(nis)
    assert low < np.mean(nis) < high


@pytest.mark.parametrize("wheels", [3, 4])
def test_covariance_stays_symmetric_and_positive(wheels: int) -> None:
    ekf = Ekf(wheels, SLIP, r_null=6.6e-11)
    rng = np.random.default_rng(13)
    block = drive(wheels, 2000, 14)
    for tick in range(40_000):
        ekf.predict(block[tick % 2000])
        if tick % 20 == 0 and tick > 200:
            ekf.correct(ekf.x[:3] + rng.normal(0, 0.002, 3), 20_000)
        if tick % 500 == 0:
            p = ekf.p
            np.testing.assert_array_equal(p, p.T)
            sd = np.sqrt(np.diag(p))
            assert np.linalg.eigvalsh(p / np.outer(sd, sd)).min() > 0.0


def test_slip_of_a_wheel_at_rest_does_not_drift() -> None:
    ekf = Ekf(3, SLIP)
    rng = np.random.default_rng(15)
    sideways = float32([0.0, -0.003, 0.003])
    for tick in range(4000):
        ekf.predict(sideways)
        if tick % 20 == 0:
            ekf.correct(ekf.x[:3] + rng.normal(0, 0.005, 3))
    assert ekf.s.error_state[0] == 0.0
    assert ekf.p[3, 3] == np.float32(0.0064)
    assert ekf.p[4, 4] < 0.0064


def test_slip_covariance_is_bounded_without_fixes() -> None:
    ekf = Ekf(4, SLIP, r_null=6.6e-11)
    for row in np.tile(drive(4, 2000, 16), (10, 1)):
        ekf.predict(row)
    assert np.diag(ekf.p)[3:].max() <= 0.0064 * 1.001
    resting = np.diag(ekf.p)[3:].copy()
    ekf.predict([0.0] * 4, 5000)
    np.testing.assert_allclose(np.diag(ekf.p)[3:], resting, rtol=1e-5)


def test_slip_ratios_are_found_from_fixes() -> None:
    ekf = Ekf(3, SLIP)
    rng = np.random.default_rng(17)
    slip = np.array([0.08, -0.03, 0.05])
    truth = np.concatenate([np.zeros(3), slip])
    for tick, turned in enumerate(drive(3, 30_000, 18)):
        truth = reference.move(GEOMETRY[3], truth, turned)
        ekf.predict(turned)
        if tick % 20 == 0:
            ekf.correct(truth[:3] + rng.normal(0, 0.005, 3))
    sd = np.sqrt(np.diag(ekf.p))[3:]
    assert np.all(np.abs(ekf.x[3:] - slip) < 4 * sd)
    assert sd.max() < 0.04


def test_reset_and_mode_change_leave_no_slip_behind() -> None:
    ekf = Ekf(3, SLIP)
    ekf.predict([0.003, -0.001, 0.002], 300)
    ekf.correct(ekf.x[:3] + 0.01)
    assert np.abs(ekf.x[3:]).max() > 0.0
    ekf.config.mode = POSE
    ekf.predict([0.003, -0.001, 0.002])
    assert [ekf.s.error_state[i] for i in range(4)] == [0.0] * 4
    assert all(ekf.s.p[a][b] == 0.0 for a in range(7) for b in range(3, 7))
    ekf.config.mode = SLIP
    ekf.predict([0.003, -0.001, 0.002])
    assert ekf.p[3, 3] == np.float32(0.0064)
    lib.omni_pose_ekf_reset(ekf.s, ekf.config, ffi.new("omni_pose_t *", (1, 2, 3)), 0.0, 0.0)
    assert [ekf.s.error_state[i] for i in range(4)] == [0.0] * 4
    assert ekf.s.accepted == 0
    np.testing.assert_allclose(ekf.x[:3], [1, 2, 3])


def test_motion_that_is_not_finite_counts_as_none() -> None:
    ekf = Ekf(3, SLIP)
    ekf.predict([0.001] * 3, 10)
    before = ekf.x
    ekf.predict([math.nan, 0.0, math.inf])
    np.testing.assert_array_equal(ekf.x, before)
    assert np.isfinite(ekf.p).all()


def test_a_longer_step_brings_more_noise() -> None:
    one, long = Ekf(), Ekf()
    one.predict([0.0] * 3, 11)
    long.predict([0.0] * 3)
    long.time_us += 9 * TICK_US
    long.predict([0.0] * 3)
    np.testing.assert_allclose(long.p, one.p, rtol=1e-6)
