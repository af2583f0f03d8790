# SPDX-License-Identifier: MIT
"""A sensor of motion over the floor in the pose filter: against an EKF of NumPy's, and readings that cannot be true."""

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
BEARINGS = {3: np.deg2rad([0.0, 120.0, 240.0]), 4: np.deg2rad([45.0, 135.0, 225.0, 315.0])}
RADIUS_M, DISTANCE_M = 0.05, 0.25
SPAN, ARM, SD_M, SD_RAD = 20, (0.06, -0.04), 1e-4, 5e-5
"""Ticks from reading to reading; where the sensor is; its noise."""


class Core:
    """The core's filter and sensor, fed with wheel angles and readings."""

    def __init__(self, wheels: int = 3, mode: int = lib.OMNI_EKF_MODE_SLIP, axes: int = 3, angle: float = 0.0) -> None:
        geometry = ffi.new("omni_kinematics_config_t *")
        geometry.wheels = wheels
        for i in range(wheels):
            geometry.radius_m[i], geometry.distance_m[i] = RADIUS_M, DISTANCE_M
            geometry.angle_rad[i] = BEARINGS[wheels][i]
        self.k = ffi.new("omni_kinematics_t *")
        assert lib.omni_kinematics_init(self.k, geometry) == lib.OMNI_OK
        values = {"mode": mode, "q_xy": Q_XY, "q_theta": Q_THETA, "q_slip": Q_SLIP, "p_slip": P_SLIP, "r_xy": 25e-6}
        values |= {"r_theta": 25e-6, "gate_restart": 25, "step_s": TICK_S, "flow_gate": 16.3}
        self.config = ffi.new("omni_pose_ekf_config_t *", values)
        mount = {
            "axes": axes,
            "mount_cosine": math.cos(angle),
            "mount_sine": math.sin(angle),
            "scale": 1.0,
            "lever_arm_m": ARM,
        }
        self.mount = ffi.new(
            "omni_flow_config_t *", mount | {"r_xy": SD_M**2, "r_relative": 0.0, "r_turn": SD_RAD**2, "delay_us": 0}
        )
        self.s = ffi.new("omni_pose_ekf_state_t *")
        self.flow = ffi.new("omni_flow_state_t *")
        self.matrix = np.stack([-np.sin(BEARINGS[wheels]), np.cos(BEARINGS[wheels]), np.full(wheels, DISTANCE_M)], 1)
        self.wheels, self.time_us, self.usable = wheels, 0, True
        lib.omni_pose_ekf_reset(self.s, self.config, ffi.new("omni_pose_t *"), 0.01, 0.01)

    def predict(self, turned: Any) -> None:
        """One tick of the pose filter alone."""
        self.time_us += 1000
        lib.omni_pose_ekf_predict(self.s, self.config, self.k, ffi.new("float[4]", list(turned)), self.time_us)

    def measure(self, moved: Any, rows: int, age: int = 0, override_nis: float = 0.0) -> Any:
        """Correct by a reading of the last SPAN ticks before ``age`` ticks ago."""
        flow = {
            "move": list(moved),
            "lever_arm_m": ARM,
            "r_xy": SD_M**2,
            "r_turn": SD_RAD**2,
            "measures_turn": rows == 3,
        }
        flow |= {"apply": True, "age_us": 1000 * age, "span_us": 1000 * SPAN, "override_nis": override_nis}
        result = ffi.new("omni_ekf_flow_result_t *")
        assert lib.omni_pose_ekf_correct_flow(self.s, self.config, self.k, ffi.new("omni_ekf_flow_t *", flow), result)
        return result

    def tick(self, turned: Any, reading: Any = None, valid: int = 15) -> None:
        """One tick of filter and sensor; without a reading nothing has come."""
        self.predict(turned)
        told = {"time_us": self.time_us, "reading": ffi.new("float[3]", list(reading or (0.0, 0.0, 0.0)))}
        told |= {"valid": valid if reading is not None else 0, "interval_valid": True}
        given = ffi.new("omni_flow_tick_t *", told)
        self.usable = bool(lib.omni_flow_step(self.flow, self.mount, given, self.s, self.config, self.k))

    def correct(self, pose: Any, age: int = 0) -> int:
        fix = ffi.new("omni_pose_fix_t *", {"time_us": self.time_us - 1000 * age, "pose": list(pose)})
        return int(lib.omni_pose_ekf_correct(self.s, self.config, self.k, fix))

    @property
    def x(self) -> Array:
        return np.array([self.s.pose.x, self.s.pose.y, self.s.pose.theta, *list(self.s.error_state)[: self.wheels]])

    @property
    def p(self) -> Array:
        copy = ffi.new("omni_pose_ekf_state_t *", self.s[0])
        lib.omni_pose_ekf_propagate_covariance(copy, self.config, self.k)
        return np.array([list(row)[: 3 + self.wheels] for row in copy.p])[: 3 + self.wheels]


