# SPDX-License-Identifier: MIT
"""Faults of counters, chip, pose sensor and clock: each does what its name says, from its start up to its stop."""

from __future__ import annotations

from typing import Any

import pytest

from hil_sim.faults import Fault
from hil_sim.world import PoseSensor, World, WorldError
from omniwheel._core import lib

EXACT = PoseSensor(rate_Hz=100, delay_s=0.0, sd_xy_m=0.0, sd_theta_rad=0.0)


def moving(make_world: Any, *faults: Fault, **options: Any) -> World:
    world: World = make_world(faults=faults, **options)
    world.set_duty([0.5] * 3)
    world.step(100)
    return world


def counts(world: World) -> list[int]:
    return list(world.sense().counts)[: world.wheels]


def test_a_stalled_motor_stands_still_and_draws_its_stall_current(make_world: Any) -> None:
    world = moving(make_world, Fault("motor_stalled", 0.1, 0.2, wheel=1))
    before = counts(world)
    world.step(100)
    assert counts(world)[1] == before[1]
    assert counts(world)[0] > before[0]
    assert world.c.current_A[1] > 1.3 * world.c.current_A[0]
    world.step(100)
    assert world.wheel_rad_s[1] > 0.5


def test_a_noisy_encoder_is_off_by_up_to_its_value_and_the_same_for_the_same_tick(make_world: Any) -> None:
    world = moving(make_world, Fault("encoder_noisy", 0.1, wheel=0, value=20.0))
    errors = []
    for _ in range(200):
        seen = counts(world)
        assert seen == counts(world)
        errors.append(seen[0] - world.c.counts[0])
        assert seen[1:] == list(world.c.counts)[1:3]
        world.step()
    assert -20 <= min(errors) < -10
    assert 10 < max(errors) <= 20
    assert abs(sum(errors)) < 5 * 200


def test_a_stuck_bit_always_reads_one(make_world: Any) -> None:
    world = moving(make_world, Fault("encoder_bit", 0.1, wheel=2, value=6))
    for _ in range(100):
        assert counts(world)[2] & 64
        assert counts(world)[2] & ~64 == world.c.counts[2] & ~64
        world.step()


def test_a_chip_without_power_is_silent_lets_the_motors_coast_and_forgets(make_world: Any) -> None:
    world = moving(make_world, Fault("chip_power", 0.1, 0.15))
    world.c.chip.registers[0] = 0x20
    world.step()
    assert list(world.c.in1) == [0.0] * 4
    world.i2c(bytes([0x40, 2, 0x00, 0x21, 0]))
    assert world.sense().i2c_status == 1
    world.step(49)
    world.i2c(bytes([0x40, 1, 0x00, 1]))
    assert world.sense().i2c_status == 0
    assert world.sense().i2c_read[0] == 0x11, "the power-up value"


def fixes(world: World, ticks: int) -> list[tuple[int, int, float]]:
    """Return tick, time stamp [us] and angle of each fix."""
    found = []
    for tick in range(ticks):
        sensors = world.sense()
        if sensors.has_fix:
            found.append((tick, int(sensors.fix.taken_us), float(sensors.fix.pose[2])))
        world.step()
    return found


def test_a_frozen_pose_sensor_repeats_itself(make_world: Any) -> None:
    world = make_world(pose_sensor=EXACT, faults=[Fault("pose_freeze", 0.3, 0.4)])
    world.set_duty([0.5] * 3)
    angles = [angle for _, _, angle in fixes(world, 500)]
    assert len(angles) == 50
    assert len(set(angles[29:40])) == 1
    assert len(set(angles[:30])) > 25
    assert angles[45] > angles[35]


def test_late_fixes_claim_to_be_fresh(make_world: Any) -> None:
    usual, late = (
        make_world(pose_sensor=EXACT, faults=faults) for faults in ([], [Fault("pose_delay", 0.1, value=0.05)])
    )
    for world in (usual, late):
        world.set_duty([0.5] * 3)
    on_time = {tick: angle for tick, _, angle in fixes(usual, 400)}
    for tick, stamp, angle in fixes(late, 400):
        if tick > 150:
            assert stamp == tick * 1000
            assert angle == on_time[tick - 50]


def test_clock_faults_move_the_robots_clock_only(make_world: Any) -> None:
    world = make_world(
        faults=[
            Fault("clock_jump", 0.010, 0.020, value=0.5),
            Fault("clock_jump", 0.030, 0.040, value=-10.0),
            Fault("clock_stuck", 0.050, 0.060),
        ]
    )
    seen = {}
    for tick in range(70):
        assert world.c.time_us == tick * 1000
        seen[tick] = int(world.sense().time_us)
        world.step()
    assert (seen[9], seen[10], seen[19], seen[20]) == (9000, 510_000, 519_000, 20_000)
    assert (seen[30], seen[39], seen[40]) == (0, 0, 40_000)
    assert {seen[tick] for tick in range(50, 60)} == {50_000}
    assert seen[60] == 60_000


def test_late_ticks_give_the_world_more_time(make_world: Any) -> None:
    world = make_world(faults=[Fault("tick_late", 0.005, value=0.002)])
    assert lib.hil_world_tick_us(world.c, 1000) == 1000
    world.step(5)
    assert lib.hil_world_tick_us(world.c, 1000) == 2000


@pytest.mark.parametrize(
    ("fault", "allowed"),
    [
        (Fault("encoder_bit", 0.0, value=32), "a number from 0 to 31"),
        (Fault("encoder_noisy", 0.0, value=-1), "a number from 0 to 1000000 counts"),
        (Fault("pose_delay", 0.0, value=2), "a number from 0 to 1 s"),
        (Fault("clock_jump", 0.0, value=1e4), "a number from -1000 to 1000 s"),
        (Fault("tick_late", 0.0, value=0.0), "a number from 0.0001 to 0.1 s"),
    ],
)
def test_impossible_values_are_refused(make_world: Any, fault: Fault, allowed: str) -> None:
    with pytest.raises(WorldError) as refused:
        make_world(faults=[fault])
    assert allowed in str(refused.value)
