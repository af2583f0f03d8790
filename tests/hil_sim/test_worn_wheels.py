# SPDX-License-Identifier: MIT
"""Wheels that differ, patches and slopes, beside what mechanics says of locked and of freely rolling wheels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hil_sim.faults import Fault
from hil_sim.patches import FloorPatch, factor_at
from hil_sim.scenario import load_scenario
from hil_sim.world import World, WorldError
from omni_schema import Robot
from tests.hil_sim.rollers_page import PAGE
from tests.hil_sim.worn_page import changed, errors, table

OPEN = [0, 0, 0, 0]

GRAVITY = 9.80665
NO_DRAG = {"roller_friction_N_s_m": 0.0, "motor_coulomb_N_m": 0.0}
NO_GRIP = {"friction_coefficient": 1e-6, "motor_coulomb_N_m": 0.0}


def locked(make_world: Any, **options: Any) -> World:
    """A three-wheel robot whose wheels are blocked and which slides along x at 1 m/s."""
    faults = [Fault("motor_stalled", 0.0, wheel=wheel) for wheel in range(3)]
    world: World = make_world("three_wheel", faults=faults, **NO_DRAG, **options)
    world.c.twist[0] = 1.0
    return world


def grip_N(world: World) -> float:
    """What a wheel as good as new can hold."""
    config = world.c.config
    return float(config.friction_coefficient * config.mass_kg * GRAVITY / config.wheels)


def stop_m(world: World) -> float:
    """Let the robot slide until it stands; return how far it came."""
    for _ in range(5000):
        world.step()
        if world.twist[0] < 0.01:
            return float(world.truth[0])
    raise AssertionError("it does not stop")


def contacts(world: World) -> np.ndarray:
    """Where the wheels touch the floor, in the world frame, from the robot file's geometry."""
    config, (x, y, theta) = world.c.config, world.truth
    bearings = [theta + config.wheel_angle_rad[i] for i in range(world.wheels)]
    return np.array([[x + config.wheel_distance_m[i] * math.cos(b), y + config.wheel_distance_m[i] * math.sin(b)]
                     for i, b in enumerate(bearings)])  # fmt: skip


def test_locked_wheels_brake_as_coulomb_says(make_world: Any) -> None:
    """Along x the first wheel rolls on its rollers; the others hold at 30 degrees to the way: a = 2 mu N cos 30 / m."""
    world = locked(make_world)
    slowing = 2.0 * grip_N(world) * math.cos(math.pi / 6) / world.c.config.mass_kg
    assert stop_m(world) == pytest.approx(1.0 / (2.0 * slowing), rel=0.01)
    assert abs(world.truth[2]) < 1e-6


@pytest.mark.parametrize("factor", [0.3, 2.0])
def test_a_robot_slides_as_much_farther_as_a_patch_is_slippery(factor: float, make_world: Any) -> None:
    patch = FloorPatch((-10.0, 10.0), (-10.0, 10.0), factor)
    assert stop_m(locked(make_world, patches=[patch])) == pytest.approx(stop_m(locked(make_world)) / factor, rel=0.01)


def test_beyond_a_patch_the_floor_brakes_as_before(make_world: Any) -> None:
    """Energy: v^2 falls by 2 a per metre, and by a share of that while both holding wheels are on the patch."""
    plain = stop_m(locked(make_world))
    distance = locked(make_world).c.config.wheel_distance_m[1]
    begin = -0.5 * distance  # both holding wheels stand there at the start
    patch = FloorPatch((begin, begin + 0.05), (-1.0, 1.0), 0.5)
    assert stop_m(locked(make_world, patches=[patch])) == pytest.approx(plain + 0.05 * (1.0 - 0.5), rel=0.01)


def test_unequal_friction_turns_a_robot_that_brakes_hard(make_world: Any) -> None:
    """The first wheel would hold against a turn, so it has hardly any grip. The third holds twice the second's."""
    even, worn = (locked(make_world, wheel_friction=(0.001, second, 1.0)) for second in (1.0, 0.5))
    for world in (even, worn):
        world.step(20)
    config = worn.c.config
    moment = config.wheel_distance_m[0] * grip_N(worn) * (0.5 - 1.0)
    assert worn.twist[2] == pytest.approx(moment / config.inertia_kg_m2 * 0.02, rel=0.02)
    assert abs(even.twist[2]) < 1e-9


def test_no_wheel_holds_more_than_its_own_friction(any_robot: Robot, make_world: Any) -> None:
    factors = (1.0, 0.4, 0.7, 0.2)[: any_robot.wheels]
    world = make_world(any_robot, wheel_friction=factors, slip_stiffness_N_s_m=1e5)
    world.drive_torque([5.0] * world.wheels)
    world.step(3)
    tractions = np.array(list(world.c.traction_N)[: world.wheels])
    assert tractions == pytest.approx(grip_N(world) * np.array(factors), rel=0.01)