class Reference:
    """The same in float64, by stochastic cloning: the poses at both ends of a reading are states of their own.

    States: x, y, theta, a slip ratio per wheel, pose at the reading's start, pose at its end. Derivatives by complex
    step. It has no window, no history and no bookkeeping of noise.
    """

    def __init__(self, core: Core) -> None:
        self.core, self.inverse, self.n = core, np.linalg.pinv(core.matrix), core.wheels
        self.x = np.concatenate([core.x, np.zeros(6)])
        self.p = np.zeros((self.n + 9, self.n + 9))
        self.p[: self.n + 3, : self.n + 3] = core.p
        self.start, self.end = slice(self.n + 3, self.n + 6), slice(self.n + 6, self.n + 9)

    def clone(self, where: slice, source: slice = slice(0, 3)) -> None:
        copy = np.eye(len(self.x))
        copy[where] = copy[source]
        self.x, self.p = copy @ self.x, copy @ self.p @ copy.T

    def derivative(self, function: Any) -> Array:
        columns = []
        for i in range(len(self.x)):
            x = self.x.astype(complex)
            x[i] += 1e-30j
            columns.append(np.imag(function(x)) / 1e-30)
        return np.array(columns).T

    def move(self, x: Any, turned: Array) -> Any:
        body = self.inverse @ (RADIUS_M * turned * (1.0 - x[3 : 3 + self.n]))
        c, s = np.cos(x[2] + body[2] / 2), np.sin(x[2] + body[2] / 2)
        after = x.copy()
        after[:3] += [c * body[0] - s * body[1], s * body[0] + c * body[1], body[2]]
        return after

    def predict(self, turned: Array, slips: bool) -> None:
        f = self.derivative(lambda x: self.move(x, turned))
        known = np.diag(self.p)[3 : 3 + self.n] < P_SLIP
        noise = np.zeros(len(self.x))
        noise[:3] = Q_XY, Q_XY, Q_THETA
        noise[3 : 3 + self.n] = np.where(known & (turned != 0.0) & slips, Q_SLIP, 0.0)
        self.x = self.move(self.x, turned)
        self.p = f @ self.p @ f.T + np.diag(noise)

    def moved(self, x: Any) -> Any:
        """Way of the sensor's point between the two clones, in body axes of mid-way, and the turn."""
        a, b = x[self.start], x[self.end]
        arm = [
            np.array([np.cos(t) * ARM[0] - np.sin(t) * ARM[1], np.sin(t) * ARM[0] + np.cos(t) * ARM[1]])
            for t in (a[2], b[2])
        ]
        way = b[:2] + arm[1] - a[:2] - arm[0]
        c, s = np.cos((a[2] + b[2]) / 2), np.sin((a[2] + b[2]) / 2)
        return np.array([c * way[0] + s * way[1], c * way[1] - s * way[0], b[2] - a[2]])

    def measure(self, moved: Array, rows: int) -> float:
        h = self.derivative(self.moved)[:rows]
        s = h @ self.p @ h.T + np.diag([SD_M**2, SD_M**2, SD_RAD**2][:rows])
        y = (moved - self.moved(self.x))[:rows]
        self.update(h, s, y)
        return float(y @ np.linalg.solve(s, y))

    def correct(self, pose: Any) -> None:
        h = np.eye(3, len(self.x))
        self.update(h, h @ self.p @ h.T + np.eye(3) * 25e-6, np.asarray(pose) - self.x[:3])

    def update(self, h: Array, s: Array, y: Array) -> None:
        gain = self.p @ h.T @ np.linalg.inv(s)
        self.x = self.x + gain @ y
        self.p = (np.eye(len(self.x)) - gain @ h) @ self.p


