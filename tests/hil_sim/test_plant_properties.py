# SPDX-License-Identifier: MIT
"""What must hold of the motion whatever the numbers: energy, symmetry, geometry, rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hil_sim.world import World
from omni_schema import Robot
from omniwheel._core import lib

fixture_ok = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=30)
duty = st.floats(-1, 1)
OPEN = [0, 0, 0, 0]


def at_speed(world: World, twist: tuple[float, float, float], wheels: list[float]) -> World:
    for axis, value in enumerate(twist):
        world.c.twist[axis] = value
    for wheel, value in enumerate(wheels[: world.wheels]):
        world.c.wheel_rad_s[wheel] = value
    return world


def rotated(vector: npt.NDArray[np.float64], angle: float) -> npt.NDArray[np.float64]:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])


@fixture_ok
@given(
    st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-10, 10)),
    st.lists(st.floats(-40, 40), min_size=4, max_size=4),
)
def test_energy_never_grows_without_motors(any_robot: Robot, make_world: Any, twist: Any, wheels: Any) -> None:
    world = at_speed(make_world(any_robot), twist, wheels)
    energy = lib.hil_world_kinetic_energy(world.c)
    for _ in range(200):
        world.step()
        after = lib.hil_world_kinetic_energy(world.c)
        assert after <= energy * (1 + 1e-9)
        energy = after


def test_everything_comes_to_rest(any_robot: Robot, make_world: Any) -> None:
    world = at_speed(make_world(any_robot), (0.5, -0.3, 2.0), [5.0, -5.0, 5.0, 0.0])
    world.step(5000)
    assert np.abs(world.twist).max() < 1e-6
    assert np.abs(world.wheel_rad_s).max() < 1e-6


def test_no_drive_no_motion(any_robot: Robot, make_world: Any) -> None:
    world = make_world(any_robot)
    world.step(100)
    assert world.truth.tolist() == [0.0, 0.0, 0.0]
    assert list(world.c.counts) == [0, 0, 0, 0]


@fixture_ok
@given(st.lists(duty, min_size=4, max_size=4), st.floats(-3, 3), st.floats(-2, 2), st.floats(-2, 2))
def test_turning_the_world_turns_the_motion(
    any_robot: Robot, make_world: Any, duties: list[float], angle: float, x: float, y: float
) -> None:
    here, there = make_world(any_robot), make_world(any_robot, start_pose=(x, y, angle))
    for world in (here, there):
        world.set_duty(duties[: world.wheels])
        world.step(300)
    moved = there.truth - np.array([x, y, angle])
    assert np.allclose(moved, rotated(here.truth, angle), atol=1e-9)
    assert np.allclose(there.wheel_rad_s, here.wheel_rad_s, atol=1e-9)


@fixture_ok
@given(st.lists(duty, min_size=3, max_size=3))
def test_mirrored_duties_mirror_the_motion(make_world: Any, duties: list[float]) -> None:
    """Mirror about the x axis: wheel 0 maps to itself, wheels 1 and 2 change places, all turn the other way."""
    here, mirrored = make_world("three_wheel"), make_world("three_wheel")
    here.set_duty(duties)
    mirrored.set_duty([-duties[0], -duties[2], -duties[1]])
    for world in (here, mirrored):
        world.step(300)
    assert np.allclose(mirrored.truth, here.truth * [1, -1, -1], atol=1e-4)


def test_equal_wheels_spin_on_the_spot(any_robot: Robot, make_world: Any) -> None:
    world = make_world(any_robot)
    world.set_duty([0.5] * world.wheels)
    world.step(2000)
    ratio = any_robot.geometry["wheel_radius_m"] / any_robot.geometry["wheel_distance_m"]
    assert np.abs(world.truth[:2]).max() < 1e-9
    assert math.isclose(world.twist[2], ratio * world.wheel_rad_s[0], rel_tol=1e-6)
    assert math.isclose(world.truth[2], ratio * world.c.wheel_angle_rad[0], rel_tol=1e-3)


@pytest.mark.parametrize("heading", [0.0, 1.0])
def test_three_wheels_drive_straight(make_world: Any, heading: float) -> None:
    """Wheels 1 and 2 against each other: along body x, each at cos 30 degrees to it."""
    world = make_world("three_wheel", start_pose=(0.0, 0.0, heading))
    world.set_duty([0.0, -0.5, 0.5])
    world.step(3000)
    speed = 0.0508 * world.wheel_rad_s[2] / math.cos(math.radians(30))
    assert speed > 0.05
    body = rotated(world.twist, -heading)
    assert math.isclose(body[0], speed, rel_tol=0.01), "roller drag costs a little creep"
    assert np.abs(body[1:]).max() < 1e-6


def test_four_wheels_drive_straight(make_world: Any) -> None:
    world = make_world("four_wheel")
    world.set_duty([-0.5, -0.5, 0.5, 0.5])
    world.step(3000)
    speed = 0.03175 * world.wheel_rad_s[2] * math.sqrt(2)
    assert speed > 0.05
    assert math.isclose(world.twist[0], speed, rel_tol=0.01)
    assert np.abs(world.twist[1:]).max() < 1e-6


def test_steady_speed_and_current_follow_the_motor(make_world: Any) -> None:
    """Spinning freely on the spot: K i = b w + T_c and V = R i + K w, supply reduced by the battery's resistance."""
    world = make_world("three_wheel")
    world.set_duty([1.0] * 3)
    world.step(3000)
    w, i = world.wheel_rad_s[0], world.c.current_A[0]
    assert math.isclose(world.c.supply_V, 12.0 - 0.05 * 3 * i, rel_tol=1e-9)
    assert math.isclose(1.05 * i, 1.0 * w + 0.05, rel_tol=1e-4)
    assert math.isclose(world.c.supply_V, 2.7 * i + 1.05 * w, rel_tol=1e-6)


