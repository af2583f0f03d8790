# SPDX-License-Identifier: MIT
"""The report's models as plants, against independently written differential equations, integrated tightly by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from hil_sim.world import World
from omni_schema import Robot

Array = npt.NDArray[np.float64]
Imposed = Callable[[float, Array], Array]
"""Time in the hold and rolling speeds r w of the wheels to what slip leaves of them [m/s]."""

HOLD_TICKS = 50
HOLD_S = 0.05
HOLDS = 10
SLIP = {"slip_max": 0.1, "slip_speed_max_m_s": 0.03, "slip_time_s": HOLD_S}


def along_the_wheels(robot: Robot, heading: float) -> Array:
    """Return the corrected (21), n x 3: velocity in the frame at this heading to speeds along the wheels."""
    bearings = np.radians(robot.geometry["wheel_angle_deg"]) + heading
    arms = np.full(robot.wheels, robot.geometry["wheel_distance_m"])
    return np.column_stack([-np.sin(bearings), np.cos(bearings), arms])


def step_hold(world: World) -> Imposed:
    """Step one hold; return the slip that was imposed in it."""
    speed = world.slip_speed
    world.step(HOLD_TICKS)
    before, after = (np.array(list(column))[: world.wheels] for column in (world.c.slip_before, world.c.slip_after))

    def rolled(t: float, rolling_m_s: Array) -> Array:
        return np.asarray(rolling_m_s * (1.0 - before - t / HOLD_S * (after - before)) - speed)

    return rolled


def integrate(rates: Callable[[float, Array], Array], y: Array) -> Array:
    solution = solve_ivp(rates, (0.0, HOLD_S), y, method="LSODA", rtol=1e-10, atol=1e-12)
    assert solution.success
    return np.asarray(solution.y[:, -1])


def smooth_sign(value: Array, width: Array | float) -> Array:
    return np.asarray(value / np.hypot(value, width))


def motor_rates(robot: Robot, volts: Array, speed: Array, current: Array, load: Array) -> list[Array]:
    """(24), (25) with a load torque."""
    motor = robot.motor
    driving = motor["constant_N_m_A"] * current - motor["viscous_friction_N_m_s"] * speed - load
    drop = motor["resistance_ohm"] * current + motor["constant_N_m_A"] * speed
    return [driving / motor["inertia_kg_m2"], (volts - drop) / motor["inductance_H"]]


def test_kinematic(any_robot: Robot, make_world: Any) -> None:
    """(15)-(23): least squares of the wheels' speeds less slip."""
    world, rng = make_world(any_robot, plant="kinematic", **SLIP), np.random.default_rng(1)
    pose = np.zeros(3)
    for _ in range(HOLDS):
        speeds = rng.uniform(-10, 10, any_robot.wheels)
        world.drive_speed(speeds)
        imposed = step_hold(world)
        rolling = any_robot.geometry["wheel_radius_m"] * speeds

        def rates(t: float, y: Array, imposed: Imposed = imposed, rolling: Array = rolling) -> Array:
            return np.asarray(np.linalg.lstsq(along_the_wheels(any_robot, y[2]), imposed(t, rolling), rcond=None)[0])

        pose = integrate(rates, pose)
    assert np.allclose(world.truth, pose, atol=1e-6)


@pytest.mark.full
def test_kinematic_motors(any_robot: Robot, make_world: Any) -> None:
    """(24)-(27) with Coulomb friction and no load, then (15)-(23)."""
    world, rng = make_world(any_robot, plant="kinematic+motors", **SLIP), np.random.default_rng(2)
    n, radius = any_robot.wheels, any_robot.geometry["wheel_radius_m"]
    y = np.zeros(3 + 2 * n)
    for _ in range(HOLDS):
        volts = rng.uniform(-12, 12, n)
        world.drive_voltage(volts)
        imposed = step_hold(world)

        def rates(t: float, y: Array, imposed: Imposed = imposed, volts: Array = volts) -> Array:
            pose, speed, current = np.split(y, [3, 3 + n])
            friction = world.c.config.motor_coulomb_N_m * smooth_sign(speed, 0.01)
            velocity = np.linalg.lstsq(along_the_wheels(any_robot, pose[2]), imposed(t, radius * speed), rcond=None)[0]
            return np.concatenate([velocity, *motor_rates(any_robot, volts, speed, current, friction)])

        y = integrate(rates, y)
    pose, speed, current = np.split(y, [3, 3 + n])
    assert np.allclose(world.truth, pose, atol=2e-4 * np.abs(pose).max())
    assert np.allclose(world.wheel_rad_s, speed, atol=1e-3 * np.abs(speed).max())
    assert np.allclose(list(world.c.current_A)[:n], current, atol=1e-3 * np.abs(current).max())