def drive(core: Core, ticks: int, seed: int, slip_max: float = 0.1) -> tuple[Array, Array]:
    """Return wheel angles of smooth motion with slip, and the true poses."""
    rng = np.random.default_rng(seed)
    t = np.arange(ticks)[:, None] * TICK_S
    body = sum(
        rng.uniform(-1, 1, 3) * np.sin(2 * np.pi * rng.uniform(0.2, 1.0, 3) * t + rng.uniform(0, 6, 3))
        for _ in range(4)
    ) * np.array([0.2, 0.2, 0.5])
    turned = body @ core.matrix.T / RADIUS_M * TICK_S / (1.0 - rng.uniform(0.0, slip_max, core.wheels))
    moved = body * TICK_S + rng.normal(0.0, 1.0, (ticks, 3)) * np.sqrt([Q_XY, Q_XY, Q_THETA])
    theta = np.concatenate([[0.0], np.cumsum(moved[:, 2])])
    middle = 0.5 * (theta[1:] + theta[:-1])
    dx = np.cos(middle) * moved[:, 0] - np.sin(middle) * moved[:, 1]
    dy = np.sin(middle) * moved[:, 0] + np.cos(middle) * moved[:, 1]
    pose = np.stack([np.concatenate([[0.0], np.cumsum(d)]) for d in (dx, dy)] + [theta], 1)
    return turned.astype(np.float32).astype(np.float64), pose


def reading(other: Reference, pose: Array, first: int, last: int, rng: np.random.Generator) -> Array:
    """Return what the sensor says of the way from the one true pose to the other, in body axes."""
    x = np.zeros(len(other.x))
    x[other.start], x[other.end] = pose[first], pose[last]
    noise: Array = rng.normal(0.0, [SD_M, SD_M, SD_RAD])
    said: Array = np.asarray(other.moved(x) + noise, np.float32).astype(np.float64)
    return said


def close(core: Core, other: Reference, used: list[int], of_sd: float, of_p: float) -> None:
    sd = np.sqrt(np.diag(other.p))[used]
    np.testing.assert_array_less(np.abs(core.x[used] - other.x[used]), of_sd * sd)
    scale = np.outer(sd, sd)
    np.testing.assert_allclose(core.p[np.ix_(used, used)] / scale, other.p[np.ix_(used, used)] / scale, atol=of_p)


@pytest.mark.full
@pytest.mark.reference
@pytest.mark.parametrize("rows", [2, 3])
@pytest.mark.parametrize("mode", [lib.OMNI_EKF_MODE_POSE, lib.OMNI_EKF_MODE_SLIP])
@pytest.mark.parametrize(("wheels", "age", "offset"), [(3, 0, 0), (3, 8, 0), (4, 0, 0), (3, 7, 2)])
def test_the_correction_is_the_one_of_numpy(wheels: int, age: int, offset: int, mode: int, rows: int) -> None:
    """2.4 s with readings in a row, as late as ``age`` ticks, without pose fixes.

    The history has slots of four ticks. With an ``offset`` the readings begin and end inside of one, where the motion
    counts as even: that is off by some tens of um. What a slip ratio gathers of noise during a reading counts as older
    than it is: its variance is off by some per cent.
    """
    core, slips = Core(wheels, mode), mode == lib.OMNI_EKF_MODE_SLIP
    turned, pose = drive(core, 2400, seed=wheels + rows, slip_max=0.1 if slips else 0.0)
    for _ in range(4 - offset):
        core.predict(np.zeros(wheels))
    other = Reference(core)
    rng = np.random.default_rng(5)
    taken: list[Array] = []
    for tick in range(1, 2400):
        core.predict(turned[tick])
        other.predict(turned[tick], slips)
        if tick % SPAN == 0:
            other.clone(other.end)
            taken.append(reading(other, pose, tick + 1 - SPAN, tick + 1, rng))
        if tick % SPAN == age and tick > 2 * SPAN:
            theirs = math.sqrt(other.measure(taken[-1], rows))
            off = math.sqrt(core.measure(taken[-1], rows, age).nis) - theirs
            assert abs(off) < (0.15 if offset else 0.01)
        if tick % SPAN == age and tick > SPAN:
            other.clone(other.start, other.end)
    used = [0, 1, 2, *(range(3, 3 + wheels) if slips else ())]
    close(core, other, used, 0.05 if offset else 0.02, 0.06 if slips else 0.01)
    assert (np.linalg.eigvalsh(core.p[np.ix_(used, used)].astype(np.float64)) > 0.0).all()
    if slips and rows == 3 and wheels == 3:
        assert np.sqrt(np.diag(other.p))[3:6].max() < 0.25 * math.sqrt(P_SLIP), "the slip ratios are known"


