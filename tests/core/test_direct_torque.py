# SPDX-License-Identifier: MIT
"""Direct torque control against an independent plant: body and wheels with momentum, and a floor that may let go."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from omniwheel._core import ffi, lib

Array = NDArray[np.float64]
GRAVITY = 9.80665
ANGLES = {3: (0.0, 120.0, 240.0), 4: (45.0, 135.0, 225.0, 315.0)}
RADIUS_M, DISTANCE_M, MASS_KG, INERTIA, WHEEL_INERTIA = 0.034925, 0.195, 3.5, 0.05, 4.27e-5
ROLLING = 1e4


def rotation(theta: float) -> Array:
    """World to body."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


class Robot:
    """The controller with its config, and the plant: M v' = sum of wheel forces, I_w w' = tau - r f, |f| <= mu N."""

    def __init__(self, wheels: int = 4, mu: float = ROLLING, **options: Any) -> None:
        angles = np.radians(ANGLES[wheels])
        kinematics = ffi.new("omni_kinematics_config_t *")
        kinematics.wheels = wheels
        kinematics.radius_m = [RADIUS_M] * wheels
        kinematics.distance_m = [DISTANCE_M] * wheels
        kinematics.angle_rad = list(angles)
        self.k = ffi.new("omni_kinematics_t *")
        assert lib.omni_kinematics_init(self.k, kinematics) == lib.OMNI_OK
        self.config = ffi.new("omni_direct_torque_config_t *")
        values = {
            "mass_kg": MASS_KG,
            "inertia_kg_m2": INERTIA,
            "wheel_inertia_kg_m2": WHEEL_INERTIA,
            "kp": [5.0] * 3,
            "kd": [4.1] * 3,
            "step_s": 1e-3,
        }
        for name, value in (values | options).items():
            setattr(self.config, name, value)
        self.wheels = wheels
        self.directions = np.array([[-math.sin(a), math.cos(a), DISTANCE_M] for a in angles])
        self.grip_N = mu * MASS_KG * GRAVITY / wheels
        self.pose, self.twist, self.speed = np.zeros(3), np.zeros(3), np.zeros(wheels)
        self.terms = ffi.new("omni_control_terms_t *")
        self.factor = 1.0

    def reference(self, pose: Any, rate: Any = (0, 0, 0), acceleration: Any = (0, 0, 0)) -> Any:
        reference = ffi.new("omni_reference_t *")
        reference.pose = tuple(pose)
        reference.rate = tuple(rate)
        reference.acceleration = tuple(acceleration)
        return reference

    def torques(self, reference: Any) -> Array:
        torque = ffi.new("omni_real_t[4]")
        pose, rate = ffi.new("omni_pose_t *", tuple(self.pose)), ffi.new("omni_twist_t *", tuple(self.twist))
        self.factor = lib.omni_direct_torque_step(self.config, self.k, pose, rate, reference, torque, self.terms)
        floor = ffi.new("omni_twist_t *", tuple(rotation(self.pose[2]) @ self.twist))
        lib.omni_direct_torque_protect(self.config, self.k, floor, [*self.speed, 0.0], torque)
        return np.array([torque[i] for i in range(self.wheels)])

    def move(self, torque: Array, seconds: float = 1e-3, stiffness: float = 2000.0) -> None:
        """Advance; implicit in the stiff creep between rim and floor, wheel by wheel."""
        step = 2e-4
        for _ in range(round(seconds / step)):
            turn = rotation(self.pose[2])
            body = turn @ self.twist
            creep = RADIUS_M * self.speed - self.directions @ body
            damping = 1.0 + step * stiffness * (RADIUS_M**2 / WHEEL_INERTIA)
            creep = (creep + step * RADIUS_M * torque / WHEEL_INERTIA) / damping
            force = np.clip(stiffness * creep, -self.grip_N, self.grip_N)
            wrench = self.directions.T @ force
            self.speed = self.speed + step * (torque - RADIUS_M * force) / WHEEL_INERTIA
            self.twist = self.twist + step * turn.T @ (wrench / (MASS_KG, MASS_KG, INERTIA))
            self.pose = self.pose + step * self.twist


def rolling_acceleration(robot: Robot, torque: Array) -> Array:
    """World acceleration of the body while wheels roll, by solving body, wheels and constraint together."""
    n = robot.wheels
    turn = rotation(robot.pose[2])
    body = turn @ robot.twist
    turning = body[2] * np.array([body[1], -body[0], 0.0])
    # unknowns: a (3, world), f (n), wheel accelerations (n)
    matrix, right = np.zeros((3 + 2 * n, 3 + 2 * n)), np.zeros(3 + 2 * n)
    matrix[:3, :3] = np.diag([MASS_KG, MASS_KG, INERTIA])
    matrix[:3, 3 : 3 + n] = -turn.T @ robot.directions.T
    matrix[3 : 3 + n, 3 : 3 + n] = RADIUS_M * np.eye(n)
    matrix[3 : 3 + n, 3 + n :] = robot.config.wheel_inertia_kg_m2 * np.eye(n)
    right[3 : 3 + n] = torque
    matrix[3 + n :, :3] = -robot.directions @ turn
    matrix[3 + n :, 3 + n :] = RADIUS_M * np.eye(n)
    right[3 + n :] = robot.directions @ turning
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0][:3])


