# SPDX-License-Identifier: MIT
"""A gyro in the pose filter: against an EKF of NumPy's, and what it does with readings that cannot be true."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from omniwheel._core import ffi, lib

Array = NDArray[np.float64]
TICK_S = 1e-3
Q_XY, Q_THETA, Q_SLIP, P_SLIP = 2.25e-9, 1.6e-8, 4e-7, 0.0064
DENSITY, P_BIAS, P_SCALE = 5e-5, 0.02**2, 0.005**2
BEARINGS = {3: np.deg2rad([0.0, 120.0, 240.0]), 4: np.deg2rad([45.0, 135.0, 225.0, 315.0])}
RADIUS_M, DISTANCE_M = 0.05, 0.25
SKID_RAD = 0.3 * TICK_S / RADIUS_M
"""A wheel that skids by 0.3 m/s turns by so much more in a tick."""


class Filter:
    """The core's filter and gyro, fed with wheel angles and rates."""

    def __init__(self, wheels: int = 3, mode: int = lib.OMNI_EKF_MODE_SLIP, axis: int = 3) -> None:
        geometry = ffi.new("omni_kinematics_config_t *")
        geometry.wheels = wheels
        for i in range(wheels):
            geometry.radius_m[i], geometry.distance_m[i] = RADIUS_M, DISTANCE_M
            geometry.angle_rad[i] = BEARINGS[wheels][i]
        self.k = ffi.new("omni_kinematics_t *")
        assert lib.omni_kinematics_init(self.k, geometry) == lib.OMNI_OK
        values = {"mode": mode, "q_xy": Q_XY, "q_theta": Q_THETA, "q_slip": Q_SLIP, "p_slip": P_SLIP, "r_xy": 25e-6}
        values |= {"r_theta": 25e-6, "gate_restart": 25, "step_s": TICK_S, "has_gyro": True, "p_bias": P_BIAS}
        values |= {"q_gyro": DENSITY**2 * TICK_S, "p_scale": P_SCALE}
        self.config = ffi.new("omni_pose_ekf_config_t *", values)
        self.gyro_config = ffi.new("omni_gyro_config_t *", {"axis": axis, "scale": 1.0, "range_rad_s": 8.0})
        self.s = ffi.new("omni_pose_ekf_state_t *")
        self.gyro = ffi.new("omni_gyro_state_t *")
        self.matrix = np.stack([-np.sin(BEARINGS[wheels]), np.cos(BEARINGS[wheels]), np.full(wheels, DISTANCE_M)], 1)
        self.wheels, self.time_us = wheels, 0
        lib.omni_pose_ekf_reset(self.s, self.config, ffi.new("omni_pose_t *"), 0.01, 0.01)

    def predict(self, turned: Any, rate: float, leads: bool = True, rest: bool = False) -> None:
        """One tick of the pose filter alone."""
        turn = ffi.new("omni_ekf_gyro_rate_t *", {"rate_rad_s": rate, "overrides_wheels": leads, "at_rest": rest})
        self.time_us += 1000
        wheels = ffi.new("float[4]", list(turned))
        lib.omni_pose_ekf_predict_gyro(self.s, self.config, self.k, wheels, turn, self.time_us)

    def tick(
        self,
        body_rad_s: float,
        reading: float,
        valid: int = 7,
        axis: int = 3,
        driven: bool = True,
        speed_m_s: float = 0.0,
    ) -> bool:
        """One tick of gyro and pose filter, turning on the spot; return whether the readings can be used.

        ``speed_m_s`` is what the gyro's part is told of the wheels beside the turn.
        """
        readings = ffi.new("float[3]")
        readings[axis - 1] = reading
        values = {"time_us": self.time_us + 1000, "reading": readings, "valid": valid, "interval_valid": True}
        values |= {
            "duration_s": TICK_S,
            "wheel_yaw_rate_rad_s": body_rad_s,
            "wheels_still": body_rad_s == 0.0,
            "motors_driven": driven,
            "wheels_x_m_s": speed_m_s,
        }
        told = ffi.new("omni_gyro_tick_t *", values)
        usable = bool(lib.omni_gyro_step(self.gyro, self.gyro_config, told, self.s, self.config, self.k))
        turn = self.gyro.turn
        self.predict(
            [body_rad_s * DISTANCE_M / RADIUS_M * TICK_S] * self.wheels,
            turn.rate_rad_s,
            turn.overrides_wheels,
            turn.at_rest,
        )
        return usable

    def rest(self, bias: float = 0.004, seconds: float = 1.0, seed: int = 1) -> None:
        """Stand still, with the noise of the data sheet."""
        rng = np.random.default_rng(seed)
        for noise in rng.normal(0.0, DENSITY / math.sqrt(TICK_S), round(seconds / TICK_S)):
            assert self.tick(0.0, bias + noise)

    def correct(self, pose: Any, age_us: int = 0) -> int:
        fix = ffi.new("omni_pose_fix_t *", {"time_us": self.time_us - age_us, "pose": list(pose)})
        return int(lib.omni_pose_ekf_correct(self.s, self.config, self.k, fix))

    @property
    def x(self) -> Array:
        return np.array([self.s.pose.x, self.s.pose.y, self.s.pose.theta, *self.s.error_state])

    @property
    def p(self) -> Array:
        copy = ffi.new("omni_pose_ekf_state_t *", self.s[0])
        lib.omni_pose_ekf_propagate_covariance(copy, self.config, self.k)
        return np.array([list(row) for row in copy.p])

    @property
    def bias(self) -> tuple[float, float]:
        """Bias and its standard deviation."""
        return float(self.s.error_state[lib.OMNI_EKF_GYRO_BIAS]), math.sqrt(self.s.p[7][7])


