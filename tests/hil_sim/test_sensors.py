# SPDX-License-Identifier: MIT
"""Encoders, pose sensor, imposed slip: what they measure, when, and with which noise."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hil_sim.world import PoseSensor, World
from omni_schema import Robot
from omniwheel._core import ffi, lib

TICK_US = 1000


def fixes_of(world: World, ticks: int) -> list[tuple[int, int, list[float]]]:
    """Run and collect (time of arrival, time taken, pose) of every fix."""
    found = []
    for _ in range(ticks):
        sensors = world.sense()
        if sensors.has_fix:
            found.append((sensors.time_us, sensors.fix.taken_us, list(sensors.fix.pose)))
        world.step()
    return found


def test_counts_are_the_floor_of_the_angle(any_robot: Robot, make_world: Any) -> None:
    world = make_world(any_robot)
    world.set_duty([0.6, -0.5, 0.4, -0.3][: world.wheels])
    for _ in range(300):
        world.step()
        counts = list(world.sense().counts)[: world.wheels]
        angles = list(world.c.wheel_angle_rad)[: world.wheels]
        assert counts == [math.floor(angle * 10000 / (2 * math.pi)) for angle in angles]


def test_encoder_direction(robots: dict[str, Robot], make_world: Any) -> None:
    robot = robots["three_wheel"]
    swapped = Robot(**{**vars(robot), "encoder": {**robot.encoder, "direction": [-1, 1, 1]}})
    world = make_world(swapped)
    world.set_duty([0.5] * 3)
    world.step(500)
    counts = list(world.sense().counts)
    assert counts[1] > 100
    assert counts[0] == -counts[1]
    assert counts[3] == 0


@pytest.mark.parametrize(("direction", "start"), [(1.0, 2**31 - 5), (-1.0, -(2**31) + 5)])
def test_counts_wrap_like_a_hardware_counter(make_world: Any, direction: float, start: int) -> None:
    world = make_world("three_wheel")
    world.c.counts[0] = start
    world.set_duty([direction] * 3)
    world.step(200)
    counts = world.sense().counts
    passed = counts[1]
    assert abs(passed) > 100
    assert counts[0] == (start + passed + 2**31) % 2**32 - 2**31


def test_fixes_come_at_their_rate_with_their_delay(make_world: Any) -> None:
    world = make_world(pose_sensor=PoseSensor(rate_Hz=50, delay_s=0.0125))
    found = fixes_of(world, 200)
    assert [taken for _, taken, _ in found] == [k * 20000 for k in range(10)]
    assert all(arrived == taken + 13000 for arrived, taken, _ in found), "on the first tick after 12.5 ms"


def test_noiseless_fixes_are_the_truth_of_their_time(make_world: Any) -> None:
    """Also between ticks: 30 Hz falls on no whole millisecond."""
    world = make_world(pose_sensor=PoseSensor(rate_Hz=30, sd_xy_m=0, sd_theta_rad=0, delay_s=0.05))
    exact = make_world()
    for each in (world, exact):
        each.set_duty([0.7, -0.2, 0.5])
    for _, taken_us, pose in fixes_of(world, 400)[1:]:
        exact.step((taken_us - exact.c.time_us) // 100, 100)
        exact.step(taken_us - exact.c.time_us, 1)
        assert np.allclose(pose, exact.truth, atol=3e-6)


def test_fix_noise_statistics(make_world: Any) -> None:
    sensor = PoseSensor(rate_Hz=1000, sd_xy_m=0.005, sd_theta_rad=0.002, delay_s=0.0)
    poses = np.array([pose for _, _, pose in fixes_of(make_world(pose_sensor=sensor, seed=11), 4000)])
    assert len(poses) == 4000
    sd = np.array([0.005, 0.005, 0.002])
    assert np.all(np.abs(poses.mean(axis=0)) < 4 * sd / math.sqrt(4000))
    assert np.allclose(poses.std(axis=0), sd, rtol=0.05)
    correlation = np.corrcoef(poses.T) - np.eye(3)
    assert np.abs(correlation).max() < 0.07


def test_fix_drop_probability(make_world: Any) -> None:
    sensor = PoseSensor(rate_Hz=1000, delay_s=0.0, drop_probability=0.3)
    assert abs(len(fixes_of(make_world(pose_sensor=sensor, seed=3), 4000)) / 4000 - 0.7) < 0.03


def test_fix_heading_is_wrapped(make_world: Any) -> None:
    sensor = PoseSensor(rate_Hz=100, sd_xy_m=0, sd_theta_rad=0, delay_s=0.0)
    world = make_world(pose_sensor=sensor, start_pose=(0.0, 0.0, 10.0))
    (_, _, pose), *_ = fixes_of(world, 1)
    assert math.isclose(pose[2], 10.0 - 4 * math.pi)


def test_one_fix_per_call_and_each_once(make_world: Any) -> None:
    world = make_world(pose_sensor=PoseSensor(rate_Hz=1000, delay_s=0.0))
    world.step(4)
    taken = []
    for _ in range(7):
        sensors = world.sense()
        taken += [sensors.fix.taken_us] if sensors.has_fix else []
    assert taken == [0, 1000, 2000, 3000, 4000]


def test_unread_fixes_push_out_the_oldest(make_world: Any) -> None:
    world = make_world(pose_sensor=PoseSensor(rate_Hz=1000, delay_s=0.0))
    world.step(100)
    assert world.c.fix_count == lib.HIL_MAX_FIXES
    assert world.sense().fix.taken_us == (101 - lib.HIL_MAX_FIXES) * 1000


def slip_ratios(world: World, ticks: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    rows = []
    for _ in range(ticks):
        world.step()
        rows.append(list(world.c.slip_ratio))
    return np.array(rows)


def test_imposed_slip_stays_in_range_and_is_piecewise_linear(make_world: Any) -> None:
    ratios = slip_ratios(make_world(slip_max=0.1, slip_time_s=0.05, seed=5), 2000)[:, :3]
    assert ratios.min() >= 0.0
    assert ratios.max() <= 0.1
    bends = np.abs(np.diff(ratios, 2, axis=0)).max(axis=1) > 1e-9
    assert bends.sum() <= 2 * 2000 / 50
    assert 0.04 < ratios.mean() < 0.06
    assert np.abs(np.corrcoef(ratios.T) - np.eye(3)).max() < 0.5


def test_no_slip_unless_asked(make_world: Any) -> None:
    assert not slip_ratios(make_world(slip_max=0.0), 100).any()


def test_encoders_cannot_see_slip(make_world: Any) -> None:
    """Pure spin: the body turns less than the wheels say, by the slip ratio."""
    world = make_world(slip_max=0.2, slip_time_s=1e6, seed=4)
    world.set_duty([0.8] * 3)
    world.step(1000)
    spin = (
        0.0508
        / (3 * 0.2632)
        * sum(w * (1 - s) for w, s in zip(world.wheel_rad_s, list(world.c.slip_ratio), strict=False))
    )
    assert math.isclose(world.twist[2], spin, rel_tol=1e-3)


def run_bytes(make_world: Any, seed: int) -> bytes:
    world = make_world(slip_max=0.1, seed=seed, pose_sensor=PoseSensor(drop_probability=0.1))
    world.set_duty([0.8, -0.3, 0.5])
    world.step(500)
    return bytes(ffi.buffer(world.c)[ffi.offsetof("hil_world_t", "time_us") :])


def test_same_seed_same_bits(make_world: Any) -> None:
    assert run_bytes(make_world, 42) == run_bytes(make_world, 42)
    assert run_bytes(make_world, 42) != run_bytes(make_world, 43)