def test_with_late_fixes_it_is_what_it_would_have_been_in_time() -> None:
    """A fix 60 ms late, across three readings: going back, fixing and repeating all is nearly the same."""
    core = Core(mode=lib.OMNI_EKF_MODE_POSE)
    turned, pose = drive(core, 700, seed=9, slip_max=0.0)
    for _ in range(4):
        core.predict(np.zeros(3))
    other = Reference(core)
    rng = np.random.default_rng(6)
    fix = None
    for tick in range(1, 661):
        core.predict(turned[tick])
        other.predict(turned[tick], slips=False)
        if tick % SPAN == 0:
            other.clone(other.end)
            taken = reading(other, pose, tick + 1 - SPAN, tick + 1, rng)
            if tick > SPAN:
                core.measure(taken, 3)
                other.measure(taken, 3)
            other.clone(other.start, other.end)
        if tick == 600:
            fix = np.float32(other.x[:3] + np.array([0.004, -0.003, 0.006])).astype(np.float64)
            other.correct(fix)
            other.clone(other.start)
    without = core.x
    assert core.correct(fix, age=60) == lib.OMNI_OK
    close(core, other, [0, 1, 2], 0.03, 0.02)
    assert np.abs(without - core.x)[0] > 0.3 * math.sqrt(other.p[0, 0]), "the fix does something"


def test_late_fixes_and_readings_together_keep_the_covariance_positive() -> None:
    core = Core()
    turned, pose = drive(core, 6000, seed=2)
    core.predict(np.zeros(3))
    other, rng = Reference(core), np.random.default_rng(1)
    errors = []
    for tick in range(1, 6000):
        core.predict(turned[tick])
        if tick % SPAN == 2 and tick > 2 * SPAN:
            core.measure(reading(other, pose, tick - 1 - SPAN, tick - 1, rng), 3, age=2)
        if tick % 33 == 0 and tick > 100:
            late = int(rng.integers(0, 90))
            core.correct(np.float32(pose[tick + 1 - late] + rng.normal(0.0, 0.001, 3)), late)
        assert np.linalg.eigvalsh(core.p.astype(np.float64)).min() > 0.0
        if tick > 1000 and tick % 50 == 0:
            off = core.x[:3] - pose[tick + 1]
            errors.append(off @ np.linalg.solve(core.p[:3, :3].astype(np.float64), off))
    assert 1.0 < float(np.mean(errors)) < 6.0  # 3 would be perfect


def straight(core: Core, speed: float, slip: float = 0.05) -> Array:
    """Return the wheel angles of a tick that drives along x, with slip."""
    angles: Array = core.matrix @ np.array([speed, 0.0, 0.0]) / RADIUS_M * TICK_S / (1.0 - slip)
    return angles