def test_motor_direction_is_the_wiring_of_the_motor(robots: dict[str, Robot], make_world: Any) -> None:
    robot = robots["three_wheel"]
    crossed = Robot(**{**vars(robot), "motor": {**robot.motor, "direction": [-1, 1, 1]}})
    straight, turned = make_world(robot), make_world(crossed)
    straight.set_duty([0.5, 0.3, 0.1])
    turned.set_duty([-0.5, 0.3, 0.1])
    for world in (straight, turned):
        world.step(500)
    assert np.allclose(turned.truth, straight.truth, atol=1e-12)


@pytest.mark.parametrize("stiffness", [10.0, 2e3, 2e5, 1e8])
def test_any_grip_is_stable(make_world: Any, stiffness: float) -> None:
    world = make_world("three_wheel", slip_stiffness_N_s_m=stiffness)
    world.set_duty([0.8, -0.8, 0.4])
    for _ in range(1000):
        world.step()
        assert np.abs(world.twist).max() < 5.0
        assert np.abs(world.wheel_rad_s).max() < 4.0


def test_braking_stops_sooner_than_coasting(make_world: Any) -> None:
    braked, coasting = make_world("three_wheel"), make_world("three_wheel")
    for world in (braked, coasting):
        world.set_duty([1.0] * 3)
        world.step(500)
    braked.set_duty([0.0] * 3)
    coasting.set_bridges(OPEN, OPEN)
    for world in (braked, coasting):
        world.step(5)
    assert braked.wheel_rad_s[0] < 0.99 * coasting.wheel_rad_s[0]
    assert coasting.c.current_A[0] == 0.0


@pytest.mark.parametrize("step_us", [1, 100, 250, 1000, 2500, 20000])
def test_tick_length_does_not_matter(make_world: Any, step_us: int) -> None:
    world, usual = make_world("three_wheel"), make_world("three_wheel")
    for each, length in ((world, step_us), (usual, 1000)):
        each.set_duty([0.5, 0.4, -0.3])
        each.step(100_000 // length, length)
    assert world.c.time_us == usual.c.time_us
    assert np.allclose(world.truth, usual.truth, atol=2e-5)


def test_zero_length_tick_is_no_tick(make_world: Any) -> None:
    world = make_world("three_wheel")
    world.step(1, 0)
    assert world.c.steps == 0
