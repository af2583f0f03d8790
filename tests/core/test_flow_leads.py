# SPDX-License-Identifier: MIT
"""Wheels that spin: a sensor of motion over the floor that has been right takes their place."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest

from omniwheel._core import ffi, lib
from tests.core.test_flow import ARM, Q_THETA, Q_XY, RADIUS_M, SD_M, SD_RAD, SPAN, TICK_S, Array, Core
from tests.core.test_flow_trust import Drive

SPINS = np.array([0.8, 0.05, 0.03])
"""Slip ratios: the first wheel turns five times as fast as it rolls."""


def ahead(core: Core, speed: float, turning: float, slip: Array, ticks: int) -> Array:
    """Drive ahead [m/s] and turn [rad/s] with these slip ratios; return the centre's true motion, from its start."""
    pose = np.zeros(3)
    for _ in range(ticks):
        moved = np.array([speed, 0.0, turning]) * TICK_S
        middle = pose[2] + moved[2] / 2
        pose += [math.cos(middle) * moved[0], math.sin(middle) * moved[0], moved[2]]
        core.predict(core.matrix @ moved / RADIUS_M / (1.0 - slip))
    return pose


def reading_of(moved: Array) -> Array:
    """What the sensor sees of the centre's motion: the way of its point in body axes of mid-way, and the turn."""
    c, s = math.cos(moved[2]), math.sin(moved[2])
    way = moved[:2] + np.array([c * ARM[0] - s * ARM[1], s * ARM[0] + c * ARM[1]]) - ARM
    c, s = math.cos(moved[2] / 2), math.sin(moved[2] / 2)
    return np.array([c * way[0] + s * way[1], c * way[1] - s * way[0], moved[2]])


def carried(pose: Array, moved: Array) -> Array:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([pose[0] + c * moved[0] - s * moved[1], pose[1] + s * moved[0] + c * moved[1], pose[2] + moved[2]])


@pytest.mark.parametrize("rows", [2, 3])
@pytest.mark.parametrize("wheels", [3, 4])
def test_the_pose_goes_on_from_the_start_of_the_reading(wheels: int, rows: int) -> None:
    """Against P = F P F^T + N: neither the wheels' motion nor their slip ratios are in what comes out."""
    core = Core(wheels)
    slip = np.resize(SPINS, wheels)
    ahead(core, 0.5, 0.4, np.full(wheels, 0.04), 400)
    x, p = core.x, core.p
    moved = ahead(core, 0.5, 0.4, slip, SPAN)
    by_wheels = core.x[2] - x[2]
    result = core.measure(reading_of(moved), rows, override_nis=16.0)
    assert result.overrode_wheels
    assert not result.within_gate
    if rows == 3:
        assert core.x[:3] == pytest.approx(carried(x, moved), abs=2e-5)
        doubt = SD_RAD**2
    else:
        assert core.x[2] - x[2] == pytest.approx(by_wheels, abs=1e-6)
        doubt = (result.residual_m / core.k.b[0][2]) ** 2
    assert (core.x[3:] == x[3:]).all(), "a wheel that spins teaches no slip ratio"
    way = core.x[:2] - x[:2]
    f = np.array([[1.0, 0.0, -way[1]], [0.0, 1.0, way[0]], [0.0, 0.0, 1.0]])
    lever = np.array([-way[1] / 2, way[0] / 2, 1.0])
    noise = np.diag([SPAN * Q_XY + SD_M**2] * 2 + [0.0]) + (SPAN * Q_THETA + doubt) * np.outer(lever, lever)
    sd = np.sqrt(np.diag(core.p))
    expected = f @ p[:3, :3] @ f.T + noise
    if rows == 3:  # to first order: within a slot the wheel turns the body by 20 mrad
        assert np.abs((core.p[:3, :3] - expected) / np.outer(sd, sd)[:3, :3]).max() < 0.04
    else:
        assert core.p[2, 2] > doubt
    assert np.abs((core.p[:2, 3:] - (f @ p[:3, 3:])[:2]) / np.outer(sd, sd)[:2, 3:]).max() < 0.04
    assert (core.p == core.p.T).all()
    assert np.linalg.eigvalsh(core.p / np.outer(sd, sd)).min() > -1e-4


