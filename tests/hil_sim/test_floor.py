# SPDX-License-Identifier: MIT
"""Plant full on real rollers and a real floor, beside what statics and geometry say."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hil_sim.world import World
from omni_schema import Robot
from omniwheel._core import ffi
from tests.hil_sim.rollers_page import PAGE, error_of, written

GRAVITY = 9.80665
SPRINGS = {"wheel_stiffness_N_m": 1e5, "wheel_damping_N_s_m": 100.0, "centre_of_mass_height_m": 0.06}
ROLLERS = {"rollers_per_row": 9, "row_distance_m": 0.018, "roller_dip_m": 1e-4}
Changed = Callable[..., World]


@pytest.fixture
def changed(make_world: Any) -> Changed:
    """A world of a robot with other numbers."""

    def make(robot: Robot | str = "three_wheel", **numbers: float) -> World:
        world = make_world(robot)
        for name, value in numbers.items():
            setattr(world.c.config, name, value)
        return World(ffi.addressof(world.c, "config"))

    return make


def loads(world: World) -> Any:
    return np.array(list(world.c.load_N)[: world.wheels])


def loads_over(world: World, steps: int) -> Any:
    """Let time pass; return the loads of each step."""
    every = []
    for _ in range(steps):
        world.step()
        every.append(loads(world))
    return np.array(every)


def contacts(world: World) -> Any:
    """Where the wheels touch the floor: x and y in the body frame."""
    plant, wheels = world.c.plant, range(world.wheels)
    return np.array([[plant.along_y[i] * plant.arm_m[i], -plant.along_x[i] * plant.arm_m[i]] for i in wheels])


def test_what_counts_for_nothing_without_rollers_and_springs_changes_no_bit(any_robot: Robot, changed: Changed) -> None:
    plain = changed(any_robot)
    other = changed(any_robot, row_distance_m=0.02, roller_dip_m=1e-3, wheel_damping_N_s_m=50.0, floor_uphill_rad=1.0)
    for world in (plain, other):
        world.drive_voltage([6.0, -2.0, 1.0, 3.0][: world.wheels])
        world.step(300)
    assert (plain.truth == other.truth).all()
    assert (plain.wheel_rad_s == other.wheel_rad_s).all()


def test_at_rest_all_wheels_carry_the_same(any_robot: Robot, changed: Changed) -> None:
    world = changed(any_robot, **SPRINGS)
    world.step(1000)
    weight = world.c.config.mass_kg * GRAVITY
    assert loads(world) == pytest.approx(np.full(world.wheels, weight / world.wheels), rel=1e-9)


def test_loads_are_in_balance_while_the_robot_speeds_up(any_robot: Robot, changed: Changed) -> None:
    """Moments about the centre of mass: what the floor pushes along it tips the body, what it pushes up holds it."""
    world = changed(any_robot, **SPRINGS, motor_viscous_N_m_s=1e-6, motor_coulomb_N_m=0.0)
    world.drive_torque([0.1, -0.1, 0.0, 0.0][: world.wheels])
    world.step(60)
    moments = []
    for _ in range(200):
        world.step()
        traction = np.array(list(world.c.traction_N)[: world.wheels])
        along = np.array([[world.c.plant.along_x[i], world.c.plant.along_y[i]] for i in range(world.wheels)])
        force = traction @ along
        height = world.c.config.centre_of_mass_height_m
        moment = contacts(world).T @ loads(world)
        moments.append([moment[1] + height * force[1], moment[0] + height * force[0], height * np.hypot(*force)])
    roll, pitch, size = np.mean(moments, axis=0)
    assert size > 0.01
    assert abs(roll) < 0.02 * size
    assert abs(pitch) < 0.02 * size
    assert np.ptp(loads(world)) > 0.1


def test_a_high_robot_lifts_wheels_and_no_load_pulls(changed: Changed) -> None:
    world = changed(**{**SPRINGS, "centre_of_mass_height_m": 0.6, "friction_coefficient": 2.0})
    world.drive_torque([2.0, -2.0, 0.0])
    assert min(loads_over(world, 400).ravel()) == 0.0


@pytest.mark.parametrize(("dip_m", "share"), [(1e-4, 0.0), (3e-4, 0.23)])
def test_at_speed_a_deep_dip_throws_wheels_off_the_floor(dip_m: float, share: float, changed: Changed) -> None:
    """The share of the time that a wheel is in the air, which docs/concepts/real-wheels.md says."""
    world = changed("fast_three_wheel", **{**SPRINGS, **ROLLERS, "roller_dip_m": dip_m})
    world.drive_voltage([9.0, -9.0, 0.0])
    world.step(1000)
    lifted = loads_over(world, 3000) == 0.0
    assert np.hypot(*world.twist[:2]) == pytest.approx(1.4, abs=0.01)
    assert np.mean(lifted) == pytest.approx(share, abs=0.02)


def turning(world: World, steps: int) -> tuple[list[float], list[float]]:
    """Let the robot turn on the spot; return turn rate over wheel speed, and the lever arm of the first wheel."""
    rates, arms = [], []
    for _ in range(steps):
        world.step()
        rates.append(world.twist[2] / float(np.mean(world.wheel_rad_s)))
        arms.append(world.c.plant.arm_m[0])
    return rates, arms


def test_the_lever_arm_alternates_between_the_rows(any_robot: Robot, changed: Changed) -> None:
    """All wheels in step: the robot turns by r / (L - d/2) of a wheel's turn, then by r / (L + d/2)."""
    world = changed(any_robot, rollers_per_row=9, row_distance_m=0.018)
    for wheel in range(4):
        world.c.plant.roller_phase[wheel] = 0.0
    world.drive_voltage([3.0] * world.wheels)
    world.step(500)
    rates, arms = turning(world, 1000)
    radius, distance = world.c.config.wheel_radius_m[0], world.c.config.wheel_distance_m[0]
    assert {round(arm, 9) for arm in arms} == {round(distance - 0.009, 9), round(distance + 0.009, 9)}
    inner, outer = np.percentile(rates, 95), np.percentile(rates, 5)
    assert inner == pytest.approx(radius / (distance - 0.009), rel=0.01)
    assert outer == pytest.approx(radius / (distance + 0.009), rel=0.01)