numbers = st.floats(-2.0, 2.0)
vectors = st.tuples(numbers, numbers, numbers)


@given(st.sampled_from([3, 4]), vectors, vectors, vectors, st.sampled_from([4.27e-5, 1e-3, 0.01]))
def test_the_law_gives_exactly_the_wanted_acceleration(
    wheels: int, pose: Any, twist: Any, acceleration: Any, wheel_inertia: float
) -> None:
    robot = Robot(wheels, wheel_inertia_kg_m2=wheel_inertia)
    robot.pose, robot.twist = np.array(pose), np.array(twist)
    torque = robot.torques(robot.reference((0.1, -0.2, 0.3), (0.3, 0.2, -0.1), acceleration))
    error = np.array([0.1, -0.2, 0.3]) - robot.pose
    error[2] = (error[2] + math.pi) % (2.0 * math.pi) - math.pi
    wanted = np.array(acceleration) + 5.0 * error + 4.1 * (np.array([0.3, 0.2, -0.1]) - robot.twist)
    np.testing.assert_allclose(rolling_acceleration(robot, torque), wanted, atol=2e-4)
    terms = robot.terms
    np.testing.assert_allclose([terms.equivalent[i] + terms.switching[i] for i in range(3)], wanted, atol=1e-4)


def test_four_wheels_do_not_work_against_each_other() -> None:
    robot = Robot(4)
    robot.pose = np.array([0.3, -0.2, 0.7])
    torque = robot.torques(robot.reference((0, 0, 0)))
    assert abs(torque @ (1.0, -1.0, 1.0, -1.0)) < 1e-6 * np.abs(torque).max()


@pytest.mark.parametrize("wheels", [3, 4])
def test_an_error_decays_as_the_gains_say(wheels: int) -> None:
    robot = Robot(wheels)
    start = np.array([0.02, -0.01, 0.03])
    robot.pose = start.copy()
    for tick in range(1500):
        robot.move(robot.torques(robot.reference((0, 0, 0))))
        if tick % 300 == 299:
            t = (tick + 1) * 1e-3
            a, b = 2.05, math.sqrt(5.0 - 2.05**2)
            left = math.exp(-a * t) * (math.cos(b * t) + a / b * math.sin(b * t))
            np.testing.assert_allclose(robot.pose, start * left, atol=1e-4)


def test_the_printed_signs_are_unstable_with_a_root_at_5_08() -> None:
    robot = Robot(4, kp=[-5.0] * 3, kd=[-4.1] * 3)
    robot.pose = np.array([1e-4, 0.0, 0.0])
    x = []
    for _ in range(1200):
        robot.move(robot.torques(robot.reference((0, 0, 0))))
        x.append(robot.pose[0])
    assert math.log(x[-1] / x[-201]) / 0.2 == pytest.approx(5.08, abs=0.1)


def run_away(robot: Robot, seconds: float = 2.0) -> tuple[float, float]:
    """Step of 1 m; return the fastest slip speed and the error left."""
    robot.pose = np.array([-1.0, 0.0, 0.0])
    slip = 0.0
    for _ in range(round(seconds * 1e3)):
        robot.move(robot.torques(robot.reference((0, 0, 0))))
        floor = robot.directions @ (rotation(robot.pose[2]) @ robot.twist)
        slip = max(slip, float(np.max(np.abs(RADIUS_M * robot.speed - floor))))
    return slip, float(np.abs(robot.pose[0]))


@pytest.mark.full
@pytest.mark.parametrize("wheels", [3, 4])
def test_on_ice_wheels_run_away_unless_slip_is_watched(wheels: int) -> None:
    free, _ = run_away(Robot(wheels, mu=0.05))
    watched, error = run_away(Robot(wheels, mu=0.05, slip_limit_m_s=0.2))
    assert free > 20.0
    assert watched < 0.35  # the limit and what a free wheel gains in a step
    assert error < 0.7  # and what grip there is still pulls


@pytest.mark.full
def test_a_known_grip_keeps_the_wheels_rolling() -> None:
    slip, error = run_away(Robot(4, mu=0.05, grip=0.04))
    assert slip < 0.01
    assert error < 0.7


def test_a_wheel_beyond_its_speed_is_braked_and_comes_back() -> None:
    robot = Robot(4, mu=0.0, slip_limit_m_s=0.1, wheel_limit_rad_s=8.0)
    robot.speed[:] = (40.0, -40.0, 5.0, 0.0)
    for _ in range(30):
        robot.move(robot.torques(robot.reference((0, 0, 0))))
    assert np.abs(RADIUS_M * robot.speed).max() < 0.11
    assert np.abs(robot.speed[3]) < 1e-3


