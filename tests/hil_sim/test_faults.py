# SPDX-License-Identifier: MIT
"""Every fault does what its name says, from its start up to its stop."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hil_sim.faults import KINDS, MAX_FAULTS, NAMES, Fault
from hil_sim.world import PoseSensor, World, WorldError
from omniwheel._core import lib

CHIP = 0x40
AWAKE = bytes([CHIP, 2, 0x00, 0x21, 0])


def spinning(make_world: Any, *faults: Fault, **options: Any) -> World:
    world: World = make_world(faults=faults, **options)
    world.set_duty([0.5] * 3)
    world.step(100)
    return world


def counts(world: World) -> list[int]:
    return list(world.sense().counts)[: world.wheels]


def test_names_and_kinds_cover_the_c_enumeration() -> None:
    assert sorted(KINDS.values()) == list(range(1, lib.HIL_FAULT_KIND_COUNT))
    assert {NAMES[kind] for kind in KINDS.values()} == set(KINDS)


def test_unknown_name_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'gremlin' is unknown; must be one of encoder_stuck"):
        Fault("gremlin", 0.0)


def test_encoder_stuck_stands_still_and_goes_on_from_there(make_world: Any) -> None:
    world = spinning(make_world, Fault("encoder_stuck", 0.1, 0.2, wheel=1))
    before = counts(world)
    world.step(100)
    after = counts(world)
    assert after[1] == before[1]
    assert after[0] > before[0]
    world.step(1)
    assert 0 < counts(world)[1] - after[1] < 10
    assert world.sense().counts_valid == 0b111


def test_encoder_reversed_counts_back(make_world: Any) -> None:
    world = spinning(make_world, Fault("encoder_reversed", 0.1, wheel=2))
    before = counts(world)
    world.step(100)
    after = counts(world)
    assert after[0] - before[0] > 50
    assert after[2] - before[2] == -(after[0] - before[0])


def test_encoder_invalid_clears_its_bit(make_world: Any) -> None:
    world = spinning(make_world, Fault("encoder_invalid", 0.1, 0.15, wheel=1))
    assert world.sense().counts_valid == 0b101
    world.step(50)
    assert world.sense().counts_valid == 0b111


@pytest.mark.parametrize(("name", "status"), [("i2c_nack", 1), ("i2c_stuck", 2)])
def test_i2c_faults_keep_the_last_duty(make_world: Any, name: str, status: int) -> None:
    world = spinning(make_world, Fault(name, 0.1, 0.2))
    assert world.sense().i2c_status == 0
    world.set_duty([0.0] * 3)
    world.step(99)
    assert world.sense().i2c_status == status
    assert list(world.c.in2)[:3] == [0.5] * 3
    assert world.wheel_rad_s[0] > 1.0
    world.step()
    world.set_duty([0.0] * 3)
    world.step()
    assert world.sense().i2c_status == 0
    assert list(world.c.in2)[:3] == [1.0] * 3


@pytest.mark.parametrize(("name", "status"), [("i2c_nack", 1), ("i2c_stuck", 2)])
def test_i2c_faults_reach_the_chip(make_world: Any, name: str, status: int) -> None:
    world = make_world(faults=[Fault(name, 0.0, 0.001)])
    world.i2c(AWAKE)
    assert world.sense().i2c_status == status
    assert world.c.chip.registers[0] == 0x11
    world.step()
    world.i2c(AWAKE)
    assert world.sense().i2c_status == 0
    assert world.c.chip.registers[0] == 0x21


def test_no_transactions_no_error(make_world: Any) -> None:
    world = make_world(faults=[Fault("i2c_nack", 0.0)])
    world.i2c(b"")
    assert world.sense().i2c_status == 0


def test_link_silence(make_world: Any) -> None:
    world = spinning(make_world, Fault("link_silence", 0.1, 0.2))
    assert world.sense().link_silent
    world.step(100)
    assert not world.sense().link_silent


def test_the_stop_button_is_open_while_it_is_pressed(make_world: Any) -> None:
    world = spinning(make_world, Fault("stop_button", 0.1, 0.2))
    assert world.sense().stop_button
    world.step(100)
    assert not world.sense().stop_button


def fix_times(world: World, ticks: int) -> list[int]:
    found = []
    for _ in range(ticks):
        sensors = world.sense()
        found += [sensors.fix.taken_us] if sensors.has_fix else []
        world.step()
    return found


def test_pose_loss(make_world: Any) -> None:
    sensor = PoseSensor(rate_Hz=100, delay_s=0.0)
    world = make_world(pose_sensor=sensor, faults=[Fault("pose_loss", 0.02, 0.05)])
    assert fix_times(world, 80) == [0, 10000, 50000, 60000, 70000]


def test_pose_jump(make_world: Any) -> None:
    sensor = PoseSensor(rate_Hz=100, delay_s=0.0, sd_xy_m=0.0, sd_theta_rad=0.0)
    world = make_world(pose_sensor=sensor, faults=[Fault("pose_jump", 0.01, 0.02, value=0.7)])
    poses: list[list[float]] = []
    for _ in range(30):
        sensors = world.sense()
        poses += [list(sensors.fix.pose)] if sensors.has_fix else []
        world.step()
    assert np.allclose(np.array(poses), np.array([[0, 0, 0], [0.7, 0, 0], [0, 0, 0]]))


def test_battery_sag(make_world: Any) -> None:
    world = spinning(make_world, Fault("battery_sag", 0.1, 0.2, value=7.0))
    assert world.sense().battery_V > 11.0
    world.step(100)
    assert 6.5 < world.sense().battery_V < 7.0
    world.step()
    assert world.sense().battery_V > 11.0


def test_motor_dead_coasts(make_world: Any) -> None:
    world = spinning(make_world, Fault("motor_dead", 0.1, wheel=0))
    assert world.c.current_A[0] > 1.0
    world.step(100)
    assert world.c.current_A[0] == 0.0
    assert world.c.voltage_V[0] == 0.0
    assert world.c.current_A[1] > 1.0


def test_several_faults_at_once(make_world: Any) -> None:
    both = [Fault("encoder_invalid", 0.0, wheel=0), Fault("encoder_invalid", 0.0, wheel=2)]
    assert make_world(faults=both).sense().counts_valid == 0b010


def test_too_many_faults_are_refused(make_world: Any) -> None:
    with pytest.raises(WorldError, match=r"17 faults.* at most 16"):
        make_world(faults=[Fault("pose_loss", 0.0)] * (MAX_FAULTS + 1))


@pytest.mark.parametrize(
    ("fault", "field"),
    [
        (Fault("motor_dead", 0.0, wheel=3), "fault.wheel[0] is 3"),
        (Fault("pose_loss", -1.0), "fault.start_s[0] is -1"),
        (Fault("pose_loss", 2.0, 1.0), "fault.stop_s[0] is 1"),
        (Fault("pose_loss", math.nan), "fault.start_s[0] is nan"),
        (Fault("battery_sag", 0.0, value=-1.0), "fault.value[0] is -1"),
        (Fault("pose_jump", 0.0, value=math.inf), "fault.value[0] is inf"),
    ],
)
def test_nonsense_faults_are_refused(make_world: Any, fault: Fault, field: str) -> None:
    with pytest.raises(WorldError) as refused:
        make_world(faults=[fault])
    assert field in str(refused.value)