@pytest.mark.full
@pytest.mark.parametrize("source", ["voltage", "torque"])
def test_slip(any_robot: Robot, make_world: Any, source: str) -> None:
    """(6), (7) with traction from creep; (24), (25) where voltages drive."""
    world, rng = make_world(any_robot, plant="slip", friction_coefficient=0.3, **SLIP), np.random.default_rng(3)
    n, radius, simulation = any_robot.wheels, any_robot.geometry["wheel_radius_m"], any_robot.simulation
    mass = np.array([simulation["mass_kg"], simulation["mass_kg"], simulation["inertia_kg_m2"]])
    limit = 0.3 * mass[0] * 9.80665 / n
    y = np.zeros(6 + 2 * n)
    for _ in range(HOLDS):
        values = rng.uniform(-12, 12, n) if source == "voltage" else rng.uniform(-0.3, 0.3, n)
        (world.drive_voltage if source == "voltage" else world.drive_torque)(values)
        imposed = step_hold(world)

        def rates(t: float, y: Array, imposed: Imposed = imposed, values: Array = values) -> Array:
            pose, velocity, speed, current = np.split(y, [3, 6, 6 + n])
            b = along_the_wheels(any_robot, pose[2])
            wish = simulation["slip_stiffness_N_s_m"] * (imposed(t, radius * speed) - b @ velocity)
            force = wish / np.hypot(1.0, wish / limit)
            if source == "voltage":
                wheels = motor_rates(any_robot, values, speed, current, radius * force)
            else:
                wheels = [(values - radius * force) / any_robot.motor["inertia_kg_m2"], np.zeros(n)]
            return np.concatenate([velocity, b.T @ force / mass, *wheels])

        y = integrate(rates, y)
    pose, velocity, speed, _ = np.split(y, [3, 6, 6 + n])
    assert np.allclose(world.truth, pose, atol=1e-3 * np.abs(pose).max())
    assert np.allclose(world.twist, velocity, atol=1e-3 * np.abs(velocity).max())
    assert np.allclose(world.wheel_rad_s, speed, atol=1e-3 * np.abs(speed).max())


@pytest.mark.parametrize("source", ["voltage", "torque"])
def test_linear(any_robot: Robot, make_world: Any, source: str) -> None:
    """(14) in the body frame, wheels' inertia added, friction per direction as given."""
    viscous, coulomb = np.array([5.0, 8.0, 0.4]), np.array([1.0, 2.0, 0.1])
    friction = {"linear_viscous": viscous.tolist(), "linear_coulomb": coulomb.tolist()}
    robot = Robot(**{**vars(any_robot), "simulation": {**any_robot.simulation, **friction}})
    world, rng = make_world(robot, plant="linear", **SLIP), np.random.default_rng(4)
    n, radius, simulation, motor = robot.wheels, robot.geometry["wheel_radius_m"], robot.simulation, robot.motor
    b = along_the_wheels(robot, 0.0)
    width = 0.01 * radius * np.array([1.0, 1.0, 1.0 / robot.geometry["wheel_distance_m"]])
    y = np.zeros(6)
    for _ in range(HOLDS):
        values = rng.uniform(-12, 12, n) if source == "voltage" else rng.uniform(-0.3, 0.3, n)
        (world.drive_voltage if source == "voltage" else world.drive_torque)(values)
        imposed = step_hold(world)

        def rates(t: float, y: Array, imposed: Imposed = imposed, values: Array = values) -> Array:
            pose, v = y[:3], y[3:]
            grip = imposed(t, np.ones(n)) - imposed(t, np.zeros(n))
            speed = (b @ v - imposed(t, np.zeros(n))) / (radius * grip)
            driving = values
            if source == "voltage":
                constant = motor["constant_N_m_A"]
                driving = constant * (values - constant * speed) / motor["resistance_ohm"]
            mass = np.diag([simulation["mass_kg"], simulation["mass_kg"], simulation["inertia_kg_m2"]])
            mass = mass + b.T @ np.diag(motor["inertia_kg_m2"] / (radius**2 * grip)) @ b
            force = b.T @ (driving / radius) - viscous * v - coulomb * smooth_sign(v, width)
            c, s = np.cos(pose[2]), np.sin(pose[2])
            return np.concatenate([[c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]], np.linalg.solve(mass, force)])

        y = integrate(rates, y)
    assert np.allclose(world.truth, y[:3], atol=1e-3 * np.abs(y[:3]).max())
    c, s = np.cos(y[2]), np.sin(y[2])
    expected = [c * y[3] - s * y[4], s * y[3] + c * y[4], y[5]]
    assert np.allclose(world.twist, expected, atol=1e-3 * np.abs(y[3:]).max())


def test_linear_friction_of_the_motors(any_robot: Robot, make_world: Any) -> None:
    """Without numbers of its own, (14) has the friction that the slip plant's motors make: the same steady spin."""
    quiet = {"motor_coulomb_N_m": 0.0, "roller_friction_N_s_m": 0.0}
    speeds = []
    for plant in ("slip", "linear"):
        world = make_world(any_robot, plant=plant, **quiet)
        world.drive_voltage([6.0] * any_robot.wheels)
        world.step(3000)
        speeds.append(world.twist[2])
    assert np.isclose(speeds[0], speeds[1], rtol=1e-6)