def test_drag_of_one_wheel_is_its_own(make_world: Any) -> None:
    """Without grip only rollers slow the robot: m v' = -c (3 + 2 cos^2 60) v along the first wheel's axle."""
    world = make_world("three_wheel", wheel_drag=(3.0, 1.0, 1.0), roller_friction_N_s_m=2.0, **NO_GRIP)
    world.c.twist[0] = 1.0
    world.step(1000)
    assert world.twist[0] == pytest.approx(math.exp(-2.0 * 3.5 / world.c.config.mass_kg), rel=1e-3)


def test_dry_drag_of_one_wheel_is_its_own(make_world: Any) -> None:
    """The second and third wheel do not rub: m v' = -5 c m g / 3."""
    options = {**NO_GRIP, "roller_friction_N_s_m": 0.0, "roller_bushing_friction": 0.02}
    world = make_world("three_wheel", wheel_drag=(5.0, 0.0, 0.0), **options)
    world.c.twist[0] = 1.0
    world.step(500)
    assert world.twist[0] == pytest.approx(1.0 - 0.5 * 5.0 * 0.02 * GRAVITY / 3.0, rel=1e-3)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.3, -0.2, 1.0), (-0.1, 0.1, -2.5)])
def test_each_wheel_has_the_friction_of_where_it_stands(pose: tuple[float, float, float], make_world: Any) -> None:
    random = np.random.default_rng(5)
    seen = set()
    for _ in range(30):
        corner, size = random.uniform(-0.6, 0.3, 2), random.uniform(0.1, 0.5, 2)
        x, y = random.uniform(-0.5, 0.5, 2)
        patches = [
            FloorPatch((corner[0], corner[0] + size[0]), (corner[1], corner[1] + size[1]), 0.5),
            FloorPatch((x, x), (y, y), 0.25, radius_m=0.3),
        ]
        world = make_world("four_wheel", patches=patches, start_pose=pose)
        world.step()
        limits = [1.0 / world.c.plant.inverse_limit_N[i] for i in range(4)]
        expected = []
        for px, py in contacts(world):
            on_circle = math.hypot(px - x, py - y) <= 0.3
            on_rectangle = corner[0] <= px <= corner[0] + size[0] and corner[1] <= py <= corner[1] + size[1]
            expected.append(0.25 if on_circle else 0.5 if on_rectangle else 1.0)
            assert factor_at(patches, px, py) == expected[-1]
        assert np.array(limits) / grip_N(world) == pytest.approx(expected, rel=1e-9)
        seen |= set(expected)
    assert seen == {0.25, 0.5, 1.0}


def test_ice_everywhere_keeps_what_wheels_and_patches_have(make_world: Any) -> None:
    """The ice of omni sitl changes the floor's coefficient while the world runs."""
    patch = FloorPatch((-9.0, 9.0), (-9.0, 9.0), 0.5)
    for patches, share in (([], 0.7), ([patch], 0.35)):
        world = make_world("three_wheel", wheel_friction=(1.0, 0.7, 1.0), patches=patches)
        world.set_friction(0.1)
        world.step()
        assert 1.0 / world.c.plant.inverse_limit_N[1] == pytest.approx(share * grip_N(world))
        assert world.c.config.friction_coefficient == 0.1


PATCH = FloorPatch((0.0, 1.0), (0.0, 1.0), 0.5)


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"patches": [PATCH] * 9}, "9 patches.* at most 8"),
        ({"patches": [FloorPatch((0.0, 1.0), (0.0, 1.0), 0.0)]}, r"patch.friction\[0\] is 0; allowed: 0.001..10"),
        ({"patches": [FloorPatch((1.0, 0.0), (0.0, 1.0), 1.0)]}, "from, then a larger to"),
        ({"patches": [FloorPatch((0.0, 1.0), (0.0, math.nan), 1.0)]}, "is nan"),
        ({"patches": [FloorPatch((0.0, 0.0), (0.0, 0.0), 1.0, -1.0)]}, r"patch.radius_m\[0\] is -1"),
        ({"patches": [PATCH], "plant": "slip"}, r"plant slip .*\[\[patch\]\]"),
        ({"wheel_friction": (1.0, 0.0, 1.0)}, r"wheel_friction\[1\] is 0; allowed: a number from 0.001 to 10"),
        ({"wheel_drag": (1.0, -1.0, 1.0)}, r"wheel_drag\[1\] is -1"),
    ],
)
def test_a_floor_that_cannot_be_is_refused(options: dict[str, Any], what: str, make_world: Any) -> None:
    with pytest.raises(WorldError, match=what):
        make_world("three_wheel", **options)