class Reference:
    """The same in float64: derivatives by complex step, states x, y, theta, a slip ratio per wheel, bias, scale."""

    def __init__(self, core: Filter) -> None:
        self.core, self.inverse, self.n = core, np.linalg.pinv(core.matrix), core.wheels
        self.x = core.x
        self.p = core.p
        self.slot: list[tuple[Array, float]] = []
        self.apart, self.skids = 0.0, 0

    def move(self, x: Any, turned: Array, rate: float) -> Any:
        slip = x[3 : 3 + self.n]
        body = self.inverse @ (RADIUS_M * turned * (1.0 - slip))
        d_theta = (1.0 + x[8]) * (rate - x[7]) * TICK_S
        c, s = np.cos(x[2] + d_theta / 2), np.sin(x[2] + d_theta / 2)
        after = x.copy()
        after[0] += c * body[0] - s * body[1]
        after[1] += s * body[0] + c * body[1]
        after[2] += d_theta
        return after

    def derivative(self, function: Any, outputs: int) -> Array:
        columns = np.zeros((outputs, 9))
        for i in range(9):
            x = self.x.astype(complex)
            x[i] += 1e-30j
            columns[:, i] = np.imag(function(x)) / 1e-30
        return columns

    def predict(self, turned: Array, rate: float, slips: bool) -> None:
        f = self.derivative(lambda x: self.move(x, turned, rate), 9)
        known = np.diag(self.p)[3 : 3 + self.n] < P_SLIP
        noise = np.zeros(9)
        noise[:3] = Q_XY, Q_XY, DENSITY**2 * TICK_S
        noise[3 : 3 + self.n] = np.where(known & (turned != 0.0) & slips, Q_SLIP, 0.0)
        self.x = self.move(self.x, turned, rate)
        self.p = f @ self.p @ f.T + np.diag(noise)
        self.slot.append((turned, rate))
        if len(self.slot) == 4:
            if slips:
                self.compare()
            self.slot = []

    def compare(self) -> None:
        """Turn by the gyro less turn by the wheels is zero; the wheels' motion in it has the gyro's turn."""
        rolled = RADIUS_M * np.sum([turned for turned, _ in self.slot], axis=0)
        rate_s = TICK_S * sum(rate for _, rate in self.slot)

        def apart(x: Any, wheels: Array) -> Any:
            by_gyro = (1.0 + x[8]) * (rate_s - x[7] * len(self.slot) * TICK_S)
            return np.array([by_gyro - self.inverse[2] @ (wheels * (1.0 - x[3 : 3 + self.n]))])

        innovation = -apart(self.x, rolled)[0]
        h = self.derivative(lambda x: apart(x, rolled - self.core.matrix[:, 2] * innovation), 1)
        weight = (self.inverse[2] ** 2).sum()
        noise = max(len(self.slot) * (Q_THETA + DENSITY**2 * TICK_S), weight * self.core.config.r_count)
        variance = (h @ self.p @ h.T)[0, 0] + noise
        self.apart += 0.125 * (innovation - self.apart)
        if self.apart**2 > 0.3 * (variance + weight * self.core.config.r_null):
            self.skids += 1
            ratios = range(3, 3 + self.n)
            self.p[ratios, ratios] += np.where(np.diag(self.p)[ratios] < P_SLIP, 1e-5, 0.0)
        elif innovation**2 <= 25.0 * variance:
            gain = self.p @ h[0] / variance
            gain[7:] = 0.0  # wheels that slip teach nothing of the gyro: Schmidt's filter, in Joseph's form
            left = np.eye(9) - np.outer(gain, h[0])
            self.x = self.x + gain * innovation
            self.p = left @ self.p @ left.T + noise * np.outer(gain, gain)

    def correct(self, pose: Any) -> None:
        h = np.eye(3, 9)
        s = h @ self.p @ h.T + np.eye(3) * 25e-6
        gain = self.p @ h.T @ np.linalg.inv(s)
        self.x = self.x + gain @ (np.asarray(pose) - self.x[:3])
        self.p = (np.eye(9) - gain @ h) @ self.p


