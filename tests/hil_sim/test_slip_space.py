# SPDX-License-Identifier: MIT
"""(1)-(13): the (q, s) form of the slip-space model as a change of variables along paths of the plant slip.

The plant integrates momentum of body and wheels, which stays regular where v_w = 0. Here its trajectories are put into
the report's coordinates, where v_w is not 0, and have to satisfy the report's equations as corrected, not as printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hil_sim.world import World
from omni_schema import Robot

Array = npt.NDArray[np.float64]
STEP_US = 20
STEPS = 2000


@dataclass
class Path:
    """A trajectory: per sample pose (3), velocity (3), wheel speeds (n), torques (n)."""

    robot: Robot
    world: World
    pose: Array
    velocity: Array
    wheel: Array
    torque: Array

    def derivative(self, values: Array) -> Array:
        """Central differences, without the first and the last sample."""
        return np.asarray((values[2:] - values[:-2]) / (2e-6 * STEP_US))

    @property
    def config(self) -> Any:
        return self.world.c.config

    @property
    def radius(self) -> float:
        return float(self.robot.geometry["wheel_radius_m"])

    @property
    def inertia(self) -> float:
        return float(self.config.motor_inertia_kg_m2)

    @property
    def mass(self) -> Array:
        return np.diag([self.config.mass_kg, self.config.mass_kg, self.config.inertia_kg_m2])

    @property
    def r_matrix(self) -> Array:
        """R of (11), n x 3, with the robot's radius in the third column."""
        angles = np.radians(self.robot.geometry["wheel_angle_deg"])
        arm = np.full(len(angles), self.robot.geometry["wheel_distance_m"])
        return np.column_stack([-np.sin(angles), np.cos(angles), arm])

    def t_matrix(self, k: int) -> Array:
        c, s = np.cos(self.pose[k, 2]), np.sin(self.pose[k, 2])
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    def t_slope(self, k: int) -> Array:
        c, s = np.cos(self.pose[k, 2]), np.sin(self.pose[k, 2])
        return np.array([[-s, c, 0.0], [-c, -s, 0.0], [0.0, 0.0, 0.0]])

    @cached_property
    def ground(self) -> Array:
        """The wheels' ground speeds v_w of (11)."""
        return np.array([self.r_matrix @ self.t_matrix(k) @ self.velocity[k] for k in range(len(self.pose))])

    @cached_property
    def slip(self) -> Array:
        """The slip coordinates of (9)."""
        return np.asarray((self.radius * self.wheel - self.ground) / self.ground)

    def traction(self, k: int) -> Array:
        """The plant's f_t."""
        wish = self.config.slip_stiffness_N_s_m * (self.radius * self.wheel[k] - self.ground[k])
        limit = self.config.friction_coefficient * self.config.mass_kg * 9.80665 / self.robot.wheels
        return np.asarray(wish / np.hypot(1.0, wish / limit))


@pytest.fixture
def path(any_robot: Robot, make_world: Any) -> Path:
    """Accelerating and turning on a slippery floor, every v_w away from zero."""
    world = make_world(any_robot, plant="slip", motor_inertia_kg_m2=4e-3, friction_coefficient=0.2)
    for axis, value in enumerate((0.15, 0.1, 3.0)):
        world.c.twist[axis] = value
    torque = np.array([0.05, 0.03, 0.06, 0.02])[: any_robot.wheels]
    for wheel in range(any_robot.wheels):
        world.c.wheel_rad_s[wheel] = 12.0 + wheel
    world.drive_torque(torque)
    rows = []
    for _ in range(STEPS):
        rows.append((world.truth, world.twist, world.wheel_rad_s, torque))
        world.step(1, STEP_US)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    found = Path(any_robot, world, *columns)
    assert np.abs(found.ground).min() > 0.1
    assert np.ptp(found.slip) > 0.1
    return found


SAMPLES = range(200, STEPS - 1, 300)


def residual(got: Array, expected: Array) -> float:
    return float(np.abs(got - expected).max() / np.abs(expected).max())