def run(core: Core, ticks: int, speed: float, said: Any = "true", slip: float = 0.05, valid: int = 15) -> list[bool]:
    """Drive straight on; return after each reading whether the sensor can be used."""
    rng = np.random.default_rng(core.time_us + 1)
    usable = []
    for _ in range(ticks):
        if (core.time_us // 1000) % SPAN != SPAN - 1:
            core.tick(straight(core, speed, slip))
            continue
        true = np.array([speed * SPAN * TICK_S, 0.0, 0.0]) + rng.normal(0.0, [SD_M, SD_M, SD_RAD])
        core.tick(straight(core, speed, slip), list(true) if isinstance(said, str) else said, valid)
        usable.append(core.usable)
    return usable


def test_it_learns_the_slip_of_the_wheels_and_where_the_robot_is() -> None:
    core = Core()
    assert all(run(core, 4000, 0.5))
    assert core.flow.readings_used > 180
    assert core.x[0] == pytest.approx(0.5 * 4.0 * 1.0, abs=0.006)  # the first 0.14 s were compared only
    slip = core.x[4:6]  # the first wheel does not turn when the robot drives along x
    assert slip == pytest.approx([0.05, 0.05], abs=0.01)


@pytest.mark.parametrize(
    "said",
    [[math.nan, 0.0, 0.0], [0.01, -math.inf, 0.0], [0.01, 0.0, math.nan], [3e38, 3e38, 0.0], [2.0, 0.0, 0.0]],
    ids=["nan", "infinite", "turn nan", "overflow", "too far"],
)
def test_readings_that_cannot_be_true_are_refused_and_said(said: list[float]) -> None:
    core, alone = Core(), Core()
    run(core, 1000, 0.5)
    before = core.x.copy()
    used = core.flow.readings_used
    usable = run(core, 400, 0.5, said)
    assert not usable[-1]
    assert core.flow.readings_used == used
    assert np.isfinite(core.p).all()
    ways = [(core.x - before)[0]]
    run(alone, 400, 0.5, None, slip=0.0)
    ratio = (1.0 - core.x[4]) / 0.95
    assert ways[0] == pytest.approx(alone.x[0] * ratio, rel=1e-3), "the wheels alone count, with the slip that is known"
    assert all(run(core, lib.OMNI_FLOW_QUALIFY_AFTER * SPAN, 0.5))
    assert core.flow.readings_used == used, "it proves itself first"
    run(core, SPAN, 0.5)
    assert core.flow.readings_used == used + 1


@pytest.mark.parametrize(
    "valid", [0, 8, 11 & ~2, 15 & ~8], ids=["nothing", "marked invalid", "x alone", "not a reading"]
)
def test_drop_outs_leave_it_to_the_wheels_and_say_so_when_they_last(valid: int) -> None:
    core = Core()
    run(core, 1000, 0.5)
    used = core.flow.readings_used
    assert all(run(core, 160, 0.5, valid=valid))
    assert not run(core, 100, 0.5, valid=valid)[-1]
    assert core.flow.readings_used == used
    x = core.x[0]
    run(core, 1000, 0.5)
    assert core.x[0] - x == pytest.approx(0.5, abs=0.004)


def test_a_drop_out_takes_its_own_way_with_it() -> None:
    """The reading after it counts from the drop-out on: nothing is refused."""
    core = Core()
    run(core, 1000, 0.5)
    for _ in range(20):
        run(core, SPAN, 0.5, valid=8)
        run(core, 4 * SPAN, 0.5)
    assert core.flow.readings_rejected == 0
    assert core.x[0] == pytest.approx(0.5 * core.time_us * 1e-6, abs=0.01)


def test_one_outlier_is_refused_and_nothing_else() -> None:
    core, other = Core(), Core()
    for each in (core, other):
        run(each, 1000, 0.5)
    run(core, SPAN, 0.5, [0.013, 0.0, 0.0])
    run(other, SPAN, 0.5, None)
    assert core.usable
    assert core.flow.readings_rejected == 1
    assert core.x == pytest.approx(other.x, abs=1e-9)
    assert core.p == pytest.approx(other.p, rel=1e-6)


def test_a_stuck_sensor_is_noticed_and_stays_so_while_the_robot_stands() -> None:
    core = Core()
    run(core, 1000, 0.5)
    slip = core.x[3:]
    usable = run(core, 400, 0.5, [0.0, 0.0, 0.0])
    assert usable.index(False) <= 4, "two centimetres"
    assert core.x[3:] == pytest.approx(slip, abs=2e-3), "it has taught nothing"
    assert not any(run(core, 400, 0.0, [0.0, 0.0, 0.0]))
    assert run(core, 400, 0.5)[-1]


def test_zeros_of_a_robot_that_stands_or_creeps_are_fine() -> None:
    core = Core()
    run(core, 200, 0.3)
    assert all(run(core, 2000, 0.0, [0.0, 0.0, 0.0]))
    rng, kept = np.random.default_rng(3), 0.0
    for _ in range(100):  # 4 mm/s: 0.08 mm per reading, counted in steps of 0.3 mm
        kept += 0.004 * SPAN * TICK_S
        said = math.floor(kept / 3e-4) * 3e-4
        kept -= said
        assert all(run(core, SPAN, 0.004, [said, 0.0, rng.normal(0.0, SD_RAD)]))
    assert core.flow.readings_rejected == 0


def test_a_robot_that_stands_proves_nothing() -> None:
    core = Core()
    assert all(run(core, 2000, 0.0))
    assert core.flow.readings_used == 0
    run(core, 20 * SPAN, 0.5)
    assert core.flow.readings_used == 20 - lib.OMNI_FLOW_QUALIFY_AFTER


@pytest.mark.parametrize("angle", [math.pi / 2, math.pi, -math.pi / 2], ids=["left", "backwards", "right"])
def test_a_sensor_that_is_mounted_otherwise_is_noticed_and_right_once_it_is_told(angle: float) -> None:
    wrong, right = Core(), Core(angle=angle)
    way = 0.5 * SPAN * TICK_S
    said = [way * math.cos(angle), -way * math.sin(angle), 0.0]
    assert not any(run(wrong, 1000, 0.5, said)[-10:])
    assert wrong.flow.readings_used == 0
    assert all(run(right, 1000, 0.5, said))
    assert right.x[0] == pytest.approx(0.5, abs=0.006)


def test_another_floor_is_learned_after_a_while() -> None:
    """The wheels suddenly slip by 30 %: first refused, then believed."""
    core = Core()
    run(core, 2000, 0.5, slip=0.02)
    usable = run(core, 1000, 0.5, slip=0.3)
    assert usable[-1]
    assert core.x[4] == pytest.approx(0.3, abs=0.02)
    assert core.flow.readings_rejected >= lib.OMNI_FLOW_INFLATE_AFTER


def test_late_ticks_a_pause_and_another_mount_begin_anew() -> None:
    core = Core()
    run(core, 1000, 0.5)
    core.mount.scale = 1.01
    core.tick(straight(core, 0.5))
    assert core.flow.readings_used == 0
    run(core, 500, 0.5)
    assert core.flow.readings_used > 0
    core.time_us += 200000
    core.tick(straight(core, 0.5))
    assert core.flow.readings_used == 0


def test_with_a_gyro_the_turn_is_the_gyro_s() -> None:
    """Its bias and scale learn nothing from the floor, but everything stays positive."""
    core = Core()
    core.config.has_gyro, core.config.q_gyro, core.config.p_bias, core.config.p_scale = True, 2.5e-12, 1e-8, 2.5e-5
    lib.omni_pose_ekf_start_gyro(core.s, core.config)
    turn = ffi.new("omni_ekf_gyro_rate_t *", {"rate_rad_s": 0.5, "overrides_wheels": True, "at_rest": False})
    wheels = core.matrix @ np.array([0.4, 0.0, 0.5]) / RADIUS_M * TICK_S / 0.95
    for tick in range(3000):
        core.time_us += 1000
        turned = ffi.new("float[4]", list(wheels))
        lib.omni_pose_ekf_predict_gyro(core.s, core.config, core.k, turned, turn, core.time_us)
        if tick % SPAN == SPAN - 1 and tick > SPAN:
            said = [0.4 * SPAN * TICK_S - ARM[1] * 0.01, ARM[0] * 0.01, 0.2]
            assert core.measure(said, 3).within_gate, "its own turn is not looked at"
    p = np.array([list(row) for row in core.s.p])
    used = [0, 1, 2, 3, 4, 5, 7, 8]
    assert np.linalg.eigvalsh(p[np.ix_(used, used)]).min() > 0.0
    assert core.s.error_state[lib.OMNI_EKF_GYRO_BIAS] == 0.0
    assert core.s.error_state[lib.OMNI_EKF_GYRO_SCALE] == 0.0
    assert core.x[3:] == pytest.approx([0.05] * 3, abs=0.01)
