# SPDX-License-Identifier: MIT
"""Overcurrent, heat and a supply that limits its current, beside closed forms and windings switched in microseconds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hil_sim.world import World
from omniwheel._core import ffi

STEP_S, RETRY_S, DIODES_V = 1e-6, 3e-3, 1.6
TICK_S = 1e-3
ROBOTS = ["three_wheel", "fast_three_wheel"]


@pytest.fixture
def limited(make_world: Any) -> Any:
    """A world with these numbers, whose wheels stand still by their friction."""

    def make(robot: str = "three_wheel", **numbers: float) -> World:
        world = make_world(robot)
        for name, value in {"motor_coulomb_N_m": 1e6, "battery_resistance_ohm": 0.0, **numbers}.items():
            setattr(world.c.config, name, value)
        return World(ffi.addressof(world.c, "config"))

    return make


def opened_A(config: Any, volts: float, seconds: float) -> np.ndarray[Any, Any]:
    """Return the current, microsecond by microsecond, of a standing motor whose bridge opens for 3 ms at a current."""
    current_A, off_s, seen = 0.0, 0.0, []
    for _ in range(round(seconds / STEP_S)):
        if off_s <= 0.0 and current_A > config.bridge_overcurrent_A:
            off_s = RETRY_S
        given_V = volts if off_s <= 0.0 else -(volts + DIODES_V)
        current_A += STEP_S * (given_V - config.motor_resistance_ohm * current_A) / config.motor_inductance_H
        current_A = max(current_A, 0.0)
        off_s -= STEP_S
        seen.append(current_A)
    return np.array(seen)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("over_A", [2.0, 3.7])
def test_a_bridge_opens_at_too_much_current_and_tries_again(limited: Any, robot: str, over_A: float) -> None:
    world, seconds = limited(robot, bridge_overcurrent_A=over_A), 0.2
    world.set_duty([1.0, -1.0, 1.0])
    for _ in range(round(seconds / TICK_S)):
        world.step()
        assert 0.0 <= world.c.current_A[0] <= over_A
        assert world.c.current_A[1] == pytest.approx(-world.c.current_A[0])
    current_A = opened_A(world.c.config, world.c.config.battery_V, seconds)
    trips = np.count_nonzero(np.diff((current_A > over_A).astype(int)) == 1)
    assert list(world.c.bridge_trips)[:3] == pytest.approx([trips] * 3, rel=0.06), "of some 4 ms, in steps of 0.25 ms"


def test_a_current_that_is_never_reached_opens_nothing_and_changes_no_bit(limited: Any) -> None:
    worlds = [limited(motor_coulomb_N_m=0.05, **numbers) for numbers in ({}, {"bridge_overcurrent_A": 900.0})]
    for world in worlds:
        world.set_duty([0.5, -0.2, 0.1])
        world.step(300)
        assert world.c.bridge_trips[0] == 0.0
    assert (worlds[0].truth == worlds[1].truth).all()
    assert list(worlds[0].c.current_A) == list(worlds[1].c.current_A)


@pytest.mark.parametrize("robot", ROBOTS)
def test_winding_and_bridge_warm_by_the_exact_exponential_and_cool_by_it(limited: Any, robot: str) -> None:
    world = limited(robot, winding_thermal_K_W=9.0, winding_thermal_s=0.7, bridge_thermal_K_W=5.0, bridge_thermal_s=0.2)
    config = world.c.config
    world.set_duty([0.5] * 3)
    world.step(50)
    current_A = world.c.current_A[0]
    assert current_A == pytest.approx(0.5 * config.battery_V / config.motor_resistance_ohm, rel=1e-6)
    ends = {}
    for name, ohm, per_W, tau_s in (
        ("winding_K", config.motor_resistance_ohm, 9.0, 0.7),
        ("bridge_K", config.bridge_resistance_ohm, 5.0, 0.2),
    ):
        ends[name] = (getattr(world.c, name)[0], per_W * ohm * current_A**2, tau_s)
    world.step(400)
    for name, (begin_K, goal_K, tau_s) in ends.items():
        exact_K = goal_K + (begin_K - goal_K) * math.exp(-0.4 / tau_s)
        assert getattr(world.c, name)[0] == pytest.approx(exact_K, rel=1e-6)
    hot = {name: getattr(world.c, name)[0] for name in ends}
    world.set_bridges([0] * 3, [0] * 3)
    world.step(20)
    assert world.c.current_A[0] == 0.0
    world.step(280)
    for name, (_, _, tau_s) in ends.items():
        assert getattr(world.c, name)[0] == pytest.approx(hot[name] * math.exp(-0.3 / tau_s), rel=0.02)


def test_a_bridge_that_is_too_hot_opens_until_it_is_40_K_cooler(limited: Any) -> None:
    tau_s, per_W = 0.1, 41.1
    world = limited(bridge_thermal_K_W=per_W, bridge_thermal_s=tau_s)
    config = world.c.config
    current_A = config.battery_V / config.motor_resistance_ohm
    goal_K, off_K = per_W * config.bridge_resistance_ohm * current_A**2, config.bridge_shutdown_K
    assert goal_K > 2.0 * off_K
    world.set_duty([1.0] * 3)
    times = []
    for tick in range(300):
        was = world.c.bridge_off[0]
        world.step()
        if world.c.bridge_off[0] != was:
            times.append(tick * TICK_S)
    heat_s = -tau_s * math.log1p(-off_K / goal_K)
    cool_s = tau_s * math.log(off_K / (off_K - 40.0))
    again_s = tau_s * math.log((goal_K - off_K + 40.0) / (goal_K - off_K))
    assert times[:3] == pytest.approx([heat_s, heat_s + cool_s, heat_s + cool_s + again_s], abs=4e-3)
    assert world.c.bridge_trips[0] == math.ceil(len(times) / 2)


def sagging_V(config: Any, duty: float, seconds: float) -> tuple[float, float]:
    """Return lowest and last voltage of a supply with a limit that drives standing motors, in microseconds."""
    volts, current_A, lowest = config.battery_V, 0.0, config.battery_V
    for _ in range(round(seconds / STEP_S)):
        load_A = config.wheels * duty * current_A
        volts += STEP_S * (config.supply_limit_A - load_A) / config.supply_capacitance_F
        volts = min(max(volts, 0.0), config.battery_V)
        current_A += STEP_S * (duty * volts - config.motor_resistance_ohm * current_A) / config.motor_inductance_H
        lowest = min(lowest, volts)
    return lowest, volts


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("duty", [1.0, 0.8])
def test_a_supply_with_a_limit_sags_to_what_its_load_leaves(limited: Any, robot: str, duty: float) -> None:
    limit_A = 4.0
    world = limited(robot, supply_limit_A=limit_A)
    config = world.c.config
    world.set_duty([duty] * 3)
    seen = []
    for _ in range(50):
        world.step()
        seen.append(world.c.supply_V)
    steps = round(duty * 4096) / 4096
    lowest_V, last_V = sagging_V(config, steps, 0.05)
    assert seen[-1] == pytest.approx(limit_A * config.motor_resistance_ohm / (3.0 * steps**2), rel=1e-3), "closed form"
    assert seen[-1] == pytest.approx(last_V, rel=1e-3)
    assert min(seen) == pytest.approx(lowest_V, abs=0.35), "seen once a tick"
    world.set_duty([0.0] * 3)
    world.step(30)
    assert world.c.supply_V == pytest.approx(config.battery_V, rel=1e-9), "the capacitor is full again"


def test_a_supply_whose_limit_is_never_reached_changes_no_bit(limited: Any) -> None:
    worlds = [limited(motor_coulomb_N_m=0.05, **numbers) for numbers in ({}, {"supply_limit_A": 900.0})]
    for world in worlds:
        world.set_duty([0.5, -0.2, 0.1])
        world.step(300)
    assert (worlds[0].truth == worlds[1].truth).all()


def test_behind_gears_with_play_a_bridge_opens_as_well(limited: Any) -> None:
    trips = []
    for play_rad in (0.0, 0.01):
        world = limited(bridge_overcurrent_A=2.0, backlash_rad=play_rad)
        world.set_duty([1.0] * 3)
        world.step(400)
        trips.append(world.c.bridge_trips[0])
    assert trips[1] == pytest.approx(trips[0], rel=0.1)
    assert trips[0] > 50.0
