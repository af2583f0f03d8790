# SPDX-License-Identifier: MIT
"""Play of the gears, beside what momentum, energy and a spring between the teeth say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hil_sim.faults import Fault
from hil_sim.world import World, WorldError
from omni_schema import Robot
from omniwheel._core import lib

PLAY = 0.02
SHARE = 0.3
IN_THE_AIR = {"friction_coefficient": 1e-9, "roller_friction_N_s_m": 0.0, "floor_slope_rad": 0.0}
NO_FRICTION = {"motor_viscous_N_m_s": 0.0, "coulomb_friction_N_m": 0.0}


@pytest.fixture
def played(make_world: Any) -> Any:
    """A world whose gears have play."""

    def make(robot: Robot | str = "three_wheel", **options: Any) -> World:
        world: World = make_world(robot, **{"backlash_rad": PLAY, "wheel_inertia_share": SHARE, **options})
        return world

    return make


def encoder_rad(world: World, wheel: int = 0) -> float:
    """What the encoder says the wheel has turned, to one count."""
    config = world.c.config
    edges = world.c.counts[wheel] * config.encoder_direction[wheel]
    return float(edges * 2.0 * math.pi / config.counts_per_revolution)


def step_rad(world: World) -> float:
    """Angle of one count."""
    return float(2.0 * math.pi / world.c.config.counts_per_revolution)


def test_the_share_of_the_inertia_counts_for_nothing_without_play(any_robot: Robot, make_world: Any) -> None:
    worlds = [make_world(any_robot, wheel_inertia_share=share) for share in (0.1, 0.6)]
    for world in worlds:
        world.drive_voltage([6.0, -2.0, 1.0, 3.0][: world.wheels])
        world.step(300)
    assert (worlds[0].truth == worlds[1].truth).all()
    assert list(worlds[0].c.gap_rad) == [0.0] * 4


def test_after_a_reversal_the_motor_turns_by_the_play_before_the_wheel_moves(any_robot: Robot, played: Any) -> None:
    world = played(any_robot)
    world.drive_voltage([2.0] * world.wheels)
    world.step(300)
    world.drive_voltage([0.0] * world.wheels)
    world.step(3000)
    side = world.c.mesh[0] if world.c.mesh[0] != 0.0 else math.copysign(1.0, world.c.gap_rad[0])
    world.drive_voltage([side * 2.0] * world.wheels)
    world.step(300)  # now the motor certainly pushes on this side
    world.drive_voltage([0.0] * world.wheels)
    world.step(3000)
    slack = PLAY / 2 + world.c.gap_rad[0] * side
    begin, wheel = encoder_rad(world), world.c.wheel_angle_rad[0]
    world.drive_voltage([-side * 2.0] * world.wheels)
    for _ in range(200):
        world.step()
        if world.c.mesh[0] == -side:
            break
        assert abs(world.c.wheel_angle_rad[0] - wheel) < 1e-4
    assert world.c.mesh[0] == -side
    assert abs(encoder_rad(world) - begin) == pytest.approx(slack, abs=3 * step_rad(world))


def test_what_the_encoder_counts_is_within_the_play_of_the_wheel_and_uses_all_of_it(played: Any) -> None:
    world = played("fast_three_wheel", rollers_per_row=9, row_distance_m=0.018)
    random, apart = np.random.default_rng(3), []
    for _ in range(60):
        world.drive_voltage(random.uniform(-8.0, 8.0, 3))
        for _ in range(40):
            world.step()
            apart.append([encoder_rad(world, i) - world.c.wheel_angle_rad[i] for i in range(3)])
    slack = step_rad(world)
    assert np.min(apart) > -PLAY / 2 - slack
    assert np.max(apart) < PLAY / 2 + slack
    assert np.ptp(apart, axis=0) == pytest.approx([PLAY] * 3, abs=2 * slack)


def test_a_free_motor_meets_its_wheel_when_the_gap_is_gone_and_momentum_stays(played: Any) -> None:
    """Without friction: at 5 rad/s through half the play, then both turn with (1 - s) of that."""
    world = played(**IN_THE_AIR, **NO_FRICTION)
    world.drive_torque([0.0] * 3)
    inertia = world.c.config.motor_inertia_kg_m2
    for wheel in range(3):
        world.c.motor_rad_s[wheel] = 5.0
    before = lib.hil_world_kinetic_energy(world.c)
    assert before == pytest.approx(3 * 0.5 * (1 - SHARE) * inertia * 25.0)
    ticks = 0
    while world.c.mesh[0] == 0.0:
        assert world.wheel_rad_s[0] == 0.0
        world.step()
        ticks += 1
    assert ticks == math.ceil(PLAY / 2 / 5.0 / 1e-3)
    assert world.wheel_rad_s == pytest.approx([5.0 * (1 - SHARE)] * 3, rel=1e-9)
    lost = 3 * 0.5 * SHARE * (1 - SHARE) * inertia * 25.0
    assert lib.hil_world_kinetic_energy(world.c) == pytest.approx(before - lost, rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_without_supply_energy_only_falls(seed: int, any_robot: Robot, played: Any) -> None:
    world = played(any_robot)
    random = np.random.default_rng(seed)
    world.drive_torque([0.0] * world.wheels)
    world.c.twist = random.uniform(-1.0, 1.0, 3).tolist()
    for wheel in range(world.wheels):
        world.c.wheel_rad_s[wheel], world.c.motor_rad_s[wheel] = random.uniform(-10.0, 10.0, 2)
    energy = lib.hil_world_kinetic_energy(world.c)
    for _ in range(500):
        world.step()
        now = lib.hil_world_kinetic_energy(world.c)
        assert now <= energy * (1.0 + 1e-9)
        energy = now
    assert energy < 0.1


def test_driven_one_way_a_robot_moves_as_without_play(any_robot: Robot, played: Any) -> None:
    """While it speeds up its teeth touch all the time."""
    without, world = played(any_robot, backlash_rad=0.0), played(any_robot)
    for wheel in range(world.wheels):
        world.c.mesh[wheel], world.c.gap_rad[wheel] = 1.0, PLAY / 2
    for each in (without, world):
        each.drive_voltage([6.0] * world.wheels)
        each.step(60)
    assert list(world.c.mesh)[: world.wheels] == [1.0] * world.wheels
    assert (world.truth == without.truth).all()
    assert (world.wheel_rad_s == without.wheel_rad_s).all()


def stiff_teeth(world: World, state: list[float], volts: float, end_s: float) -> list[float]:
    """Angles and speeds of motor and wheel, and the current, after a time by SciPy's Radau.

    Teeth that are pressed in push back as a stiff spring; a damper that grows with the depth takes the bounce away.
    """
    c = world.c.config
    motor_J, wheel_J = (1 - SHARE) * c.motor_inertia_kg_m2, SHARE * c.motor_inertia_kg_m2

    def rates(_: float, now: Any) -> list[float]:
        motor, wheel, motor_w, wheel_w, current = now
        apart = motor - wheel
        depth = max(abs(apart) - PLAY / 2, 0.0)
        torque = 1e4 * depth * max(1.0 + 3.0 * math.copysign(1.0, apart) * (motor_w - wheel_w), 0.0)
        torque = math.copysign(torque, apart)
        coulomb = c.motor_coulomb_N_m * motor_w / math.hypot(motor_w, 0.01)
        drive = c.motor_constant_N_m_A * current - c.motor_viscous_N_m_s * motor_w - coulomb
        slope = (volts - c.motor_resistance_ohm * current - c.motor_constant_N_m_A * motor_w) / c.motor_inductance_H
        return [motor_w, wheel_w, (drive - torque) / motor_J, torque / wheel_J, slope]

    run = solve_ivp(rates, (0.0, end_s), state, method="Radau", rtol=1e-6, atol=1e-8, max_step=2e-3)
    assert run.success
    end: list[float] = run.y[:, -1].tolist()
    return end


@pytest.mark.full
def test_a_wheel_in_the_air_is_where_stiff_teeth_would_have_it(played: Any) -> None:
    """Back and forth: motor and wheel part when the motor slows down, and meet on the other side."""
    world = played("fast_three_wheel", **IN_THE_AIR)
    state = [0.0] * 5
    for volts in (3.0, -3.0, 3.0, -3.0):
        world.drive_voltage([volts] * 3)
        world.step(100)
        state = stiff_teeth(world, state, volts, 0.1)
        assert world.c.wheel_angle_rad[0] == pytest.approx(state[1], abs=2e-3)
        assert world.c.wheel_angle_rad[0] + world.c.gap_rad[0] == pytest.approx(state[0], abs=2e-3)


def test_behind_a_blocked_wheel_the_motor_turns_by_the_play(played: Any) -> None:
    world = played(faults=[Fault("motor_stalled", 0.0, wheel=0)])
    turned = []
    for volts in (3.0, -3.0, 3.0):
        world.drive_voltage([volts, 0.0, 0.0])
        world.step(300)
        turned.append(encoder_rad(world))
    slack = 2 * step_rad(world)
    assert turned == pytest.approx([PLAY / 2, -PLAY / 2, PLAY / 2], abs=slack)
    assert world.c.wheel_angle_rad[0] == 0.0


def test_a_hand_turns_the_wheel_by_the_play_before_the_motor_follows(played: Any) -> None:
    world = played(faults=[Fault("wheel_turned", 0.0, wheel=0, value=1.0)])
    world.set_bridges([0] * 4, [0] * 4)
    world.step(9)
    assert abs(encoder_rad(world)) <= step_rad(world)
    world.step(91)
    assert encoder_rad(world) == pytest.approx(0.1 - PLAY / 2, abs=2 * step_rad(world))


@pytest.mark.parametrize("step_us", [100, 250, 2500])
def test_tick_length_hardly_matters(step_us: int, played: Any) -> None:
    world, usual = played(), played()
    for each, length in ((world, step_us), (usual, 1000)):
        for volts in (6.0, -6.0, 3.0):
            each.drive_voltage([volts] * 3)
            each.step(100_000 // length, length)
    assert world.truth == pytest.approx(usual.truth, abs=5e-4)


@pytest.mark.parametrize(
    ("name", "value"), [("backlash_rad", 0.6), ("backlash_rad", -0.1), ("wheel_inertia_share", 0.0)]
)
def test_play_that_cannot_be_is_refused(name: str, value: float, played: Any) -> None:
    with pytest.raises(WorldError, match=rf"{name} is {value:g}; allowed: a number from"):
        played(**{name: value})