def test_power_says_that_r_holds_the_robots_radius(path: Path) -> None:
    """(11): R T = Q', so that f_t . v_w is the power that the floor gives the body."""
    for k in SAMPLES:
        bearings = np.radians(path.robot.geometry["wheel_angle_deg"]) + path.pose[k, 2]
        arms = np.full(len(bearings), path.robot.geometry["wheel_distance_m"])
        q_matrix = np.array([-np.sin(bearings), np.cos(bearings), arms])
        assert np.allclose(path.r_matrix @ path.t_matrix(k), q_matrix.T)


def test_12_needs_the_heading_rate(path: Path) -> None:
    acceleration = path.derivative(path.velocity)
    measured = path.derivative(path.ground)
    for k in SAMPLES:
        steady = path.r_matrix @ path.t_matrix(k) @ acceleration[k - 1]
        slope = path.r_matrix @ path.t_slope(k) @ path.velocity[k]
        assert residual(steady + path.velocity[k, 2] * slope, measured[k - 1]) < 1e-3
        assert residual(steady + slope, measured[k - 1]) > 0.03, "as printed"


def right_side_of_13(path: Path, k: int, acceleration: Array, internal: bool) -> Array:
    """(r / I_w) (tau - M* q'' - N* q') with Q+ and r_w, without or with the traction that moves nothing."""
    grip = (path.inertia / path.radius) * (np.diag(path.slip[k]) + np.eye(path.robot.wheels)) @ path.r_matrix
    q_plus = np.linalg.pinv((path.r_matrix @ path.t_matrix(k)).T)
    m_star = path.radius * q_plus @ path.mass + grip @ path.t_matrix(k)
    n_star = grip @ (path.velocity[k, 2] * path.t_slope(k))
    torque = path.torque[k] - m_star @ acceleration - n_star @ path.velocity[k]
    if internal:
        force = path.traction(k)
        torque = torque - path.radius * (force - q_plus @ (path.r_matrix @ path.t_matrix(k)).T @ force)
    return np.asarray(path.radius / path.inertia * torque)


def test_13_is_a_change_of_variables(path: Path) -> None:
    """V_w s' = (r / I_w) (tau - M* q'' - N* q' - r (I - Q+ Q) f_t).

    Three wheels: Q is square and the last term is zero. Four: pushes of wheels against each other accelerate nothing,
    and the printed equation cannot know them.
    """
    acceleration, rate = path.derivative(path.velocity), path.derivative(path.slip)
    ground = path.ground
    for k in SAMPLES:
        left = ground[k] * rate[k - 1]
        assert residual(right_side_of_13(path, k, acceleration[k - 1], internal=True), left) < 2e-3
        closed = residual(right_side_of_13(path, k, acceleration[k - 1], internal=False), left)
        assert closed < 2e-3 if path.robot.wheels == 3 else closed > 0.01


def test_the_plant_passes_where_the_slip_coordinate_does_not_exist(any_robot: Robot, make_world: Any) -> None:
    """(9) divides by v_w. A robot that turns round on the spot has every v_w cross zero, and nothing happens there."""
    world = make_world(any_robot, plant="slip", motor_inertia_kg_m2=4e-3)
    world.drive_torque([0.05] * any_robot.wheels)
    world.c.twist[2] = -0.5
    distance, radius = any_robot.geometry["wheel_distance_m"], any_robot.geometry["wheel_radius_m"]
    for wheel in range(any_robot.wheels):
        world.c.wheel_rad_s[wheel] = -0.5 * distance / radius
    rates, spins = [], []
    for _ in range(1000):
        before = world.twist[2]
        world.step()
        rates.append((world.twist[2] - before) * 1e3)
        spins.append(world.twist[2])
    assert min(spins) < -0.3
    assert max(spins) > 0.1
    settled = np.array(rates[100:])
    assert np.ptp(settled) < 1e-6 * settled.mean(), "constant torque, constant angular acceleration, through zero"