def test_a_turn_that_the_wheels_did_not_see_is_half_a_turn_of_the_way() -> None:
    """They say that the robot goes to the left; in truth it turns on the way, evenly, and the reading shows that."""
    core = Core(mode=lib.OMNI_EKF_MODE_POSE)
    core.config.q_theta = 1e-5
    for _ in range(2 * SPAN):
        core.predict(core.matrix @ np.array([0.0, 1.0, 0.0]) * TICK_S / RADIUS_M)
    start = np.array([0.0, SPAN * TICK_S, 0.0])
    turn = 0.02
    chord = SPAN * TICK_S * np.array([-math.sin(turn / 2), math.cos(turn / 2)])
    moved = np.array([*chord, turn])
    assert core.measure(reading_of(moved), 3).within_gate
    assert core.x[:3] == pytest.approx(start + moved, abs=1e-5)


@pytest.mark.parametrize("age", [0, 4, 7, 30])
def test_a_late_fix_sees_the_way_that_the_sensor_saw(age: int) -> None:
    """It was taken before the wheels span. The history has the reading's motion, not theirs."""
    core = Core()
    ahead(core, 0.5, 0.4, np.full(3, 0.04), 400)
    x = core.x
    moved = np.zeros(3)
    for _ in range(3):
        moved = carried(moved, ahead(core, 0.5, 0.4, SPINS, SPAN))
        assert core.measure(reading_of(ahead(Core(), 0.5, 0.4, SPINS, SPAN)), 3, override_nis=16.0).overrode_wheels
    ahead(core, 0.5, 0.4, np.full(3, 0.04), age)
    before = core.x
    for axis in range(3):
        core.s.p[axis][axis] += 1.0  # nothing but the fix counts
    assert core.correct(x[:3], 3 * SPAN + age) == lib.OMNI_OK
    assert core.x[:3] == pytest.approx(before[:3], abs=1e-3)
    assert math.hypot(*(before[:2] - x[:2])) == pytest.approx(0.5 * (3 * SPAN + age) * TICK_S, rel=0.1)


@pytest.mark.parametrize("age", [1, 2, 3, 5, 6])
def test_readings_that_end_within_a_slot_lose_no_way(age: int) -> None:
    """Each counts for the slots that ended in it: what is left open is a slot's motion, and does not add up."""
    core = Core()
    ahead(core, 0.5, 0.4, np.full(3, 0.04), 400)
    ahead(core, 0.5, 0.4, SPINS, age)
    off = []
    for _ in range(100):
        start = core.x
        moved = ahead(core, 0.5, 0.4, SPINS, SPAN)
        assert core.measure(reading_of(moved), 3, age, override_nis=16.0).overrode_wheels
        off.append(core.x[:3] - carried(start, moved))
    total = np.abs(np.sum(off, axis=0))
    assert total[2] < 0.05, "a slot of the wheel's spin turns by 20 mrad"
    assert (total[:2] < 0.02).all(), "and moves by 5 mm"


def stopping(start: int, last: Array, tick: int) -> Array:
    """Brake from ``last`` within a quarter of a second."""
    return last * max(0.0, 1.0 - (tick - start) * 4e-3)


def proved() -> Drive:
    """A robot whose sensor may lead; it stands then for a second."""
    drive = Drive()
    drive.go(12.0)
    assert drive.core.flow.alignment_verified
    start = drive.core.time_us // 1000
    last = np.array([0.5 * math.cos(1.3e-3 * start), 0.5 * math.sin(0.7e-3 * start), math.sin(0.5e-3 * start)])
    drive.steer = partial(stopping, start, last)
    drive.go(1.0)
    assert drive.core.flow.long_distance_fits >= lib.OMNI_FLOW_OVERRIDE_AFTER
    return drive


def ramp(drive: Drive, *to: float) -> None:
    """Speed up from rest with 4 m/s², turning as fast as it goes."""
    start = drive.core.time_us // 1000
    steady = np.array(to)
    drive.steer = lambda tick: steady * min(1.0, (tick - start) * 4e-3 / np.hypot(*steady[:2]))