def drive(core: Filter, ticks: int, seed: int) -> tuple[Array, Array]:
    """Return wheel angles of smooth motion, with slip, and what a gyro with bias, scale error and noise says of it."""
    rng = np.random.default_rng(seed)
    t = np.arange(ticks)[:, None] * TICK_S
    body = sum(
        rng.uniform(-1, 1, 3) * np.sin(2 * np.pi * rng.uniform(0.2, 1.0, 3) * t + rng.uniform(0, 6, 3))
        for _ in range(4)
    ) * np.array([0.1, 0.1, 0.4])
    turned = body @ core.matrix.T / RADIUS_M * TICK_S / (1.0 - rng.uniform(0.0, 0.1, core.wheels))
    rate = body[:, 2] * 1.004 + 0.006 + rng.normal(0.0, DENSITY / math.sqrt(TICK_S), ticks)
    return turned.astype(np.float32).astype(np.float64), rate.astype(np.float32).astype(np.float64)


@pytest.mark.full
@pytest.mark.reference
@pytest.mark.parametrize("mode", [lib.OMNI_EKF_MODE_POSE, lib.OMNI_EKF_MODE_SLIP])
@pytest.mark.parametrize("wheels", [3, 4])
@pytest.mark.parametrize("counts_m2", [0.0, 4e-8], ids=["fine counts", "coarse counts"])
def test_the_filter_is_the_one_of_numpy(wheels: int, mode: int, counts_m2: float) -> None:
    """A wheel skids in between."""
    core = Filter(wheels, mode)
    core.config.r_count = counts_m2
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    slips = mode == lib.OMNI_EKF_MODE_SLIP
    turned, rate = drive(core, 3000, seed=wheels)
    turned[1500:1700, 1] += SKID_RAD
    core.predict(np.zeros(wheels), 0.0)
    other = Reference(core)
    for _ in range(3):  # the slot that the first tick began
        core.predict(np.zeros(wheels), 0.0)
        other.predict(np.zeros(wheels), 0.0, slips=False)
    other.slot = []
    other.x, other.p = core.x, core.p
    rng = np.random.default_rng(5)
    for tick in range(3000):
        core.predict(turned[tick], rate[tick])
        other.predict(turned[tick], rate[tick], slips)
        if tick % 50 == 49:
            fix = np.float32(other.x[:3] + rng.normal(0.0, 0.005, 3)).astype(np.float64)
            assert core.correct(fix) == lib.OMNI_OK
            other.correct(fix)
    used = [0, 1, 2, *(range(3, 3 + wheels) if slips else ()), 7, 8]
    sd = np.sqrt(np.diag(other.p))[used]
    np.testing.assert_array_less(np.abs(core.x - other.x)[used], 0.02 * sd)
    scale = np.outer(sd, sd)
    np.testing.assert_allclose(core.p[np.ix_(used, used)] / scale, other.p[np.ix_(used, used)] / scale, atol=5e-3)
    assert sd[-2] < 0.1 * math.sqrt(P_BIAS), "the fixes have taught the bias"
    assert (other.skids > 10) == slips


@pytest.mark.parametrize("age_ticks", [0, 3, 33, 120])
def test_late_fixes_are_exact_with_a_scale_other_than_one(age_ticks: int) -> None:
    """The gyro reads a sixth too little, the filter knows it, and the fixes are right: they have nothing to correct."""
    core = Filter(mode=lib.OMNI_EKF_MODE_POSE)
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    core.s.error_state[lib.OMNI_EKF_GYRO_SCALE] = 0.2
    core.s.p[8][8] = 1e-12
    core.predict(np.zeros(3), 0.0)
    body = np.array([0.4, 0.1, 1.5])
    pose, poses = np.zeros(3), []
    for tick in range(2000):
        core.predict(core.matrix @ body / RADIUS_M * TICK_S, body[2] / 1.2)
        c, s = math.cos(pose[2] + 0.5e-3 * body[2]), math.sin(pose[2] + 0.5e-3 * body[2])
        pose = pose + TICK_S * np.array([c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]])
        poses.append(pose)
        if tick % 25 == 24 and tick > age_ticks:
            before = core.x[2]
            assert core.correct(poses[tick - age_ticks], 1000 * age_ticks) == lib.OMNI_OK
            assert core.x[2] - before == pytest.approx(0.0, abs=2e-6)
    assert core.x[:2] == pytest.approx(pose[:2], abs=2e-5)


