# SPDX-License-Identifier: MIT
"""The report's models as plants: what each conserves, where they agree, how they are driven and chosen."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hil_sim.faults import Fault
from hil_sim.world import PLANTS, World, WorldError, world_config
from omni_schema import Robot
from omniwheel._core import lib

Array = npt.NDArray[np.float64]
WITH_CONTACT = ("full", "slip")
FREE = {"motor_viscous_N_m_s": 0.0, "motor_coulomb_N_m": 0.0, "roller_friction_N_s_m": 0.0}


def wheels_of(robot: Robot) -> tuple[Array, Array, Array]:
    """Return directions (n, 2), arms (n) and radii (n) of the wheels."""
    angles = np.radians(robot.geometry["wheel_angle_deg"])
    n = robot.wheels
    directions = np.column_stack([-np.sin(angles), np.cos(angles)])
    return (
        directions,
        np.broadcast_to(robot.geometry["wheel_distance_m"], n).astype(float),
        np.broadcast_to(robot.geometry["wheel_radius_m"], n).astype(float),
    )


def turned(angle: float) -> Array:
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def set_motion(world: World, twist: Array, wheel_rad_s: Array) -> None:
    for axis in range(3):
        world.c.twist[axis] = twist[axis]
    for wheel in range(world.wheels):
        world.c.wheel_rad_s[wheel] = wheel_rad_s[wheel]


def creep(world: World, robot: Robot) -> Array:
    directions, arms, radii = wheels_of(robot)
    body = turned(world.truth[2]).T @ world.twist[:2]
    return np.asarray(radii * world.wheel_rad_s - directions @ body - arms * world.twist[2])


def traction(world: World, robot: Robot) -> Array:
    config = world.c.config
    limit = config.friction_coefficient * config.mass_kg * 9.80665 / robot.wheels
    wish = config.slip_stiffness_N_s_m * creep(world, robot)
    return np.asarray(wish / np.hypot(1.0, wish / limit))


# ---- momentum and energy of the slip-space plant


def test_without_grip_body_and_wheels_keep_their_momentum(any_robot: Robot, make_world: Any) -> None:
    world = make_world(any_robot, plant="slip", slip_stiffness_N_s_m=1e-300)
    wheel_rad_s = np.array([3.0, -20.0, 7.0, 11.0])[: any_robot.wheels]
    set_motion(world, np.array([0.7, -0.3, 4.0]), wheel_rad_s)
    world.drive_torque([0.0] * any_robot.wheels)
    world.step(2000)
    assert np.allclose(world.twist, [0.7, -0.3, 4.0], rtol=1e-5)
    assert np.allclose(world.wheel_rad_s, wheel_rad_s, rtol=1e-12)


def test_rolling_freely_straight_on_goes_on_for_ever(any_robot: Robot, make_world: Any) -> None:
    directions, _, radii = wheels_of(any_robot)
    velocity = np.array([0.4, -0.2])
    world = make_world(any_robot, plant="slip")
    set_motion(world, np.array([*velocity, 0.0]), directions @ velocity / radii)
    world.drive_torque([0.0] * any_robot.wheels)
    world.step(5000)
    assert np.allclose(world.twist[:2], velocity, rtol=1e-9)
    assert np.allclose(world.truth[:2], 5.0 * velocity, rtol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_what_wheels_lose_the_body_gains(any_robot: Robot, make_world: Any, seed: int) -> None:
    """Free wheels exchange momentum with the body through the floor.

    About the centre I wz + sum J w_i d_i / r_i is constant. Along the floor P = m v + sum J w_i / r_i t_i changes only
    because the wheels' directions turn: dP/dt = wz x sum J w_i / r_i t_i.
    """
    rng = np.random.default_rng(seed)
    world = make_world(any_robot, plant="slip", motor_inertia_kg_m2=2e-3)
    directions, arms, radii = wheels_of(any_robot)
    set_motion(world, rng.uniform(-1, 1, 3) * [1, 1, 4], rng.uniform(-30, 30, any_robot.wheels))
    world.drive_torque([0.0] * any_robot.wheels)
    inertia = world.c.config.motor_inertia_kg_m2

    def carried() -> Array:
        return np.asarray(turned(world.truth[2]) @ (directions.T @ (inertia * world.wheel_rad_s / radii)))

    def momentum() -> Array:
        spin = world.c.config.inertia_kg_m2 * world.twist[2] + inertia * (world.wheel_rad_s * arms / radii).sum()
        return np.append(world.c.config.mass_kg * world.twist[:2] + carried(), spin)

    def exchange() -> Array:
        return np.asarray(world.twist[2] * np.array([-carried()[1], carried()[0]]))

    start, expected, step_us = momentum(), np.zeros(2), 50
    for _ in range(2000):
        before = exchange()
        world.step(1, step_us)
        expected += 0.5e-6 * step_us * (before + exchange())
    scale = np.abs(start).max()
    assert math.isclose(momentum()[2], start[2], abs_tol=1e-10 * scale)
    assert np.allclose(momentum()[:2] - start[:2], expected, atol=1e-4 * scale)


@pytest.mark.parametrize("seed", range(3))
def test_slip_takes_exactly_the_energy_that_is_lost(any_robot: Robot, make_world: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = make_world(any_robot, plant="slip", motor_inertia_kg_m2=2e-3, friction_coefficient=0.3)
    set_motion(world, rng.uniform(-1, 1, 3) * [1, 1, 4], rng.uniform(-30, 30, any_robot.wheels))
    world.drive_torque([0.0] * any_robot.wheels)

    def heat_W() -> float:
        return float(traction(world, any_robot) @ creep(world, any_robot))

    start, lost, step_us = lib.hil_world_kinetic_energy(world.c), 0.0, 20
    energy = start
    for _ in range(2500):
        before = heat_W()
        world.step(1, step_us)
        lost += 0.5e-6 * step_us * (before + heat_W())
        after = lib.hil_world_kinetic_energy(world.c)
        assert after <= energy * (1 + 1e-12)
        energy = after
    assert lost > 0.05 * start, "this start slips"
    assert math.isclose(start - energy, lost, rel_tol=2e-3)


def test_motors_energy_goes_into_heat_and_motion(any_robot: Robot, make_world: Any) -> None:
    """Plant slip at constant voltages: electrical energy = copper + bearings + creep + stored."""
    world = make_world(any_robot, plant="slip")
    volts = np.array([10.0, -4.0, 2.0, 1.0])[: any_robot.wheels]
    world.drive_voltage(volts)
    motor = any_robot.motor

    def powers() -> Array:
        current = np.array(list(world.c.current_A))[: any_robot.wheels]
        heat = motor["resistance_ohm"] * current**2 + motor["viscous_friction_N_m_s"] * world.wheel_rad_s**2
        return np.array([volts @ current, heat.sum() + traction(world, any_robot) @ creep(world, any_robot)])

    done, step_us = np.zeros(2), 50
    for _ in range(2500):
        before = powers()
        world.step(1, step_us)
        done += 0.5e-6 * step_us * (before + powers())
    current = np.array(list(world.c.current_A))
    stored = lib.hil_world_kinetic_energy(world.c) + 0.5 * motor["inductance_H"] * (current**2).sum()
    assert math.isclose(done[0], done[1] + stored, rel_tol=1e-3)


# ---- all plants


@pytest.mark.parametrize("plant", PLANTS)
def test_turning_the_world_turns_the_motion(any_robot: Robot, make_world: Any, plant: str) -> None:
    angle, x, y = 1.1, -0.4, 0.9
    options = {"plant": plant, "slip_max": 0.1, "slip_speed_max_m_s": 0.02, "slip_time_s": 0.05}
    here, there = make_world(any_robot, **options), make_world(any_robot, start_pose=(x, y, angle), **options)
    for world in (here, there):
        world.drive_voltage([9.0, -3.0, 4.0, 6.0][: any_robot.wheels])
        world.step(500)
    moved = turned(angle).T @ (there.truth[:2] - [x, y])
    assert np.allclose([*moved, there.truth[2] - angle], here.truth, atol=1e-9)
    assert np.allclose(there.wheel_rad_s, here.wheel_rad_s, atol=1e-9)


@pytest.mark.parametrize("plant", PLANTS)
def test_no_drive_no_motion(any_robot: Robot, make_world: Any, plant: str) -> None:
    world = make_world(any_robot, plant=plant)
    world.step(100)
    assert world.truth.tolist() == [0.0, 0.0, 0.0]
    assert list(world.c.counts) == [0, 0, 0, 0]


@pytest.mark.parametrize("plant", PLANTS)
def test_bridges_and_ideal_voltages_move_alike(any_robot: Robot, make_world: Any, plant: str) -> None:
    """Drive-brake at a duty is a voltage source of duty times battery where the battery has no resistance."""
    bridges, ideal = (make_world(any_robot, plant=plant, battery_resistance_ohm=0.0) for _ in range(2))
    duties = [0.75, -0.5, 0.25, 0.125][: any_robot.wheels]
    bridges.set_duty(duties)
    ideal.drive_voltage([12.0 * duty for duty in duties])
    for world in (bridges, ideal):
        world.step(700)
    assert np.allclose(bridges.truth, ideal.truth, atol=1e-12)
    assert list(bridges.c.counts) == list(ideal.c.counts)
    assert max(map(abs, bridges.c.counts)) > 100, "the encoders count on every plant"


@pytest.mark.parametrize("plant", PLANTS)
def test_bridges_take_over_again(any_robot: Robot, make_world: Any, plant: str) -> None:
    world = make_world(any_robot, plant=plant)
    world.drive_voltage([6.0] * any_robot.wheels)
    world.step(500)
    assert abs(world.twist[2]) > 0.01
    world.set_duty([0.0] * any_robot.wheels)
    world.step(1500)
    assert np.abs(world.twist).max() < 1e-3


@pytest.mark.parametrize("plant", PLANTS)
def test_dead_motor_does_not_push(any_robot: Robot, make_world: Any, plant: str) -> None:
    dead = [Fault("motor_dead", 0.0, math.inf, wheel, 0.0) for wheel in range(any_robot.wheels)]
    world = make_world(any_robot, plant=plant, faults=dead)
    world.drive_voltage([6.0] * any_robot.wheels)
    world.step(500)
    assert world.truth.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("plant", PLANTS)
def test_tick_length_does_not_matter(any_robot: Robot, make_world: Any, plant: str) -> None:
    ends = []
    for step_us in (250, 1000, 20_000):
        world = make_world(any_robot, plant=plant)
        world.drive_voltage([9.0, -3.0, 4.0, 6.0][: any_robot.wheels])
        world.step(400_000 // step_us, step_us)
        ends.append(world.truth)
    assert np.allclose(ends[1:], ends[0], atol=2e-5)


# ---- imposed slip speeds


def test_slip_speeds_are_held_and_drawn_anew(make_world: Any) -> None:
    world = make_world("four_wheel", plant="kinematic", slip_speed_max_m_s=0.1, slip_time_s=0.02, seed=5)
    drawn = []
    for _ in range(2000):
        held = world.slip_speed
        world.step(19)
        assert (world.slip_speed == held).all()
        world.step(1)
        drawn.append(held)
    values = np.array(drawn)
    assert np.abs(values).max() <= 0.1
    assert np.abs(values.mean(axis=0)).max() < 4 * 0.1 / math.sqrt(3 * 2000)
    assert np.allclose(values.std(axis=0), 0.1 / math.sqrt(3), rtol=0.05)
    correlation = np.corrcoef(np.column_stack([values[1:], values[:-1]]).T) - np.eye(8)
    assert np.abs(correlation).max() < 0.1


def test_slip_speeds_depend_on_the_seed_alone(make_world: Any) -> None:
    options = {"plant": "kinematic", "slip_speed_max_m_s": 0.1, "slip_time_s": 0.02}
    fine, coarse, other = (make_world("four_wheel", seed=seed, **options) for seed in (7, 7, 8))
    fine.step(200)
    coarse.step(10, 20_000)
    other.step(200)
    assert (fine.slip_speed == coarse.slip_speed).all()
    assert (fine.slip_speed != other.slip_speed).all()


@pytest.mark.parametrize("plant", PLANTS)
def test_a_body_at_rest_on_turning_wheels_is_carried_by_slip(any_robot: Robot, make_world: Any, plant: str) -> None:
    """Still wheels, imposed slip u: the floor is gripped at -u, so that the body goes the other way."""
    world = make_world(any_robot, plant=plant, slip_speed_max_m_s=0.01, slip_time_s=100.0, seed=3, **FREE)
    slip = world.slip_speed
    directions, arms, _ = wheels_of(any_robot)
    expected = np.linalg.lstsq(np.column_stack([directions, arms]), -slip, rcond=None)[0]
    if plant == "kinematic":
        world.drive_speed([0.0] * any_robot.wheels)
    else:
        world.drive_voltage([0.0] * any_robot.wheels)
    world.step(1500)
    grip = 0.02
    assert np.allclose(turned(world.truth[2]).T @ world.twist[:2], expected[:2], atol=grip * np.abs(slip).max())
    assert math.isclose(world.twist[2], expected[2], abs_tol=grip * np.abs(slip / arms).max())


# ---- where plants must agree


def twist_after(world: World, volts: list[float], ticks: int = 1500) -> Array:
    world.drive_voltage(volts[: world.wheels])
    world.step(ticks)
    return np.append(turned(world.truth[2]).T @ world.twist[:2], world.twist[2])


VOLTS = [9.0, -3.0, 4.0, 6.0]


def test_slip_becomes_kinematic_with_grip_and_light_bodies(any_robot: Robot, make_world: Any) -> None:
    """What is light follows at once: the same path under voltages that change every 50 ms."""
    light = {"mass_kg": 0.01, "inertia_kg_m2": 1e-4, "motor_inertia_kg_m2": 1e-5, "motor_inductance_H": 1e-6}
    kinematic = make_world(any_robot, plant="kinematic")
    slip = make_world(any_robot, plant="slip", slip_stiffness_N_s_m=1e6, **light)
    slip.c.plant.inverse_limit_N = [0.0] * 4
    rng = np.random.default_rng(1)
    length_m = 0.0
    for _ in range(40):
        volts = rng.uniform(-12, 12, any_robot.wheels).tolist()
        assert np.allclose(twist_after(slip, volts, 50), twist_after(kinematic, volts, 50), atol=1e-5)
        length_m += 0.05 * float(np.hypot(*kinematic.twist[:2]))
    assert np.abs(slip.truth - kinematic.truth).max() < 1e-3 * length_m


def test_heavy_bodies_lag_and_loose_wheels_fall_behind(any_robot: Robot, make_world: Any) -> None:
    kinematic, slip, loose = (
        make_world(any_robot, plant="kinematic"),
        make_world(any_robot, plant="slip"),
        make_world(any_robot, plant="slip", friction_coefficient=0.02),
    )
    distances = [np.abs(twist_after(world, VOLTS, 8)).max() for world in (loose, slip, kinematic)]
    assert distances[0] < 0.9 * distances[1] < 0.81 * distances[2]


def test_motors_settle_at_the_kinematic_speed(any_robot: Robot, make_world: Any) -> None:
    steady = make_world(any_robot, plant="kinematic")
    motors = make_world(any_robot, plant="kinematic+motors", motor_coulomb_N_m=0.0)
    assert np.allclose(twist_after(motors, VOLTS), twist_after(steady, VOLTS), rtol=1e-9)
    assert np.allclose(motors.wheel_rad_s, steady.wheel_rad_s, rtol=1e-9)


@pytest.mark.parametrize("volts", [[6.0, 6.0, 6.0, 6.0], [0.0, -6.0, 6.0, 0.0], [-5.0, -5.0, 5.0, 5.0]])
def test_linear_is_slip_with_perfect_grip(any_robot: Robot, make_world: Any, volts: list[float]) -> None:
    """Spin or straight: (14) has no Coriolis terms, so that the two are the same only where there are none."""
    if any_robot.wheels == 3 and volts[0] < 0.0:
        volts = [0.0, -5.0, 5.0]
    options = {**FREE, "motor_viscous_N_m_s": 0.2, "motor_inductance_H": 1e-6, "slip_stiffness_N_s_m": 1e6}
    slip = make_world(any_robot, plant="slip", **options)
    linear = make_world(any_robot, plant="linear", **options)
    slip.c.plant.inverse_limit_N = [0.0] * 4
    for ticks in (20, 100, 1000):
        expected = twist_after(slip, volts, ticks)
        got = twist_after(linear, volts, ticks)
        if any_robot.wheels == 4 and volts[0] == 0.0:
            got, expected = got[:2], expected[:2]
        assert np.allclose(got, expected, atol=2e-3 * np.abs(expected).max())


def test_linear_has_no_coriolis_terms_and_slip_has(make_world: Any) -> None:
    """Coasting while turning: in the body frame of (14) the velocity keeps its direction, in truth it turns back."""
    free = {**FREE, "motor_inertia_kg_m2": 1e-7, "linear_viscous": (0.0,) * 3, "linear_coulomb": (0.0,) * 3}
    linear = make_world("four_wheel", plant="linear", **free)
    slip = make_world("four_wheel", plant="slip", **free)
    for world in (linear, slip):
        set_motion(world, np.array([0.5, 0.0, 2.0]), np.zeros(4))
        world.drive_torque([0.0] * 4)
        world.step(500)
    assert np.allclose(linear.twist[:2], turned(1.0) @ [0.5, 0.0], atol=1e-6)
    assert np.allclose(slip.twist[:2], [0.5, 0.0], atol=0.01)


# ---- refusals


def test_unknown_plant_number_is_refused(robots: dict[str, Robot]) -> None:
    config = world_config(robots["three_wheel"])
    config.plant = 9
    with pytest.raises(WorldError, match="plant is 9"):
        World(config)


def test_unknown_plant_is_refused_by_name(make_world: Any) -> None:
    with pytest.raises(WorldError, match=r"'slipp'.*slip.*full, kinematic"):
        make_world("three_wheel", plant="slipp")


REFUSED: list[tuple[str, Callable[[World], None]]] = [
    *((plant, lambda world: world.drive_speed([1.0] * 3)) for plant in PLANTS if plant != "kinematic"),
    *((plant, lambda world: world.drive_torque([1.0] * 3)) for plant in ("kinematic", "kinematic+motors")),
    *((plant, lambda world: world.drive_voltage([1.0, math.nan, 1.0])) for plant in PLANTS),
    *((plant, lambda world: world.drive_voltage([1.0, math.inf, 1.0])) for plant in PLANTS),
    *((plant, lambda world: world.drive_voltage([1.0, 1.0])) for plant in PLANTS),
]


@pytest.mark.parametrize(("plant", "drive"), REFUSED)
def test_what_cannot_drive_a_plant_is_refused(make_world: Any, plant: str, drive: Callable[[World], None]) -> None:
    world = make_world("three_wheel", plant=plant)
    with pytest.raises(ValueError, match=r"not all finite|one per wheel"):
        drive(world)
    world.step(100)
    assert world.truth.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("plant", [plant for plant in PLANTS if plant != "full"])
def test_parallel_wheels_are_refused(robots: dict[str, Robot], make_world: Any, plant: str) -> None:
    robot = robots["three_wheel"]
    parallel = Robot(**{**vars(robot), "geometry": {**robot.geometry, "wheel_angle_deg": [0.0, 180.0, 0.0]}})
    make_world(parallel)
    with pytest.raises(WorldError, match=r"wheel_angle_rad.*every direction"):
        make_world(parallel, plant=plant)


@pytest.mark.parametrize(("values", "why"), [([1.0, 2.0], "three numbers"), (3.0, "three numbers"), ([1, 1, -2], "-1")])
def test_linear_friction_in_a_robot_file(robots: dict[str, Robot], make_world: Any, values: Any, why: str) -> None:
    robot = robots["three_wheel"]
    with pytest.raises(WorldError, match=why):
        make_world(Robot(**{**vars(robot), "simulation": {**robot.simulation, "linear_viscous": values}}))


def test_linear_friction_stops_the_body(robots: dict[str, Robot], make_world: Any) -> None:
    """Constant Coulomb friction alone: v falls by C / M a second, to rest and not beyond."""
    robot = robots["four_wheel"]
    friction = {"linear_viscous": [0.0, 0.0, 0.0], "linear_coulomb": [2.0, 3.0, 0.1]}
    own = Robot(**{**vars(robot), "simulation": {**robot.simulation, **friction}})
    for axis, per_s in enumerate((2.0 / 3.5, 3.0 / 3.5, 0.1 / 0.05)):
        world = make_world(own, plant="linear", motor_inertia_kg_m2=1e-9)
        set_motion(world, np.eye(3)[axis], np.zeros(4))
        world.drive_torque([0.0] * 4)
        world.step(200)
        assert math.isclose(world.twist[axis], 1.0 - 0.2 * per_s, rel_tol=1e-3)
        world.step(3000)
        assert abs(world.twist[axis]) < 1e-3


def test_pairs_of_plants_differ(any_robot: Robot, make_world: Any) -> None:
    """Each name is another model."""
    ends = {plant: make_world(any_robot, plant=plant) for plant in PLANTS}
    for world in ends.values():
        world.drive_voltage(VOLTS[: any_robot.wheels])
        world.step(300)
    for one, other in itertools.combinations(ends.values(), 2):
        assert np.abs(one.truth - other.truth).max() > 1e-5