def dead(way: Array) -> Array:
    """A reading of one that no longer sees the floor: its turn is right."""
    noise = np.random.default_rng(round(1e9 * abs(way[2])))
    return np.array([*noise.normal(0.0, SD_M, 2), way[2]])


@pytest.mark.full
def test_one_that_died_while_the_robot_stood_does_not_lead() -> None:
    """What it says of its own speed never changes. But the turn says that no wheel spins."""
    drive = proved()
    drive.go(0.4, said=dead)
    ramp(drive, 0.6, 0.0, 0.0)
    usable = drive.go(5.0, said=dead)
    assert usable.index(False) < 1000
    assert drive.error_m < drive.error_alone_m + 0.3
    assert drive.error_m < 3.0 * math.sqrt(drive.core.p[0, 0] + drive.core.p[1, 1])


@pytest.mark.full
def test_one_way_that_is_dead_stays_found_while_the_other_fits() -> None:
    """One measuring wheel is off. The robot goes ahead and to the left in turn."""
    drive = proved()
    for leg in range(8):
        ramp(drive, *((0.5, 0.0, 0.0), (0.0, 0.5, 0.0))[leg % 2])
        drive.go(2.0, said=lambda way: np.array([0.0, way[1], way[2]]))
        start = drive.core.time_us // 1000
        last = np.array(((0.5, 0.0, 0.0), (0.0, 0.5, 0.0))[leg % 2])
        drive.steer = partial(stopping, start, last)
        drive.go(0.2, said=lambda way: np.array([0.0, way[1], way[2]]))
    assert drive.core.flow.readings_rejected > 100
    assert drive.error_m < drive.error_alone_m + 0.3


@pytest.mark.full
def test_pose_fixes_are_believed_against_one_that_leads() -> None:
    drive = proved()
    config = drive.core.config
    config.gate, config.r_xy, config.r_theta = 16.3, 4e-6, 4e-6
    drive.go(0.4, said=dead)
    ramp(drive, 0.6, 0.0, 0.0)
    refused = 0
    for _ in range(50):
        drive.go(0.1, said=dead)
        refused += drive.core.correct(drive.pose) != lib.OMNI_OK
        assert drive.error_m < 0.12
    assert refused <= 2
    assert drive.core.s.restarts == 0


@pytest.mark.full
def test_a_fix_within_a_reading_on_ice_is_no_refusal() -> None:
    drive = proved()
    drive.core.config.gate, drive.core.config.gate_restart = 0.0, 25
    ramp(drive, 0.6, 0.0, 0.0)
    drive.slip = np.roll(SPINS, 1)
    refused = drive.core.flow.readings_rejected
    for _ in range(4):
        assert all(drive.go(1.0))
        assert drive.core.correct(drive.pose) == lib.OMNI_OK
        drive.go(0.009)
    assert drive.core.flow.readings_rejected == refused
    assert drive.error_m < 0.02


@pytest.mark.full
@pytest.mark.parametrize("turning", [0.0, 3.0, 7.0])
def test_a_turn_of_the_body_is_no_change_of_speed(turning: float) -> None:
    """Straight through the room, in axes that turn; every tenth reading is lost."""
    drive = proved()
    start, heading = drive.core.time_us // 1000, drive.pose[2]

    def steer(tick: int) -> Array:
        speed = min(1.5, (tick - start) * 4e-3)
        return np.array(
            [speed * math.cos(drive.pose[2] - heading), -speed * math.sin(drive.pose[2] - heading), turning]
        )

    drive.steer = steer
    drive.go(1.0)
    drive.slip = np.roll(SPINS, 1)
    used, refused = drive.core.flow.readings_used, drive.core.flow.readings_rejected
    drive.go(2.0)
    assert drive.core.flow.readings_rejected == refused
    assert drive.core.flow.readings_used == used + 100
    assert drive.error_m < 0.1


@pytest.mark.full
def test_at_rest_a_drifting_turn_moves_nothing() -> None:
    drive = proved()
    before = drive.core.x
    usable = drive.go(10.0, said=lambda way: way + np.array([0.0, 0.0, 4e-4]))
    assert usable.index(False) < 1500
    assert np.abs(drive.core.x - before)[:3].max() < 1e-3


