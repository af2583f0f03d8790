# SPDX-License-Identifier: MIT
"""The plant against an independently written differential equation, integrated tightly by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from hil_sim.world import World
from omni_schema import Robot

Array = npt.NDArray[np.float64]

pytestmark = pytest.mark.reference

TICKS = 1000
HOLD_TICKS = 40
STEPS = 4096


def cross(a: Array, b: Array) -> Array:
    """Return the cross product; NumPy's own is ten times slower for two single vectors."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@dataclass
class Reference:
    """World-frame dynamics in three dimensions: forces and moments as cross products.

    State: position (2), heading, velocity (2), turn rate, wheel angles, wheel speeds, currents.
    """

    robot: Robot
    battery_V: float
    slip: Callable[[float], Array]

    def unpack(self, y: Array) -> dict[str, Array]:
        n = self.robot.wheels
        split = np.split(y, [2, 3, 5, 6, 6 + n, 6 + 2 * n])
        return dict(zip(["position", "heading", "velocity", "turn", "angle", "speed", "current"], split, strict=True))

    def __call__(self, t: float, y: Array, duty: Array) -> Array:
        robot, motor = self.robot, self.robot.motor
        sim: Mapping[str, Any] = robot.simulation
        s = self.unpack(y)
        n = robot.wheels
        grip_limit = sim["friction_coefficient"] * sim["mass_kg"] * 9.80665 / n
        up = np.array([0.0, 0.0, 1.0])
        spin = s["turn"][0] * up
        velocity = np.append(s["velocity"], 0.0)
        supply = self.battery_V - sim["battery_resistance_ohm"] * float(duty @ s["current"])
        force, moment = np.zeros(3), np.zeros(3)
        wheel_acc, current_rate = np.zeros(n), np.zeros(n)
        slip = self.slip(t)
        for i in range(n):
            bearing = s["heading"][0] + np.radians(robot.geometry["wheel_angle_deg"][i])
            axle = np.array([np.cos(bearing), np.sin(bearing), 0.0])
            forward = cross(up, axle)
            place = robot.geometry["wheel_distance_m"] * axle
            ground = velocity + cross(spin, place)
            w, current = s["speed"][i], s["current"][i]
            radius = robot.geometry["wheel_radius_m"]
            wish = sim["slip_stiffness_N_s_m"] * (radius * w * (1 - slip[i]) - ground @ forward)
            traction = wish / np.hypot(1.0, wish / grip_limit)
            push = traction * forward - sim["roller_friction_N_s_m"] * (ground @ axle) * axle
            force += push
            moment += cross(place, push)
            drag = motor["viscous_friction_N_m_s"] * w + sim["coulomb_friction_N_m"] * w / np.hypot(w, 0.01)
            torque = motor["constant_N_m_A"] * current - drag - radius * traction
            wheel_acc[i] = torque / motor["inertia_kg_m2"]
            drop = motor["resistance_ohm"] * current + motor["constant_N_m_A"] * w
            current_rate[i] = (duty[i] * supply - drop) / motor["inductance_H"]
        acceleration = force[:2] / sim["mass_kg"]
        turn_rate = moment[2:] / sim["inertia_kg_m2"]
        return np.concatenate([s["velocity"], s["turn"], acceleration, turn_rate, s["speed"], wheel_acc, current_rate])


