# SPDX-License-Identifier: MIT
"""A bridge that chops at its trip current, beside a winding that is switched microsecond by microsecond."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hil_sim.world import World
from omni_schema import Robot
from omniwheel._core import ffi

STEP_S, OFF_S = 1e-6, 25e-6
TRIP_A = 2.0


@pytest.fixture
def tripping(make_world: Any) -> Any:
    """A world whose bridges trip, heavy enough to stand still."""

    def make(trip_A: float, robot: Robot | str = "three_wheel", **numbers: float) -> World:
        world = make_world(robot)
        for name, value in {"bridge_trip_A": trip_A, **numbers}.items():
            setattr(world.c.config, name, value)
        return World(ffi.addressof(world.c, "config"))

    return make


def chopped_mean_A(config: Any, volts: float, speed_rad_s: float) -> float:
    """Return the mean current of a winding whose bridge shorts it for OFF_S each time it reaches TRIP_A."""
    emf_V = config.motor_constant_N_m_A * speed_rad_s
    current_A, off_s, seen = 0.0, 0.0, []
    for number in range(20_000):
        if current_A >= TRIP_A and off_s <= 0.0:
            off_s = OFF_S
        given_V = 0.0 if off_s > 0.0 else volts
        off_s -= STEP_S
        fall_V = config.motor_resistance_ohm * current_A + emf_V
        current_A += STEP_S * (given_V - fall_V) / config.motor_inductance_H
        if number >= 10_000:
            seen.append(current_A)
    return float(np.mean(seen))


@pytest.mark.parametrize("volts", [12.0, -12.0, 8.0])
def test_the_current_is_that_of_a_chopping_bridge(tripping: Any, volts: float) -> None:
    world = tripping(TRIP_A, motor_coulomb_N_m=1e6, battery_resistance_ohm=0.0)
    world.drive_voltage([volts] * 3)
    world.step(50)
    assert np.abs(world.wheel_rad_s).max() < 1e-3, "it stands"
    current_A = np.array(list(world.c.current_A)[:3])
    expected_A = chopped_mean_A(world.c.config, abs(volts), 0.0)
    assert current_A == pytest.approx(np.full(3, np.sign(volts) * expected_A), rel=0.01)


def test_a_wheel_that_turns_back_is_driven_no_harder(tripping: Any) -> None:
    """From full speed one way to full voltage the other: without the limit the winding gets twice the stall current."""
    peaks = {}
    for trip_A in (0.0, TRIP_A):
        world = tripping(trip_A, friction_coefficient=10.0)
        world.drive_voltage([12.0] * 3)
        world.step(1500)
        world.drive_voltage([-12.0] * 3)
        seen = []
        for _ in range(100):
            world.step()
            seen.append(np.abs(list(world.c.current_A)[:3]).max())
        peaks[trip_A] = max(seen)
    assert peaks[0.0] > 2.0 * TRIP_A
    assert peaks[TRIP_A] <= TRIP_A


def test_a_shorted_winding_is_not_limited(tripping: Any) -> None:
    currents = []
    for trip_A in (0.0, 0.05):
        world = tripping(trip_A)
        world.c.wheel_rad_s[0] = 5.0
        world.drive_voltage([0.0] * 3)
        world.step()
        currents.append(world.c.current_A[0])
    assert currents[0] == currents[1]
    assert abs(currents[0]) > 0.05


def test_a_trip_current_that_is_never_reached_changes_no_bit(tripping: Any, any_robot: Robot) -> None:
    worlds = [tripping(trip_A, any_robot) for trip_A in (0.0, 900.0)]
    for world in worlds:
        world.drive_voltage([6.0, -2.0, 1.0, 3.0][: world.wheels])
        world.step(300)
    assert (worlds[0].truth == worlds[1].truth).all()