def test_protection_leaves_alone_what_rolls() -> None:
    watched, free = Robot(3, slip_limit_m_s=0.1, wheel_limit_rad_s=30.0), Robot(3)
    for robot in (watched, free):
        robot.pose = np.array([0.1, 0.0, 0.1])
        for _ in range(400):
            robot.move(robot.torques(robot.reference((0, 0, 0))))
    np.testing.assert_array_equal(watched.pose, free.pose)


@pytest.mark.parametrize(
    ("slip_m_s", "torque_N_m", "factor"),
    [(0.02, 0.1, 1.0), (0.075, 0.1, 0.5), (0.075, 0.0, 1.0), (0.075, -0.1, 1.0), (0.2, 0.0, 0.0), (0.2, -1e-4, 0.0)],
)
def test_protection_tells_whether_it_had_to_act(slip_m_s: float, torque_N_m: float, factor: float) -> None:
    robot = Robot(3, slip_limit_m_s=0.1)
    torque = ffi.new("omni_real_t[4]", [torque_N_m] * 3 + [0.0])
    floor = ffi.new("omni_twist_t *")
    wheels = [slip_m_s / RADIUS_M] * 3 + [0.0]
    told = lib.omni_direct_torque_protect(robot.config, robot.k, floor, wheels, torque)
    assert told == pytest.approx(factor, abs=1e-5)
    assert (torque[0] == pytest.approx(torque_N_m * factor, abs=1e-6)) == (slip_m_s < 0.1)


@given(vectors, st.floats(0.001, 0.2))
def test_limits_keep_the_direction(acceleration: Any, limit: float) -> None:
    free, bound = Robot(3), Robot(3, torque_limit_N_m=limit)
    whole = free.torques(free.reference((0, 0, 0), acceleration=acceleration))
    cut = bound.torques(bound.reference((0, 0, 0), acceleration=acceleration))
    assert np.abs(cut).max() <= np.float32(limit)
    np.testing.assert_allclose(cut, whole * bound.factor, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_finite_gives_no_torque(bad: float) -> None:
    robot = Robot(3)
    assert not np.any(robot.torques(robot.reference((bad, 0, 0))))
    assert robot.factor == 0.0
    watched = Robot(3, slip_limit_m_s=0.1)
    watched.speed[1] = bad
    torque = watched.torques(watched.reference((1, 0.3, 0)))
    assert torque[1] == 0.0
    assert torque[2] != 0.0


def curve(dead: float = 0.1, points: Any = (0.3, 0.5, 0.65, 0.8), most: float = 4.0) -> Any:
    value = ffi.new("omni_torque_curve_t *")
    value.torque_max_N_m, value.deadband_duty, value.duty = most, dead, list(points)
    return value


@given(st.floats(-5.0, 5.0))
def test_the_curve_is_odd_and_its_inverse_inverts(torque: float) -> None:
    duty = lib.omni_torque_curve_duty(curve(), torque)
    assert lib.omni_torque_curve_duty(curve(), -torque) == -duty
    assert lib.omni_torque_curve_torque(curve(), duty) == pytest.approx(np.clip(torque, -4.0, 4.0), abs=2e-6)


def test_the_curve_goes_through_its_points_and_rises() -> None:
    shares = np.linspace(0.0, 1.0, 6)
    duties = [lib.omni_torque_curve_duty(curve(), 4.0 * share) for share in shares]
    np.testing.assert_allclose(duties, [0.0, 0.3, 0.5, 0.65, 0.8, 1.0], rtol=1e-6)
    assert lib.omni_torque_curve_duty(curve(), 0.04001) > 0.1  # the dead-band is crossed within a hundredth
    # From the dead-band's edge to the first point it is one straight line.
    straight = [lib.omni_torque_curve_duty(curve(), 4.0 * share) for share in (0.01, 0.05, 0.1, 0.15)]
    np.testing.assert_allclose(straight, 0.1 + 0.2 * np.array([0.01, 0.05, 0.1, 0.15]) / 0.2, rtol=1e-5)
    all_of_it = [lib.omni_torque_curve_duty(curve(), t) for t in np.linspace(-5, 5, 1001)]
    assert np.all(np.diff(all_of_it) >= 0.0)


@pytest.mark.parametrize(
    ("dead", "points", "bad"),
    [(0.3, (0.3, 0.5, 0.6, 0.8), 0), (0.1, (0.3, 0.2, 0.6, 0.8), 1), (0.0, (0.3, 0.5, 0.6, 1.0), 4)],
)
def test_a_curve_that_does_not_rise_is_refused(dead: float, points: Any, bad: int) -> None:
    point = ffi.new("int32_t *", -1)
    assert not lib.omni_torque_curve_is_valid(curve(dead, points), point)
    assert point[0] == bad
    assert lib.omni_torque_curve_is_valid(curve(), ffi.NULL)


def test_the_curve_digests_what_is_not_finite() -> None:
    assert lib.omni_torque_curve_duty(curve(), math.nan) == 0.0
    assert lib.omni_torque_curve_duty(curve(), -math.inf) == -1.0
    assert lib.omni_torque_curve_torque(curve(), math.nan) == 0.0