def turn_with_fixes(core: Filter, seconds: float, slip: Array, pose: Array, skid_rad: float = 0.0) -> Array:
    """Drive an arc with these slip ratios, with a fix each 0.1 s; wheel 1 turns by ``skid_rad`` too much each tick."""
    body = np.array([0.4, 0.1, 0.5])
    turned = core.matrix @ body / RADIUS_M * TICK_S / (1.0 - slip)
    turned[1] += skid_rad
    for tick in range(round(seconds / TICK_S)):
        core.predict(turned, body[2])
        c, s = math.cos(pose[2] + 0.5e-3 * body[2]), math.sin(pose[2] + 0.5e-3 * body[2])
        pose = pose + TICK_S * np.array([c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]])
        if not skid_rad and tick % 100 == 99:
            core.correct(pose)
    return pose


def test_wheels_that_skid_teach_no_slip_ratios() -> None:
    """0.3 s without a fix, and the gyro cannot tell which wheel it is."""
    core = Filter()
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    slip = np.array([0.02, 0.05, 0.08])
    pose = turn_with_fixes(core, 10.0, slip, np.zeros(3))
    before, sure = core.x[3:6], np.diag(core.p)[3:6]
    np.testing.assert_allclose(before, slip, atol=0.02)
    turn_with_fixes(core, 0.3, slip, pose, SKID_RAD)
    np.testing.assert_allclose(core.x[3:6], before, atol=0.03)
    assert (np.diag(core.p)[3:6] > sure + 4e-4).all(), "it is less sure of them"


def test_a_gyro_that_starts_over_has_nothing_in_common_with_the_pose() -> None:
    core = Filter()
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    turn_with_fixes(core, 1.0, np.array([0.02, 0.05, 0.08]), np.zeros(3))
    before = core.p
    assert (before[:6, 7] != 0.0).all()
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    own = np.diag([P_BIAS, P_SCALE])
    np.testing.assert_allclose(
        core.p, np.block([[before[:7, :7], np.zeros((7, 2))], [np.zeros((2, 7)), own]]), rtol=1e-6
    )


def test_slip_that_has_changed_for_good_is_learned_all_the_same() -> None:
    core = Filter()
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    slip = np.array([0.02, 0.05, 0.08])
    pose = turn_with_fixes(core, 10.0, slip, np.zeros(3))
    changed = np.array([0.02, 0.25, 0.08])
    turn_with_fixes(core, 5.0, changed, pose)
    assert np.abs(core.x[3:6] - changed).max() < 0.1, "more than half of it in five seconds"
    assert core.s.refused == 0


def test_a_late_fix_is_what_it_would_have_been_in_time() -> None:
    """Mode pose has no other measurement in between: going back and predicting anew is exact."""
    core = Filter(mode=lib.OMNI_EKF_MODE_POSE)
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    turned, rate = drive(core, 700, seed=9)
    core.predict(np.zeros(3), 0.0)
    other = Reference(core)
    for tick in range(700):
        core.predict(turned[tick], rate[tick])
        if tick < 600:
            other.predict(turned[tick], rate[tick], slips=False)
    fix = np.float32(other.x[:3] + np.array([0.004, -0.003, 0.006])).astype(np.float64)
    other.correct(fix)
    for tick in range(600, 700):
        other.predict(turned[tick], rate[tick], slips=False)
    assert core.correct(fix, age_us=100000) == lib.OMNI_OK
    used = [0, 1, 2, 7, 8]
    sd = np.sqrt(np.diag(other.p))[used]
    np.testing.assert_array_less(np.abs(core.x - other.x)[used], 0.02 * sd)
    scale = np.outer(sd, sd)
    np.testing.assert_allclose(core.p[np.ix_(used, used)] / scale, other.p[np.ix_(used, used)] / scale, atol=5e-3)


def test_rest_teaches_the_bias_as_well_as_the_noise_allows() -> None:
    off = []
    for seed in range(40):
        core = Filter()
        core.rest(bias=0.01, seconds=1.1, seed=seed)
        bias, sd = core.bias
        assert sd == pytest.approx(DENSITY, rel=0.1)  # 0.1 s to call it rest, 1 s to learn
        off.append((bias - 0.01) / sd)
    assert 0.6 < float(np.mean(np.square(off))) < 1.6
    assert abs(core.s.pose.theta) == 0.0