def test_a_robot_file_has_a_number_for_all_wheels_or_one_each(robots: dict[str, Robot], make_world: Any) -> None:
    robot = robots["three_wheel"]

    def made(value: float | list[float]) -> World:
        simulation = {**robot.simulation, "wheel_friction": value}
        world: World = make_world(Robot(**{**vars(robot), "simulation": simulation}))
        return world

    assert list(made(0.5).c.config.wheel_friction)[:3] == [0.5, 0.5, 0.5]
    assert list(made([0.5, 0.6, 0.7]).c.config.wheel_friction)[:3] == [0.5, 0.6, 0.7]
    with pytest.raises(WorldError, match=r"simulation.wheel_friction has 2 numbers; 3 are needed"):
        made([0.5, 0.6])
    with pytest.raises(WorldError, match=r"simulation.wheel_friction is 11; must be a number from 0.001 to 10"):
        made([0.5, 0.6, 11.0])


SLOPE, UPHILL = 0.1, 0.7
TILT = {"floor_slope_rad": SLOPE, "floor_uphill_rad": UPHILL}


@pytest.mark.parametrize("heading", [0.0, 1.0])
def test_on_a_slope_free_wheels_roll_down_as_a_hoop_does(heading: float, any_robot: Robot, make_world: Any) -> None:
    """Each wheel adds J / r^2 along its direction; these squares sum to n / 2 in every direction."""
    world = make_world(any_robot, motor_viscous_N_m_s=0.0, slip_stiffness_N_s_m=1e6, **TILT, **NO_DRAG)
    world.set_bridges(*[OPEN[: world.wheels]] * 2)
    world.c.pose[2] = heading
    world.step(400)
    config = world.c.config
    wheels_kg = 0.5 * world.wheels * config.motor_inertia_kg_m2 / config.wheel_radius_m[0] ** 2
    speed = GRAVITY * math.sin(SLOPE) * 0.4 * config.mass_kg / (config.mass_kg + wheels_kg)
    assert world.twist[:2] == pytest.approx([-speed * math.cos(UPHILL), -speed * math.sin(UPHILL)], rel=0.01)


def test_on_a_slope_short_circuited_motors_hold_back_as_their_data_say(any_robot: Robot, make_world: Any) -> None:
    """Steady, with hardly any creep: m g sin a = n/2 (G + c) v. G: the wheel's friction and the winding's brake."""
    world = make_world(any_robot, coulomb_friction_N_m=0.0, slip_stiffness_N_s_m=1e6, **TILT)
    world.drive_voltage([0.0] * world.wheels)
    world.step(2000)
    c = world.c.config
    brake = (c.motor_viscous_N_m_s + c.motor_constant_N_m_A**2 / c.motor_resistance_ohm) / c.wheel_radius_m[0] ** 2
    held = 0.5 * world.wheels * (brake + c.roller_friction_N_s_m)
    speed = c.mass_kg * GRAVITY * math.sin(SLOPE) / held
    assert np.hypot(*world.twist[:2]) == pytest.approx(speed, rel=0.01)


def test_on_a_slope_the_lower_wheels_carry_more(any_robot: Robot, make_world: Any) -> None:
    """The loads' middle is where the plumb line through the centre of mass meets the floor: h tan a downhill."""
    height = 0.06
    springs = {"wheel_stiffness_N_m": 1e5, "wheel_damping_N_s_m": 100.0, "centre_of_mass_height_m": height}
    world = make_world(any_robot, **springs, **TILT)
    world.drive_voltage([0.0] * world.wheels)
    world.step(2000)
    loads = np.array(list(world.c.load_N)[: world.wheels])
    middle = loads @ (contacts(world) - world.truth[:2]) / loads.sum()
    shift = -height * math.tan(SLOPE)
    assert middle == pytest.approx([shift * math.cos(UPHILL), shift * math.sin(UPHILL)], rel=0.02)
    assert loads.sum() == pytest.approx(world.c.config.mass_kg * GRAVITY * math.cos(SLOPE), rel=1e-3)


@pytest.mark.full
def test_the_page_says_what_play_costs_a_robot_with_fixes() -> None:
    what = "play of 0.05 rad (2.9°)"
    found = [error[0] for error in errors(changed(load_scenario("demo"))[what])]
    assert f"| {what} | {min(found):.2f} to {max(found):.2f} |" in PAGE.read_text(encoding="utf-8")


@pytest.mark.nightly
def test_the_page_has_the_whole_table() -> None:
    assert "\n".join(table()) in PAGE.read_text(encoding="utf-8")