def duties(wheels: int, seed: int) -> list[Array]:
    """Random duties in whole PWM steps, each held for a while."""
    rng = np.random.default_rng(seed)
    return [rng.integers(-STEPS, STEPS, wheels, endpoint=True) / STEPS for _ in range(TICKS // HOLD_TICKS)]


def reference_run(reference: Reference, plan: list[Array]) -> tuple[Array, Array]:
    """Return final state and the largest magnitude of every state on the way."""
    y = np.zeros(6 + 3 * reference.robot.wheels)
    peak = np.zeros_like(y)
    for k, duty in enumerate(plan):
        span = (k * HOLD_TICKS * 1e-3, (k + 1) * HOLD_TICKS * 1e-3)
        solution = solve_ivp(reference, span, y, method="LSODA", rtol=1e-9, atol=1e-11, args=(duty,))
        assert solution.success
        y = solution.y[:, -1]
        peak = np.maximum(peak, np.abs(solution.y).max(axis=1))
    return y, peak


def world_state(world: World) -> Array:
    n = world.wheels
    columns = [world.c.wheel_angle_rad, world.c.wheel_rad_s, world.c.current_A]
    return np.concatenate([world.truth, world.twist, *[np.array(list(column))[:n] for column in columns]])


def assert_close(reference: Reference, got: Array, expected: Array, peak: Array, tolerance: float) -> None:
    """Every group of states within `tolerance` of the group's peak."""
    parts = [reference.unpack(a) for a in (got, expected, peak)]
    for name in parts[0]:
        error = np.abs(parts[0][name] - parts[1][name]).max() / parts[2][name].max()
        assert error < tolerance, f"{name} is off by {error:.2e} of its peak"


def slip_of(world: World) -> Callable[[float], Array]:
    """Imposed slip between two neighbouring draws that the world has made."""
    before = np.array(list(world.c.slip_before))[: world.wheels]
    after = np.array(list(world.c.slip_after))[: world.wheels]
    period = world.c.config.slip_time_s
    return lambda t: before + t / period * (after - before)


@pytest.mark.full
@pytest.mark.parametrize("slip_max", [0.0, 0.1])
def test_plant_agrees_with_reference(any_robot: Robot, make_world: Any, slip_max: float) -> None:
    world = make_world(any_robot, slip_max=slip_max, slip_time_s=2.0)
    reference = Reference(any_robot, any_robot.motor["supply_V"], slip_of(world) if slip_max else lambda t: np.zeros(4))
    plan = duties(any_robot.wheels, seed=1)
    expected, peak = reference_run(reference, plan)
    for duty in plan:
        world.set_duty(duty.tolist())
        world.step(HOLD_TICKS)
    assert_close(reference, world_state(world), expected, peak, tolerance=1e-3)


@pytest.mark.full
def test_plant_agrees_with_reference_when_wheels_break_away(robots: dict[str, Robot], make_world: Any) -> None:
    robot = robots["three_wheel"]
    slippery = {**robot.simulation, "friction_coefficient": 0.1}
    loose = Robot(**{**vars(robot), "simulation": slippery})
    world = make_world(loose)
    reference = Reference(loose, robot.motor["supply_V"], lambda t: np.zeros(3))
    plan = duties(3, seed=5)
    expected, peak = reference_run(reference, plan)
    for duty in plan:
        world.set_duty(duty.tolist())
        world.step(HOLD_TICKS)
    assert_close(reference, world_state(world), expected, peak, tolerance=1e-3)


FULL_BEFORE_PLANTS = {
    "three_wheel": (
        [0.008466521350420633, -0.003500039266104386, -0.04753501793244282],
        [-0.6248318437147312, 2.831765640812303, 0.12907300810564817],
    ),
    "four_wheel": (
        [-0.008932141165258199, 0.001506031448711205, -0.01630971513394025],
        [-0.7195097929153946, 2.918053596838392, 0.015286095746115898, -3.020714402951756],
    ),
}


def test_full_is_what_it_was_before_other_plants_existed(any_robot: Robot, make_world: Any) -> None:
    """Bits are the same on one machine; others round cosines their own way."""
    world = make_world(any_robot, seed=3, slip_max=0.1, slip_time_s=0.3)
    for k in range(40):
        world.set_duty([((7 * k + 5 * wheel) % 9 - 4) / 4 for wheel in range(any_robot.wheels)])
        if k % 7 == 0:
            world.set_bridges([0] * 4, [0] * 4)
        world.step(25)
    pose, wheels = FULL_BEFORE_PLANTS[any_robot.name]
    assert np.allclose(world.truth, pose, rtol=1e-11, atol=0.0)
    assert np.allclose(world.wheel_rad_s, wheels, rtol=1e-11, atol=0.0)