def test_it_leads_only_after_a_rest() -> None:
    core = Filter()
    for _ in range(500):
        core.tick(0.3, 0.31 + 1e-4 * (core.time_us % 7000))
        assert not core.gyro.turn.overrides_wheels
    core = Filter()
    core.rest()
    core.tick(0.3, 0.304)
    assert core.gyro.turn.overrides_wheels
    assert core.s.pose.theta == pytest.approx(0.3e-3, rel=1e-2)


def test_a_robot_that_is_carried_is_not_at_rest() -> None:
    core = Filter()
    core.rest()
    bias = core.bias[0]
    for tick in range(1000):
        core.tick(0.0, 0.504 + 1e-3 * (tick % 3 - 1))
    assert core.s.pose.theta == pytest.approx(0.5, rel=0.01)
    assert core.bias[0] == pytest.approx(bias, abs=1e-5)


def test_a_bias_that_has_jumped_is_learned_anew_after_half_a_minute() -> None:
    core = Filter()
    core.rest()
    for tick in range(32000):
        core.tick(0.0, 0.054 + 1e-3 * (tick % 3 - 1))
    assert core.bias[0] == pytest.approx(0.054, abs=1e-4)
    assert core.gyro.turn.at_rest


@pytest.mark.parametrize(
    ("reading", "valid"),
    [(math.nan, 7), (math.inf, 7), (8.0, 7), (-9.0, 7), (0.304, 3), (0.304, 0)],
    ids=["nan", "infinite", "saturated", "beyond", "another axis alone", "silent"],
)
def test_readings_that_cannot_be_true_leave_it_to_the_wheels(reading: float, valid: int) -> None:
    core = Filter()
    core.rest()
    for tick in range(200):
        core.tick(0.3, 0.304 + 1e-3 * (tick % 3 - 1))
    for _ in range(30):
        usable = core.tick(0.3, reading, valid)
    assert not usable
    assert not core.gyro.turn.overrides_wheels
    before = core.s.pose.theta
    core.tick(0.3, reading, valid)
    assert core.s.pose.theta - before == pytest.approx(0.3e-3, rel=0.02)
    good = [core.tick(0.3, 0.304 + 1e-3 * (tick % 3 - 1)) for tick in range(120)]
    assert good.index(True) == lib.OMNI_GYRO_GOOD_SAMPLES - 1
    assert core.gyro.turn.overrides_wheels
    assert np.isfinite(core.x).all()
    assert np.isfinite(core.p).all()


def test_a_stuck_gyro_is_noticed_and_a_short_gap_is_not() -> None:
    core = Filter()
    core.rest()
    used = [core.tick(0.3, 0.31) for _ in range(150)]
    assert used.index(False) == lib.OMNI_GYRO_STUCK_SAMPLES
    core = Filter()
    core.rest()
    for tick in range(400):  # 100 Hz: held for ten ticks
        assert core.tick(0.3, 0.304 + 1e-3 * (tick % 30 - 15), 7 if tick % 10 == 0 else 0)
    assert core.gyro.turn.overrides_wheels


@pytest.mark.parametrize(("axis", "factor"), [(-3, 1.0), (3, 0.0), (3, 0.2), (3, 3.0)], ids=str)
def test_a_wrong_sign_axis_or_scale_is_noticed_and_its_turn_taken_back(axis: int, factor: float) -> None:
    core = Filter(axis=axis)
    for tick in range(1100):
        core.tick(0.0, 0.004 + 1e-4 * (tick % 3 - 1), axis=3)
    turned = 0.0
    for tick in range(2000):  # a turn of one radian
        usable = core.tick(0.5, 0.004 + factor * 0.5 + 1e-3 * (tick % 3 - 1), axis=3)
        turned += 0.5e-3
    assert not usable
    assert core.gyro.rejected
    assert core.s.pose.theta == pytest.approx(turned, abs=0.02)
    for tick in range(1000):
        core.tick(0.0, 0.004 + 1e-4 * (tick % 3 - 1), axis=3)
    assert core.gyro.rejected, "it is not tried again"
    core.gyro_config.axis = 1
    core.tick(0.0, 0.004)
    assert not core.gyro.rejected


def test_clock_steps_and_no_time_leave_everything_finite() -> None:
    core = Filter()
    core.rest()
    core.time_us -= 1000  # the next tick has the time of the last
    for _ in range(8):
        core.tick(0.3, 0.304)
        core.time_us -= 1000
    assert np.isfinite(core.p).all()
    assert (np.linalg.eigvalsh(core.p[:3, :3]) > 0.0).all()