def test_the_rows_take_turns_as_often_as_there_are_rollers(changed: Changed) -> None:
    world = changed(rollers_per_row=7, row_distance_m=0.01)
    world.drive_voltage([3.0] * 3)
    begin = world.c.wheel_angle_rad[0]
    _, arms = turning(world, 3000)
    turned = abs(world.c.wheel_angle_rad[0] - begin) / (2 * math.pi)
    assert np.count_nonzero(np.diff(arms)) == pytest.approx(14 * turned, abs=1)


def test_the_body_sinks_by_the_dip_where_rollers_hand_over(changed: Changed) -> None:
    world = changed(**SPRINGS, rollers_per_row=9, roller_dip_m=2e-4)
    for wheel in range(3):
        world.c.plant.roller_phase[wheel] = 0.0
    world.drive_voltage([0.6] * 3)
    world.step(2000)
    rises = []
    for _ in range(2000):
        world.step()
        rises.append(world.c.rise[0])
    assert min(rises) == pytest.approx(-2e-4, rel=0.1)
    assert max(rises) == pytest.approx(0.0, abs=2e-5)


def test_dry_drag_is_that_of_each_wheel_across_its_direction(any_robot: Robot, changed: Changed) -> None:
    world = changed(any_robot, roller_bushing_friction=0.05)
    velocity = np.array([0.4, 0.1])
    world.c.twist[0], world.c.twist[1] = velocity
    world.step()
    share = world.c.config.mass_kg * GRAVITY / world.wheels
    angles = [world.c.config.wheel_angle_rad[i] for i in range(world.wheels)]
    outward = np.array([[math.cos(angle), math.sin(angle)] for angle in angles])
    across = outward @ velocity
    expected = -0.05 * share * (across / np.sqrt(across**2 + 0.002**2)) @ outward
    assert np.array(list(world.c.floor_N)) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("heading", [0.0, 1.0, -2.5])
def test_on_a_slope_a_robot_without_grip_slides_down(heading: float, changed: Changed) -> None:
    slope, uphill = 0.1, 0.7
    world = changed(
        floor_slope_rad=slope, floor_uphill_rad=uphill, friction_coefficient=1e-6, roller_friction_N_s_m=0.0
    )
    world.c.pose[2] = heading
    world.step(500)
    speed = GRAVITY * math.sin(slope) * 0.5
    assert world.twist[:2] == pytest.approx([-speed * math.cos(uphill), -speed * math.sin(uphill)], rel=1e-3)


def test_the_seed_says_how_the_wheels_stand(changed: Changed) -> None:
    phases = [list(changed(rollers_per_row=9, seed=seed).c.plant.roller_phase)[:3] for seed in (1, 1, 2)]
    assert phases[0] == phases[1]
    assert phases[0] != phases[2]
    assert all(0.0 <= phase < 18.0 for phase in phases[0])


def test_a_tick_begins_with_the_loads_that_it_uses(changed: Changed) -> None:
    world = changed(**SPRINGS, **ROLLERS, roller_bushing_friction=0.02)
    world.drive_voltage([4.0, -4.0, 1.0])
    for _ in range(300):
        world.step()
        limits = [1.0 / world.c.plant.inverse_limit_N[i] for i in range(3)]
        assert np.abs(list(world.c.traction_N)[:3]).tolist() <= limits
        least = 1e-3 * world.c.config.mass_kg * GRAVITY / 3
        assert limits == pytest.approx(world.c.config.friction_coefficient * np.maximum(loads(world), least))


@pytest.mark.full
def test_the_page_says_what_rollers_cost() -> None:
    assert PAGE.read_text() == written()


@pytest.mark.full
def test_rollers_cost_dead_reckoning_and_hardly_a_robot_with_fixes() -> None:
    """An independent MuJoCo model of this robot, by nobody of this project: 1.26 mm with fixes, 5.7 mm without."""
    assert 1e3 * error_of("demo").position_m == pytest.approx(1.26, rel=0.2)
    assert 1e3 * error_of("no_slip").position_m == pytest.approx(5.7, rel=0.2)
    assert 1e3 * error_of("ideal_no_slip").position_m < 0.2