def test_a_turn_that_nothing_measures_is_as_unsure_as_it_can_be() -> None:
    core = Core()
    ahead(core, 0.5, 0.0, np.full(3, 0.04), 400)
    led = 0
    for _ in range(50):
        ahead(core, 0.5, 0.0, np.roll(SPINS, 1), SPAN)
        led += core.measure([0.5 * SPAN * TICK_S, 0.0, 0.0], 2, override_nis=16.0).overrode_wheels
    assert led > 25
    assert abs(core.x[2]) > 1.0
    assert abs(core.x[2]) < 2.0 * math.sqrt(core.p[2, 2])


def test_a_turn_that_nothing_measures_moves_the_centre_about_the_sensor() -> None:
    """Which is 0.3 m ahead of it: the robot drives ahead, so the centre may be to the side by 0.3 m times the turn."""
    core = Core()
    ahead(core, 0.5, 0.0, np.full(3, 0.04), 400)
    ahead(core, 0.5, 0.0, np.roll(SPINS, 1), SPAN)
    before = core.p
    flow = {"move": [0.5 * SPAN * TICK_S, 0.0, 0.0], "lever_arm_m": (0.3, 0.0), "r_xy": SD_M**2, "apply": True}
    given = ffi.new("omni_ekf_flow_t *", flow | {"span_us": 1000 * SPAN, "override_nis": 16.0})
    result = ffi.new("omni_ekf_flow_result_t *")
    assert lib.omni_pose_ekf_correct_flow(core.s, core.config, core.k, given, result)
    assert result.overrode_wheels
    turn_variance = core.p[2, 2] - before[2, 2]
    assert turn_variance > 1e-3
    assert core.p[1, 1] - before[1, 1] > 0.9 * 0.3**2 * turn_variance


@pytest.mark.full
def test_a_robot_whose_wheel_spins_knows_where_it_is() -> None:
    drive = Drive()
    drive.go(12.0)
    assert drive.core.flow.alignment_verified
    drive.slip = SPINS
    assert all(drive.go(4.0))
    assert drive.core.flow.readings_rejected <= 1
    assert drive.error_m < 0.02
    assert drive.error_alone_m > 0.5
    drive.slip = np.array([0.02, 0.05, 0.03])
    assert all(drive.go(6.0))
    assert not drive.core.flow.overriding
    assert drive.error_m < 0.03


def test_one_that_has_not_proved_where_it_points_does_not_lead() -> None:
    drive = Drive()
    drive.go(0.5)
    assert not drive.core.flow.alignment_verified
    used = drive.core.flow.readings_used
    drive.slip = SPINS
    for _ in range(10):
        drive.go(0.1)
        assert drive.core.flow.override_count == 0
    assert drive.core.flow.readings_used < used + 10


@pytest.mark.full
def test_it_leads_for_ten_seconds_at_most() -> None:
    """A sensor that says something else for good is no better than wheels that do."""
    drive, random = Drive(), np.random.default_rng(4)
    drive.go(12.0)
    usable = []
    for _ in range(130 * 5):
        drive.slip = random.permutation(SPINS)
        usable += drive.go(0.02)
    readings = usable.index(False) / SPAN
    assert 0.95 * lib.OMNI_FLOW_MAX_OVERRIDES < readings < 1.2 * lib.OMNI_FLOW_MAX_OVERRIDES


@pytest.mark.full
def test_a_reading_that_no_body_can_drive_does_not_lead_nor_do_those_after_it() -> None:
    drive = Drive()
    drive.go(12.0)
    drive.slip = SPINS
    drive.go(0.5)
    assert drive.core.flow.override_count > 10
    used, refused = drive.core.flow.readings_used, drive.core.flow.readings_rejected
    jumps = iter([np.array([0.02, 0.0, 0.0])])
    drive.go(0.3, said=lambda way: way + next(jumps, np.zeros(3)))
    assert drive.core.flow.readings_rejected > refused + 10
    assert drive.core.flow.readings_used <= used + 1
